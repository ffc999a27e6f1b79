// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/curve/clumps.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <span>

#include "wavecomb/core/vec.h"
#include "wavecomb/curve/segment.h"

namespace wavecomb {
namespace {

using ClumpLanes = FloatP<CurveClumps::kSegments>;

constexpr float kCells = 65535.f;
constexpr float kClumpRounding = 4e-6f;  ///< of triple products in float, over the sizes of terms

/// Parts rows of segments, by the middles of their boxes, until each part fills one clump.
class ClumpParting {
 public:
  explicit ClumpParting(const Mesh& mesh) : middles_(mesh.indices.size()) {
    for (uint32_t s = 0; s < middles_.size(); ++s) {
      const Bounds box = curve_bounds(mesh, s);
      const Vec3<float> middle = box.lo + box.hi;
      middles_[s] = {middle.x, middle.y, middle.z};
    }
  }

  /// Sorts; all clumps but the last are full.
  void run(std::span<uint32_t> segments) const {
    constexpr size_t kFull = CurveClumps::kSegments;
    if (segments.size() <= kFull) return;
    const int axis = longest(segments);
    const size_t half = ((segments.size() + kFull - 1) / kFull + 1) / 2 * kFull;
    const auto before = [&](uint32_t a, uint32_t b) {
      const float x = middles_[a][axis], y = middles_[b][axis];
      return x != y ? x < y : a < b;
    };
    std::nth_element(segments.begin(), segments.begin() + static_cast<ptrdiff_t>(half),
                     segments.end(), before);
    run(segments.first(half));
    run(segments.subspan(half));
  }

 private:
  int longest(std::span<const uint32_t> segments) const {
    std::array<float, 3> lo = middles_[segments[0]], hi = lo;
    for (const uint32_t s : segments)
      for (int k = 0; k < 3; ++k) {
        lo[k] = std::min(lo[k], middles_[s][k]);
        hi[k] = std::max(hi[k], middles_[s][k]);
      }
    int axis = 0;
    for (int k = 1; k < 3; ++k)
      if (hi[k] - lo[k] > hi[axis] - lo[axis]) axis = k;
    return axis;
  }

  std::vector<std::array<float, 3>> middles_;
};

float clump_size(const float* v) {
  return std::abs(v[0]) + std::abs(v[1]) + std::abs(v[2]);
}

/// Four control points, or their halves (de Casteljau).
struct ClumpHull {
  using F = ClumpLanes;
  using V = Vec3<F>;

  V p[4];

  ClumpHull first_half() const {
    const V a = (p[0] + p[1]) * F(0.5f), m = (p[1] + p[2]) * F(0.5f), am = (a + m) * F(0.5f);
    const V mb = (m + (p[2] + p[3]) * F(0.5f)) * F(0.5f);
    return {{p[0], a, am, (am + mb) * F(0.5f)}};
  }
  ClumpHull second_half() const { return ClumpHull{{p[3], p[2], p[1], p[0]}}.first_half(); }
};

/// The ray through the origin against hulls.
struct ClumpPassing {
  using F = ClumpLanes;
  using V = Vec3<F>;

  V d;
  F radius;
  F size_d;
  F rounding;  ///< of lengths times |d|
  F extent;    ///< no chord is longer

  /// Whether all points lie farther than the radius on one side of a plane through the origin.
  Mask<F> is_beside(const ClumpHull& hull, const V& n, const F& margin) const {
    const F a = dot(n, hull.p[0]), b = dot(n, hull.p[1]), c = dot(n, hull.p[2]),
            e = dot(n, hull.p[3]);
    const F least = min(min(a, b), min(c, e)), most = max(max(a, b), max(c, e));
    const F reach = fma(radius, sqrt(length_squared(n)), margin);
    return (least > reach) | (most < -reach);
  }

  /// Planes that hold the ray part it from the hull: that along the chord c, with normal d x c, and
  /// that square to the chord, with normal (d x c) x d.
  Mask<F> of(const ClumpHull& hull) const {
    const V beside = cross(d, V(hull.p[3] - hull.p[0]));
    const F margin = rounding * extent;
    return is_beside(hull, beside, margin) | is_beside(hull, cross(beside, d), F(margin * size_d));
  }

  /// Whether all points lie behind the origin, or farther along the ray than tfar.
  Mask<F> along(const ClumpHull& hull, float tfar) const {
    const F a = dot(d, hull.p[0]), b = dot(d, hull.p[1]), c = dot(d, hull.p[2]),
            e = dot(d, hull.p[3]);
    const F least = min(min(a, b), min(c, e)), most = max(max(a, b), max(c, e));
    const F d2 = length_squared(d), reach = fma(radius, sqrt(d2), rounding);
    return (most < -reach) | (least - reach > d2 * (tfar * 1.00001f));
  }
};

}  // namespace

CurveClumps::CurveClumps(const Mesh& mesh) : mesh_(mesh) {
  std::vector<uint32_t> order(mesh.indices.size());
  std::iota(order.begin(), order.end(), 0u);
  ClumpParting(mesh).run(order);
  clumps_.reserve((order.size() + kSegments - 1) / kSegments);
  for (size_t first = 0; first < order.size(); first += kSegments)
    clumps_.push_back(make(
        &order[first], static_cast<uint32_t>(std::min<size_t>(kSegments, order.size() - first))));
}

CurveClumps::Clump CurveClumps::make(const uint32_t* first, uint32_t n) const {
  Clump out{};
  const auto points = static_cast<uint32_t>(mesh_.segment_points());
  const auto point = [&](uint32_t k, uint32_t p) {
    const uint32_t segment = first[std::min(k, n - 1)];
    return (mesh_.indices[segment] & kCurveFirstPoint) + std::min(p, points - 1);
  };
  std::array<float, 3> lo, hi;
  lo.fill(kInfinity);
  hi.fill(-kInfinity);
  for (uint32_t k = 0; k < n; ++k)
    for (uint32_t p = 0; p < points; ++p)
      for (uint32_t axis = 0; axis < 3; ++axis) {
        const float x = mesh_.positions[3 * size_t{point(k, p)} + axis];
        lo[axis] = std::min(lo[axis], x);
        hi[axis] = std::max(hi[axis], x);
      }
  float widest = 0;
  for (uint32_t axis = 0; axis < 3; ++axis) {
    out.low[axis] = lo[axis];
    out.step[axis] = (hi[axis] - lo[axis]) / kCells;
    widest = std::max(widest, out.step[axis]);
  }
  for (uint32_t k = 0; k < kSegments; ++k) {
    float radius = 0;
    for (uint32_t p = 0; p < 4; ++p) {
      const size_t at = point(k, p);
      radius = std::max(radius, mesh_.radii[at]);
      for (uint32_t axis = 0; axis < 3; ++axis) {
        const float x = (mesh_.positions[3 * at + axis] - lo[axis]) / out.step[axis];
        const uint32_t i = 3 * p + axis;
        const uint32_t cell = out.step[axis] > 0 ? static_cast<uint32_t>(x + 0.5f) : 0u;
        out.cells[i / 2][k] |= cell << (16 * (i % 2));
      }
    }
    // Rounding to cells moves a point by less than one.
    out.radius[k] = 1.0001f * radius + widest;
    out.segment[k] = k < n ? first[k] : kNone;
  }
  return out;
}

Bounds CurveClumps::bounds(uint32_t clump) const {
  Bounds box;
  for (const uint32_t s : clumps_[clump].segment)
    if (s != kNone) box.add(curve_bounds(mesh_, s));
  return box;
}

uint32_t CurveClumps::may_meet(uint32_t clump, const float (&origin)[3], const float (&dir)[3],
                               float tfar) const {
  using F = ClumpLanes;
  const Clump& c = clumps_[clump];
  const float from[3] = {c.low[0] - origin[0], c.low[1] - origin[1], c.low[2] - origin[2]};
  const float extent = kCells * clump_size(c.step.data());
  const F radius = load<F>(c.radius.data());
  const float sizes = clump_size(c.low.data()) + clump_size(origin) + extent;
  const ClumpPassing passing{{F(dir[0]), F(dir[1]), F(dir[2])},
                             radius,
                             F(clump_size(dir)),
                             (radius + sizes) * (kClumpRounding * clump_size(dir)),
                             F(extent)};
  const auto coordinate = [&](uint32_t p, uint32_t axis) {
    const uint32_t i = 3 * p + axis;
    const UInt<F> cells = load<UInt<F>>(c.cells[i / 2].data());
    const UInt<F> mine = i % 2 == 0 ? UInt<F>(cells & 0xffffu) : UInt<F>(cells >> 16u);
    return fma(F(Int<F>(mine)), F(c.step[axis]), F(from[axis]));
  };
  ClumpHull hull;
  for (uint32_t p = 0; p < 4; ++p)
    hull.p[p] = {coordinate(p, 0), coordinate(p, 1), coordinate(p, 2)};

  Mask<F> met = Mask<F>(load<UInt<F>>(c.segment.data()) != UInt<F>(kNone));
  met &= not_(Mask<F>(passing.along(hull, tfar) | passing.of(hull)));
  if (none(met) || !mesh_.is_cubic()) return lane_bits<F>(met);
  const ClumpHull a = hull.first_half(), b = hull.second_half();
  const Mask<F> by = passing.of(a.first_half()) & passing.of(a.second_half()) &
                     passing.of(b.first_half()) & passing.of(b.second_half());
  return lane_bits<F>(Mask<F>(met & not_(by)));
}

}  // namespace wavecomb
