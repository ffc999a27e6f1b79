// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/geometry/curve/bvh_nodes.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <numeric>
#include <span>

#include "wavecomb/core/vec.h"
#include "wavecomb/geometry/curve/bezier.h"
#include "wavecomb/geometry/curve/capsules.h"
#include "wavecomb/geometry/curve/segment.h"

namespace wavecomb {
namespace {

using NodeLanes = FloatP<CurveBvhNodes::kMaxSubSegments>;

constexpr float kCells = 65535.f;
/// Largest cell coordinate to which a position is mapped. The value is below `kCells`, so that
/// coordinates stay in range after rounding.
constexpr float kLargestCell = 65000.f;
/// Segments are split if their length exceeds this multiple of their radius.
constexpr float kSlender = 32.f;
constexpr size_t kManySegments = size_t{1} << 20;
constexpr float kNodeRounding = 4e-6f;  ///< bound of the relative error of dot products in float

/// Capsule that contains a sub-segment: all points whose distance from the line from `a` to `b` is
/// at most `radius`.
struct SegmentCapsule {
  Vec3<float> a, b;
  float radius = 0;
};

/// Upper bound of the node indices of sub-segments. A sub-segment of a mesh has the number
/// `kNodesPerSegment` * segment + node.
constexpr uint32_t kNodesPerSegment = SubSegment::kNodes;

/// Returns the distance of a point from the line segment ab.
float distance_to_line(const Vec3<float>& p, const Vec3<float>& a, const Vec3<float>& b) {
  const Vec3<float> c = b - a, v = p - a;
  const float c2 = dot(c, c), at = c2 > 0 ? std::clamp(dot(v, c) / c2, 0.f, 1.f) : 0.f;
  return length(Vec3<float>(v - c * at));
}

/// Returns a capsule that contains a sub-segment. The distance to a line is a convex function, so
/// no point of the curve is farther from the line than the farthest control point.
SegmentCapsule sub_segment_capsule(const Mesh& mesh, uint32_t number) {
  std::array<Vec3<float>, 4> p;
  std::array<float, 4> r;
  const auto points = static_cast<uint32_t>(mesh.segment_points());
  const size_t first = mesh.indices[number / kNodesPerSegment] & kCurveFirstPoint;
  for (uint32_t k = 0; k < points; ++k) {
    const float* at = &mesh.positions[3 * (first + k)];
    p[k] = {at[0], at[1], at[2]};
    r[k] = mesh.radii[first + k];
  }
  if (points == 2) {
    p = {p[0], p[0] + (p[1] - p[0]) * (1.f / 3), p[0] + (p[1] - p[0]) * (2.f / 3), p[1]};
    r = {r[0], r[0] + (r[1] - r[0]) * (1.f / 3), r[0] + (r[1] - r[0]) * (2.f / 3), r[1]};
  }
  const uint32_t node = number % kNodesPerSegment;
  for (uint32_t bit = std::bit_floor(node) / 2; bit > 0; bit /= 2) {
    curve_math::Bezier::keep_half(p.data(), (node & bit) != 0, 0.5f);
    curve_math::Bezier::keep_half(r.data(), (node & bit) != 0, 0.5f);
  }
  const float bend =
      std::max(distance_to_line(p[1], p[0], p[3]), distance_to_line(p[2], p[0], p[3]));
  return {p[0], p[3], *std::max_element(r.begin(), r.end()) + bend};
}

/// Returns the number of times that a segment is halved. Shorter sub-segments have tighter bounds,
/// and thinner capsules if the curve is bent, but they take more memory.
uint32_t halvings(const Mesh& mesh, uint32_t segment, const SegmentCapsule& whole) {
  if (!(length(Vec3<float>(whole.b - whole.a)) > kSlender * whole.radius)) {
    const float r = mesh.radii[mesh.indices[segment] & kCurveFirstPoint];
    if (whole.radius <= 2 * r) return 0;
  }
  return mesh.indices.size() <= kManySegments ? 2 : 1;
}

/// Entry for a sub-segment in a list that is sorted by position: twice the midpoint of the
/// sub-segment's axis, and the sub-segment's number. The entry of a whole segment has the number of
/// its first sub-segment.
struct SubSegmentEntry {
  std::array<float, 3> middle;
  uint32_t number;
};

SubSegmentEntry entry_of(const SegmentCapsule& line, uint32_t number) {
  const Vec3<float> m = line.a + line.b;
  return {{m.x, m.y, m.z}, number};
}

/// Calls `work(i)` for each `i` in [first, end), in parallel tasks of at most `grain` calls each.
template <typename Work>
void for_range(size_t first, size_t end, size_t grain, const CurveBvhNodes::RunBoth& run_both,
               const Work& work) {
  if (end - first > grain) {
    const size_t middle = first + (end - first) / 2;
    return run_both([&] { for_range(first, middle, grain, run_both, work); },
                    [&] { for_range(middle, end, grain, run_both, work); });
  }
  for (size_t i = first; i < end; ++i) work(i);
}

/// Partitions entries recursively by their midpoints along the longest axis, until each part has at
/// most `full` entries. All parts have exactly `full` entries, except the last, which may have
/// fewer.
void partition_entries(std::span<SubSegmentEntry> entries, size_t full,
                       const CurveBvhNodes::RunBoth& run_both) {
  constexpr size_t kMany = 1u << 15;
  if (entries.size() <= full) return;
  std::array<float, 3> lo = entries[0].middle, hi = lo;
  for (const SubSegmentEntry& one : entries)
    for (size_t k = 0; k < 3; ++k) {
      lo[k] = std::min(lo[k], one.middle[k]);
      hi[k] = std::max(hi[k], one.middle[k]);
    }
  size_t axis = 0;
  for (size_t k = 1; k < 3; ++k)
    if (hi[k] - lo[k] > hi[axis] - lo[axis]) axis = k;
  const size_t half = ((entries.size() + full - 1) / full + 1) / 2 * full;
  const auto before = [axis](const SubSegmentEntry& a, const SubSegmentEntry& b) {
    const float x = a.middle[axis], y = b.middle[axis];
    return x != y ? x < y : a.number < b.number;
  };
  std::nth_element(entries.begin(), entries.begin() + static_cast<ptrdiff_t>(half), entries.end(),
                   before);
  const auto first = [&] { partition_entries(entries.first(half), full, run_both); };
  const auto second = [&] { partition_entries(entries.subspan(half), full, run_both); };
  if (entries.size() > kMany) return run_both(first, second);
  first();
  second();
}

/// Returns the number of sub-segments of a segment, which equals the node index of its first
/// sub-segment.
uint32_t sub_segment_count(const SubSegmentEntry& segment) {
  return segment.number % kNodesPerSegment;
}

/// Returns all segments in an order in which `group` consecutive segments are close together in
/// space.
std::vector<SubSegmentEntry> segments_of(const Mesh& mesh, size_t group,
                                         const CurveBvhNodes::RunBoth& run_both) {
  std::vector<SubSegmentEntry> out(mesh.indices.size());
  for_range(0, out.size(), 1u << 14, run_both, [&](size_t s) {
    const auto segment = static_cast<uint32_t>(s);
    const SegmentCapsule whole = sub_segment_capsule(mesh, kNodesPerSegment * segment + 1);
    out[s] = entry_of(whole, kNodesPerSegment * segment + (1u << halvings(mesh, segment, whole)));
  });
  partition_entries(out, group, run_both);
  return out;
}

/// Returns the L1 norm of a vector.
float l1_norm(const float* v) {
  return std::abs(v[0]) + std::abs(v[1]) + std::abs(v[2]);
}

}  // namespace

CurveBvhNodes::CurveBvhNodes(const Mesh& mesh, const RunBoth& run_both) : mesh_(mesh) {
  // Process one group of segments at a time, to limit the memory for sub-segments.
  constexpr size_t kGroup = 1u << 16;
  const std::vector<SubSegmentEntry> segments = segments_of(mesh, kGroup, run_both);
  const size_t groups = (segments.size() + kGroup - 1) / kGroup;
  const auto group = [&](size_t g) {
    return std::span(segments).subspan(g * kGroup, std::min(kGroup, segments.size() - g * kGroup));
  };
  std::vector<size_t> first(groups + 1, 0);
  for_range(0, groups, 1, run_both, [&](size_t g) {
    size_t sub_segments = 0;
    for (const SubSegmentEntry& s : group(g)) sub_segments += sub_segment_count(s);
    first[g + 1] = (sub_segments + kMaxSubSegments - 1) / kMaxSubSegments;
  });
  std::partial_sum(first.begin(), first.end(), first.begin());
  nodes_.resize(first.back());
  for_range(0, groups, 1, run_both, [&](size_t g) {
    std::vector<SubSegmentEntry> sub_segments;
    for (const SubSegmentEntry& s : group(g))
      for (uint32_t number = s.number; number < s.number + sub_segment_count(s); ++number)
        sub_segments.push_back(entry_of(sub_segment_capsule(mesh, number), number));
    partition_entries(sub_segments, kMaxSubSegments, run_both);
    for (size_t at = 0, c = first[g]; at < sub_segments.size(); at += kMaxSubSegments, ++c) {
      std::array<uint32_t, kMaxSubSegments> numbers;
      const size_t n = std::min<size_t>(kMaxSubSegments, sub_segments.size() - at);
      for (size_t k = 0; k < n; ++k) numbers[k] = sub_segments[at + k].number;
      nodes_[c] = make(numbers.data(), static_cast<uint32_t>(n));
    }
  });
}

CurveBvhNodes::Node CurveBvhNodes::make(const uint32_t* first, uint32_t n) const {
  Node out{};
  std::array<SegmentCapsule, kMaxSubSegments> sub_segments;
  Bounds box;
  for (uint32_t k = 0; k < kMaxSubSegments; ++k) {
    sub_segments[k] = sub_segment_capsule(mesh_, first[std::min(k, n - 1)]);
    box.add(sub_segments[k].a);
    box.add(sub_segments[k].b);
    out.number[k] = k < n ? first[k] : kNone;
  }
  float size = max_component(Vec3<float>(box.hi - box.lo));
  for (const SegmentCapsule& sub_segment : sub_segments)
    size = std::max(size, 1.001f * sub_segment.radius);
  out.low = {box.lo.x, box.lo.y, box.lo.z};
  out.step = size * (1.f / kLargestCell);
  const auto cells = [&](float x) { return out.step > 0 ? std::min(x / out.step, kCells) : 0.f; };
  const auto cell = [&](float x, uint32_t axis) {
    return static_cast<uint32_t>(cells(x - out.low[axis]) + 0.5f);
  };
  for (uint32_t k = 0; k < kMaxSubSegments; ++k) {
    const SegmentCapsule& sub_segment = sub_segments[k];
    const float a[3] = {sub_segment.a.x, sub_segment.a.y, sub_segment.a.z};
    const float b[3] = {sub_segment.b.x, sub_segment.b.y, sub_segment.b.z};
    for (uint32_t axis = 0; axis < 3; ++axis)
      out.cells[axis][k] = cell(a[axis], axis) | cell(b[axis], axis) << 16;
    // Enlarge the radius by one cell, since rounding positions to cells moves a point by less than
    // one cell.
    out.radius[k] = static_cast<uint16_t>(std::ceil(cells(1.0001f * sub_segment.radius)) + 1.f);
  }
  return out;
}

Bounds CurveBvhNodes::bounds(uint32_t node) const {
  const Node& c = nodes_[node];
  Bounds box;
  for (uint32_t k = 0; k < kMaxSubSegments; ++k)
    for (const uint32_t shift : {0u, 16u}) {
      float lo[3], hi[3];
      for (uint32_t axis = 0; axis < 3; ++axis) {
        const auto cell = static_cast<float>((c.cells[axis][k] >> shift) & 0xffffu);
        const float x = c.low[axis] + c.step * cell;
        const float reach = c.step * static_cast<float>(c.radius[k]) + 1e-6f * std::abs(x);
        lo[axis] = x - reach;
        hi[axis] = x + reach;
      }
      box.add({lo[0], lo[1], lo[2]});
      box.add({hi[0], hi[1], hi[2]});
    }
  return box;
}

uint32_t CurveBvhNodes::may_hit(uint32_t node, const CurveRay& ray, float tfar) const {
  using F = NodeLanes;
  const Node& c = nodes_[node];
  const float from[3] = {c.low[0] - ray.origin[0], c.low[1] - ray.origin[1],
                         c.low[2] - ray.origin[2]};
  alignas(32) float radii[kMaxSubSegments];
  for (uint32_t k = 0; k < kMaxSubSegments; ++k) radii[k] = static_cast<float>(c.radius[k]);
  const F radius = load<F>(radii) * c.step;
  const F rounding =
      (radius + (l1_norm(c.low.data()) + l1_norm(ray.origin) + 3 * kCells * c.step)) *
      kNodeRounding;
  Vec3<F> cell_a, cell_b;
  const auto decode = [&](uint32_t axis, F& a, F& b) {
    const UInt<F> cells = load<UInt<F>>(c.cells[axis].data());
    a = F(Int<F>(cells & 0xffffu));
    b = F(Int<F>(cells >> 16u));
  };
  decode(0, cell_a.x, cell_b.x);
  decode(1, cell_a.y, cell_b.y);
  decode(2, cell_a.z, cell_b.z);
  // Transforms the ends of the capsules to the ray's coordinate system, where the ray is the z
  // axis.
  const auto to_ray_space = [&](uint32_t n, const Vec3<F>& cell) {
    const auto& e = ray.axis[n];
    const F start(e[0] * from[0] + e[1] * from[1] + e[2] * from[2]);
    return fma(cell.x, F(e[0] * c.step),
               fma(cell.y, F(e[1] * c.step), fma(cell.z, F(e[2] * c.step), start)));
  };
  const Vec3<F> a(to_ray_space(0, cell_a), to_ray_space(1, cell_a), to_ray_space(2, cell_a));
  const Vec3<F> b(to_ray_space(0, cell_b), to_ray_space(1, cell_b), to_ray_space(2, cell_b));
  const F z_far = F(tfar * ray.length * 1.00001f) + rounding;
  const Mask<F> passed = passes_capsules<F>(a, b, radius, rounding, F(-rounding), z_far) |
                         Mask<F>(load<UInt<F>>(c.number.data()) == UInt<F>(kNone));
  return lane_bits<F>(not_(passed));
}

}  // namespace wavecomb
