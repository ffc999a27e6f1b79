// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/geometry/tessellation/screen_size.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "wavecomb/geometry/tessellation/point.h"

namespace wavecomb {
namespace {

/// Weight of the mean length of edges outside the image.
constexpr double kOutsideWeight = 0.125;
/// Factor by which the image bounds are enlarged.
constexpr double kMargin = 1.1;

Point transformed(const double* m, const Point& p) {
  return {p.x * m[0] + p.y * m[4] + p.z * m[8] + m[12],
          p.x * m[1] + p.y * m[5] + p.z * m[9] + m[13],
          p.x * m[2] + p.y * m[6] + p.z * m[10] + m[14]};
}

bool is_inside(const Point& p, const ScreenView& view) {
  if (view.is_all_round) return true;
  if (!(p.z < 0)) return false;
  const double w = view.is_parallel ? 1 : -p.z;
  const double x = p.x / w - view.centre[0], y = p.y / w - view.centre[1];
  return std::abs(x) <= kMargin * view.half[0] && std::abs(y) <= kMargin * view.half[1];
}

/// Mean of edge lengths, weighted by length.
struct Mean {
  double sum = 0, squares = 0;
  void add(double length) {
    sum += length;
    squares += length * length;
  }
  double value() const { return sum > 0 ? squares / sum : 0; }
};

}  // namespace

double edge_pixels(std::span<const float> points, std::span<const int32_t> face_sizes,
                   std::span<const int32_t> corners, const double* to_world,
                   const ScreenView& view) {
  std::vector<Point> projected(points.size() / 3);
  for (size_t i = 0; i < projected.size(); ++i) {
    const Point p{points[3 * i], points[3 * i + 1], points[3 * i + 2]};
    projected[i] = transformed(view.to_camera.data(), transformed(to_world, p));
  }
  Mean in_image, outside;
  size_t at = 0;
  for (const int32_t size : face_sizes) {
    const auto count = static_cast<size_t>(std::max(size, 0));
    for (size_t c = 0; c < count; ++c) {
      const Point& a = projected[static_cast<size_t>(corners[at + c])];
      const Point& b = projected[static_cast<size_t>(corners[at + (c + 1) % count])];
      const Point along = b - a, middle = (a + b) * 0.5;
      const double length = length_of(along);
      // Use at least half the edge length as the distance, so that edges that pass through the
      // camera have a finite projected size.
      const double distance = view.is_parallel ? 1 : std::max(length_of(middle), 0.5 * length);
      if (!(distance > 0)) continue;
      const double pixels = view.pixels * length / distance;
      if (is_inside(a, view) || is_inside(b, view) || is_inside(middle, view))
        in_image.add(pixels);
      else
        outside.add(kOutsideWeight * pixels);
    }
    at += count;
  }
  return std::max(in_image.value(), outside.value());
}

}  // namespace wavecomb
