// SPDX-License-Identifier: Apache-2.0
/// Texture coordinates at hits.
#pragma once

#include <array>

#include "wavecomb/geometry/hit/curve_uv.h"
#include "wavecomb/geometry/hit/surface_reader.h"

namespace wavecomb {

/// Texture coordinates over a triangle: the coordinates of vertex 0, and the differences between
/// these and the coordinates of the other two vertices.
template <typename F>
struct UvTriangle {
  Vec2<F> t0, d1, d2;

  UvTriangle(const Vec2<F>& a, const Vec2<F>& b, const Vec2<F>& c)
      : t0(a), d1{b.x - a.x, b.y - a.y}, d2{c.x - a.x, c.y - a.y} {}
  /// Returns the texture coordinates at barycentrics (b1, b2) of vertices 1 and 2.
  Vec2<F> at(const F& b1, const F& b2) const {
    return {fma(d2.x, b2, fma(d1.x, b1, t0.x)), fma(d2.y, b2, fma(d1.y, b1, t0.y))};
  }
};

namespace detail {

/// Returns the texture coordinates of triangle `prim`, whose vertices are `corners`, or the
/// barycentrics if the mesh has no texture coordinates.
template <typename F>
WAVECOMB_INLINE UvTriangle<F> uv_triangle(const MeshReader<F>& mesh,
                                          const std::array<UInt<F>, 3>& corners,
                                          const UInt<F>& prim, const Mask<F>& active) {
  using U = UInt<F>;
  const Mask<F> has_uv = Mask<F>((mesh.flags & (kUvsPerVertex | kUvsPerCorner)) != U(0u)) & active;
  Vec2<F> t0{F(0.f), F(0.f)}, t1{F(1.f), F(0.f)}, t2{F(0.f), F(1.f)};
  if (any(has_uv)) {
    const Mask<U> selected(Mask<F>((mesh.flags & kUvsPerCorner) != U(0u)));
    const auto fetch = [&](const U& at, const U& index, Vec2<F>& out) {
      const Vec2<F> value = mesh.vec2(&MeshRecord::uvs, select(selected, at, index), has_uv);
      out = {select(has_uv, value.x, out.x), select(has_uv, value.y, out.y)};
    };
    const U corner = prim * 3u;
    fetch(corner, corners[0], t0);
    fetch(corner + 1u, corners[1], t1);
    fetch(corner + 2u, corners[2], t2);
  }
  return {t0, t1, t2};
}

}  // namespace detail

/// Returns the texture coordinates of a hit at (u, v) of primitive `prim`. The result equals the
/// texture coordinates that setup_surface() computes.
template <typename F>
inline Vec2<F> hit_uv(const MeshRecord* meshes, const UInt<F>& mesh, const UInt<F>& prim,
                      const F& u, const F& v, const Mask<F>& active) {
  using U = UInt<F>;
  const detail::MeshReader<F> reader(meshes, mesh, active);
  const auto is = [&](uint32_t flag) { return active & Mask<F>((reader.flags & flag) != U(0u)); };
  const Mask<F> curved = is(kIsCurved), flat = active & not_(curved);
  Vec2<F> uv{u, v};
  if (any(flat)) {
    const Vec2<F> t =
        detail::uv_triangle<F>(reader, reader.corners(prim, flat), prim, flat).at(u, v);
    uv = {select(flat, t.x, uv.x), select(flat, t.y, uv.y)};
  }
  if (any(curved)) {
    const Vec2<F> c =
        detail::curve_uv<F>(reader, prim, u, v, curved, curved & not_(is(kIsDots))).uv;
    uv = {select(curved, c.x, uv.x), select(curved, c.y, uv.y)};
  }
  return uv;
}

}  // namespace wavecomb
