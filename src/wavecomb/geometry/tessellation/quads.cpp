// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/geometry/tessellation/quads.h"

#include <algorithm>

#include "wavecomb/geometry/tessellation/point.h"

namespace wavecomb {

std::vector<int64_t> split_quads(std::span<const float> points, std::span<const int32_t> indices,
                                 std::span<const int64_t> starts) {
  constexpr int kFirst[6] = {0, 1, 2, 0, 2, 3}, kOther[6] = {0, 1, 3, 1, 2, 3};
  const size_t count = starts.empty() ? indices.size() / 4 : starts.size();
  std::vector<int64_t> corners;
  corners.reserve(6 * count);
  for (size_t q = 0; q < count; ++q) {
    const auto start = starts.empty() ? static_cast<int64_t>(4 * q) : starts[q];
    Point p[4];
    for (int k = 0; k < 4; ++k) {
      const float* at = &points[3 * static_cast<size_t>(indices[static_cast<size_t>(start + k)])];
      p[k] = {at[0], at[1], at[2]};
    }
    const Point d1 = p[1] - p[0], d2 = p[2] - p[0], d3 = p[3] - p[0];
    // For both diagonals, the sum of the two triangle normals is the quad's normal.
    const Point turn0 = cross_of(d1, d2), turn1 = cross_of(d2, d3), turn2 = cross_of(d1, d3);
    const Point normal = turn0 + turn1;
    const double a = dot_of(turn0, normal), b = dot_of(turn1, normal), c = dot_of(turn2, normal);
    const double whole = a + b;
    const bool other = std::min(c, whole - c) > std::min(a, b) + 1e-6 * whole;
    for (const int k : other ? kOther : kFirst) corners.push_back(start + k);
  }
  return corners;
}

}  // namespace wavecomb
