// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/geometry/mesh/triangle_columns.h"

#include <algorithm>
#include <cmath>

namespace wavecomb {
namespace {

/// All lines have the direction (kSlopeX, kSlopeY, 1). A line is identified by two coordinates that
/// are equal for all its points, (x - kSlopeX z, y - kSlopeY z).
constexpr float kSlopeX = 0.2371f, kSlopeY = 0.1549f;
constexpr uint32_t kMaxCells = 512;  ///< number of grid cells along one side
constexpr size_t kMaxEntries = 16;   ///< maximum mean number of grid cells per triangle

}  // namespace

Vec3<float> TriangleColumns::vertex(uint32_t i) const {
  const auto p = positions_.subspan(size_t{3} * i, 3);
  return {p[0] - kSlopeX * p[2], p[1] - kSlopeY * p[2], p[2]};
}

uint32_t TriangleColumns::cell(float at, float lowest, float per_unit) const {
  const float c = (at - lowest) * per_unit, last = static_cast<float>(side_ - 1);
  return c > 0 ? static_cast<uint32_t>(std::min(c, last)) : 0;
}

TriangleColumns::TriangleColumns(const Mesh& mesh)
    : positions_(mesh.positions), indices_(mesh.indices) {
  const size_t count = mesh.triangle_count();
  side_ = std::clamp(static_cast<uint32_t>(std::sqrt(static_cast<double>(count))), 1u, kMaxCells);
  for (int k = 0; k < 2; ++k) low_[k] = 1e30f, high_[k] = -1e30f;
  for (const uint32_t i : indices_) {
    const Vec3<float> p = vertex(i);
    low_[0] = std::min(low_[0], p.x), high_[0] = std::max(high_[0], p.x);
    low_[1] = std::min(low_[1], p.y), high_[1] = std::max(high_[1], p.y);
  }
  const auto each_cell = [&](size_t t, const auto& visit) {
    const Vec3<float> a = vertex(indices_[3 * t]), b = vertex(indices_[3 * t + 1]),
                      c = vertex(indices_[3 * t + 2]);
    const auto [x0, x1] = std::minmax({a.x, b.x, c.x});
    const auto [y0, y1] = std::minmax({a.y, b.y, c.y});
    const uint32_t from = cell(x0, low_[0], per_unit_[0]), to = cell(x1, low_[0], per_unit_[0]);
    const uint32_t above = cell(y1, low_[1], per_unit_[1]);
    for (uint32_t y = cell(y0, low_[1], per_unit_[1]); y <= above; ++y)
      for (uint32_t x = from; x <= to; ++x) visit(size_t{y} * side_ + x);
  };
  // Use fewer grid cells if many triangles each overlap many cells, as in a triangle fan.
  for (;; side_ /= 2) {
    for (int k = 0; k < 2; ++k)
      per_unit_[k] = high_[k] > low_[k] ? static_cast<float>(side_) / (high_[k] - low_[k]) : 0.f;
    size_t entries = 0;
    for (size_t t = 0; t < count; ++t) each_cell(t, [&](size_t) { ++entries; });
    if (side_ == 1 || entries <= kMaxEntries * count) break;
  }
  first_.assign(size_t{side_} * side_ + 1, 0);
  for (size_t t = 0; t < count; ++t) each_cell(t, [&](size_t k) { ++first_[k + 1]; });
  for (size_t k = 1; k < first_.size(); ++k) first_[k] += first_[k - 1];
  triangles_.resize(first_.back());
  std::vector<uint32_t> next(first_.begin(), first_.end() - 1);
  for (size_t t = 0; t < count; ++t)
    each_cell(t, [&](size_t k) { triangles_[next[k]++] = static_cast<uint32_t>(t); });
}

FacesLeft TriangleColumns::faces_left(const Vec3<float>& point, size_t& tests) const {
  const Vec3<float> p{point.x - kSlopeX * point.z, point.y - kSlopeY * point.z, point.z};
  if (p.x < low_[0] || p.x > high_[0] || p.y < low_[1] || p.y > high_[1]) return {};
  const size_t k =
      size_t{cell(p.y, low_[1], per_unit_[1])} * side_ + cell(p.x, low_[0], per_unit_[0]);
  FacesLeft left;
  for (uint32_t i = first_[k]; i < first_[k + 1]; ++i, ++tests) {
    const uint32_t* corner = &indices_[size_t{3} * triangles_[i]];
    const Vec3<float> a = vertex(corner[0]) - p, b = vertex(corner[1]) - p,
                      c = vertex(corner[2]) - p;
    // Signed areas of the sub-triangles opposite the three corners, projected along the line.
    const float u = b.x * c.y - b.y * c.x, v = c.x * a.y - c.y * a.x, w = a.x * b.y - a.y * b.x;
    const float all = u + v + w;
    if (all == 0 || (u < 0) != (all < 0) || (v < 0) != (all < 0) || (w < 0) != (all < 0)) continue;
    const float distance = (u * a.z + v * b.z + w * c.z) / all;
    const int side = all > 0 ? 1 : -1;
    if (distance > 0) left.ahead += side;
    if (distance < 0) left.behind -= side;
  }
  return left;
}

}  // namespace wavecomb
