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
constexpr float kClumpRounding = 4e-6f;  ///< of sums of products in float, over their terms

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

/// Four control points as the ray sees them, in axes square to it, or their halves (de Casteljau).
struct ClumpHull {
  using F = ClumpLanes;
  F x[4], y[4];

  ClumpHull first_half() const {
    ClumpHull out;
    halve(x, out.x);
    halve(y, out.y);
    return out;
  }
  ClumpHull second_half() const {
    return ClumpHull{{x[3], x[2], x[1], x[0]}, {y[3], y[2], y[1], y[0]}}.first_half();
  }

 private:
  static void halve(const F* p, F* to) {
    const F half(0.5f), m = (p[1] + p[2]) * half, a = (p[0] + p[1]) * half, am = (a + m) * half;
    to[0] = p[0];
    to[1] = a;
    to[2] = am;
    to[3] = (am + (m + (p[2] + p[3]) * half) * half) * half;
  }
};

/// Whether the ray, which is the origin here, passes by: all points lie farther than the radius on
/// one side of a line through it, along the chord or square to it.
Mask<ClumpLanes> passes(const ClumpHull& h, const ClumpLanes& radius, const ClumpLanes& rounding) {
  using F = ClumpLanes;
  const F cx = h.x[3] - h.x[0], cy = h.y[3] - h.y[0];
  const F length = sqrt(fma(cx, cx, F(cy * cy)));
  // A chord is rounded as the points are; where one of these is within the radius, none is farther
  // than the chord is long beyond that.
  const F reach = fma(radius, length, F(rounding * (length + radius)));
  const auto beside = [&](int k) { return fma(cx, h.y[k], F(-(cy * h.x[k]))); };
  const auto along = [&](int k) { return fma(cx, h.x[k], F(cy * h.y[k])); };
  const F b[3] = {beside(0), beside(1), beside(2)};  // and that of 3 is that of 0
  const F a[4] = {along(0), along(1), along(2), along(3)};
  return (min(min(b[0], b[1]), b[2]) > reach) | (max(max(b[0], b[1]), b[2]) < -reach) |
         (min(min(a[0], a[1]), min(a[2], a[3])) > reach) |
         (max(max(a[0], a[1]), max(a[2], a[3])) < -reach);
}

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

CurveClumps::Ray::Ray(const float (&origin)[3], const float (&dir)[3])
    : o{origin[0], origin[1], origin[2]} {
  length = std::sqrt(dir[0] * dir[0] + dir[1] * dir[1] + dir[2] * dir[2]);
  const float inverse = 1.f / length;
  const float d[3] = {dir[0] * inverse, dir[1] * inverse, dir[2] * inverse};
  const float sign = std::copysign(1.f, d[2]), a = -1.f / (sign + d[2]), b = d[0] * d[1] * a;
  axis = {{{1.f + sign * d[0] * d[0] * a, sign * b, -sign * d[0]},
           {b, sign + d[1] * d[1] * a, -d[1]},
           {d[0], d[1], d[2]}}};
}

uint32_t CurveClumps::may_meet(uint32_t clump, const Ray& ray, float tfar) const {
  using F = ClumpLanes;
  const Clump& c = clumps_[clump];
  const float from[3] = {c.low[0] - ray.o[0], c.low[1] - ray.o[1], c.low[2] - ray.o[2]};
  const F radius = load<F>(c.radius.data());
  const F rounding = (radius + (clump_size(c.low.data()) + clump_size(ray.o.data()) +
                                kCells * clump_size(c.step.data()))) *
                     kClumpRounding;
  ClumpHull hull;
  F near(0.f), far(0.f);
  for (uint32_t p = 0; p < 4; ++p) {
    F cell[3];
    for (uint32_t k = 0; k < 3; ++k) {
      const uint32_t i = 3 * p + k;
      const UInt<F> cells = load<UInt<F>>(c.cells[i / 2].data());
      cell[k] = F(Int<F>(i % 2 == 0 ? UInt<F>(cells & 0xffffu) : UInt<F>(cells >> 16u)));
    }
    const auto along = [&](uint32_t n) {
      const auto& e = ray.axis[n];
      const F start(e[0] * from[0] + e[1] * from[1] + e[2] * from[2]);
      return fma(cell[0], F(e[0] * c.step[0]),
                 fma(cell[1], F(e[1] * c.step[1]), fma(cell[2], F(e[2] * c.step[2]), start)));
    };
    hull.x[p] = along(0);
    hull.y[p] = along(1);
    const F z = along(2);
    near = p == 0 ? z : min(near, z);
    far = p == 0 ? z : max(far, z);
  }
  const F reach = radius + rounding;
  Mask<F> by = (far < -reach) | (near - reach > F(tfar * ray.length * 1.00001f)) |
               passes(hull, radius, rounding) |
               Mask<F>(load<UInt<F>>(c.segment.data()) == UInt<F>(kNone));
  if (all(by) || !mesh_.is_cubic()) return lane_bits<F>(not_(by));
  const ClumpHull a = hull.first_half(), b = hull.second_half();
  by |= passes(a, radius, rounding) & passes(b, radius, rounding);
  if (all(by)) return 0;
  by |= passes(a.first_half(), radius, rounding) & passes(a.second_half(), radius, rounding) &
        passes(b.first_half(), radius, rounding) & passes(b.second_half(), radius, rounding);
  return lane_bits<F>(not_(by));
}

}  // namespace wavecomb
