// SPDX-License-Identifier: Apache-2.0
/// Lens distortion, and the shape of the aperture.
///
/// Lens distortion is stored as a table over the image. For each image point, the table holds the
/// position where the point's ray would cross an image without distortion. Brown's model (D. C.
/// Brown, "Close-Range Camera Calibration", Photogrammetric Engineering 37(8), 1971, in OpenCV's
/// notation) maps a point (x, y) of the plane at distance 1 to its image. With r^2 = x^2 + y^2 and
/// y down,
///   x' = x (1 + k1 r^2 + k2 r^4 + k3 r^6) + 2 p1 x y + p2 (r^2 + 2 x^2)
///   y' = y (1 + k1 r^2 + k2 r^4 + k3 r^6) + p1 (r^2 + 2 y^2) + 2 p2 x y
/// and the table holds the inverse.
#pragma once

#include <array>
#include <vector>

#include "wavecomb/core/math.h"
#include "wavecomb/core/rows/rows.h"
#include "wavecomb/core/warp.h"
#include "wavecomb/scene/camera/camera.h"

namespace wavecomb {

/// Mapping from pixels to the camera's window: the window's upper left corner, and the size of a
/// pixel on the window.
struct PixelGrid {
  float x0, y1, step_x, step_y;
};

/// Table of undistorted positions, with the same number of nodes along both axes and bilinear
/// interpolation between them.
struct LensTable {
  uint32_t across = 0;         ///< table nodes along each edge of the image; 0 without distortion
  float per_x = 0, per_y = 0;  ///< cells per pixel
  /// (x, y) of each node, in pixels of the undistorted image, row by row.
  std::vector<float> nodes;

  LensTable() = default;
  /// Builds the table of a camera with distortion. Throws Error if some image point has no ray.
  LensTable(const Camera& camera, const PixelGrid& grid, uint32_t width, uint32_t height);
  bool empty() const { return across == 0; }
};

/// Returns the undistorted position of (x, y), both in pixels from the upper left corner.
template <typename F>
[[gnu::noinline, gnu::cold]] Vec2<F> undistorted(const LensTable& table, const F& x, const F& y,
                                                 const Mask<F>& active) {
  using U = UInt<F>;
  const F last(static_cast<float>(table.across) - 2.f);
  const F u = x * table.per_x, v = y * table.per_y;
  const F column = floor(clamp(u, F(0.f), last)), row = floor(clamp(v, F(0.f), last));
  const F a = u - column, b = v - row;
  const U at = (U(to_int<F>(row)) * table.across + U(to_int<F>(column))) * 2u;
  const auto mixed = [&](uint32_t word) {
    const auto node = [&](uint32_t right, uint32_t down) {
      return gather<F>(table.nodes.data(), at + (2u * (right + down * table.across) + word),
                       active);
    };
    const F top = fma(F(node(1, 0) - node(0, 0)), a, node(0, 0));
    const F bottom = fma(F(node(1, 1) - node(0, 1)), a, node(0, 1));
    return F(fma(F(bottom - top), b, top));
  };
  return {mixed(0), mixed(1)};
}

/// Samples the regular polygon with `blades` corners in the unit circle uniformly by area. One
/// corner is at the angle `turn`, as a fraction of a full turn.
template <typename F>
[[gnu::noinline, gnu::cold]] Vec2<F> square_to_polygon(const F& u, const F& v, float blades,
                                                       float turn) {
  const F scaled = u * blades, blade = min(floor(scaled), F(blades - 1.f));
  const F far = safe_sqrt(F(scaled - blade)), side = far * v;
  const auto corner = [&](const F& k) {
    const F around = fma(k, F(1.f / blades), F(turn));
    return sincos_2pi<F>(F(around - floor(around)));
  };
  const SinCos<F> p = corner(blade), q = corner(F(blade + 1.f));
  return {fma(side, F(q.cos - p.cos), F(far * p.cos)), fma(side, F(q.sin - p.sin), F(far * p.sin))};
}

/// Samples the camera's aperture uniformly by area, in scene units.
template <typename F>
inline Vec2<F> aperture_point(const Camera& camera, const F& u, const F& v) {
  Vec2<F> p;
  if (camera.aperture_blades >= 3) [[unlikely]]
    p = square_to_polygon<F>(u, v, camera.aperture_blades, camera.aperture_rotation / 360.f);
  else
    p = square_to_disk(u, v);
  return {p.x * (camera.lens_radius / camera.lens_squeeze), p.y * camera.lens_radius};
}

}  // namespace wavecomb
