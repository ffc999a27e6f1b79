// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/curve/clumps.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <numeric>
#include <span>

#include "wavecomb/core/vec.h"
#include "wavecomb/curve/segment.h"

namespace wavecomb {
namespace {

using ClumpLanes = FloatP<CurveClumps::kPieces>;

constexpr float kCells = 65535.f;
constexpr float kSlender = 32.f;  ///< chord over radius above which segments are halved
constexpr size_t kFewSegments = 1u << 18;
constexpr float kClumpRounding = 4e-6f;  ///< of sums of products in float, over their terms

/// A segment, or a half or quarter of it: its control points and its greatest radius. Lines have
/// their two ends, each twice.
struct ClumpPiece {
  std::array<Vec3<float>, 4> p;
  float radius = 0;
};

/// Pieces are numbered segment by segment as nodes of a tree: 1 is all of a segment, 2 n and 2 n +
/// 1 are the halves of n.
constexpr uint32_t kPieceNodes = 8;

ClumpPiece piece_of(const Mesh& mesh, uint32_t number) {
  ClumpPiece out;
  const auto points = static_cast<uint32_t>(mesh.segment_points());
  const size_t first = mesh.indices[number / kPieceNodes] & kCurveFirstPoint;
  for (uint32_t k = 0; k < 4; ++k) {
    const size_t i = first + (points == 4 ? k : k / 2);
    out.p[k] = {mesh.positions[3 * i], mesh.positions[3 * i + 1], mesh.positions[3 * i + 2]};
    out.radius = std::max(out.radius, mesh.radii[i]);
  }
  auto& p = out.p;
  const uint32_t node = number % kPieceNodes;
  for (uint32_t bit = std::bit_floor(node) / 2; bit > 0; bit /= 2) {
    const Vec3<float> a = (p[0] + p[1]) * 0.5f, m = (p[1] + p[2]) * 0.5f, b = (p[2] + p[3]) * 0.5f;
    const Vec3<float> am = (a + m) * 0.5f, mb = (m + b) * 0.5f, middle = (am + mb) * 0.5f;
    if ((node & bit) == 0)
      p = {p[0], a, am, middle};
    else
      p = {middle, mb, b, p[3]};
  }
  return out;
}

/// How often a segment is halved, so that boxes of what runs across the axes are less empty: a
/// clump's box is as large as the pieces in it are long. Halves take as much memory as the segments
/// themselves, so that quarters are made of few.
uint32_t halvings(const Mesh& mesh, uint32_t segment) {
  if (!mesh.is_cubic()) return 0;
  const ClumpPiece whole = piece_of(mesh, kPieceNodes * segment + 1);
  const Vec3<float> chord = whole.p[3] - whole.p[0];
  if (!(std::sqrt(dot(chord, chord)) > kSlender * whole.radius)) return 0;
  return mesh.indices.size() <= kFewSegments ? 2 : 1;
}

std::vector<uint32_t> pieces_of(const Mesh& mesh) {
  std::vector<uint32_t> out;
  for (uint32_t s = 0; s < mesh.indices.size(); ++s) {
    const uint32_t n = 1u << halvings(mesh, s);
    for (uint32_t i = 0; i < n; ++i) out.push_back(kPieceNodes * s + n + i);
  }
  return out;
}

/// Parts rows of pieces, by the middles of their chords, until each part fills one clump.
class ClumpParting {
 public:
  explicit ClumpParting(const Mesh& mesh, std::span<const uint32_t> pieces) {
    middles_.reserve(pieces.size());
    for (const uint32_t piece : pieces) {
      const ClumpPiece one = piece_of(mesh, piece);
      const Vec3<float> m = one.p[0] + one.p[3];
      middles_.push_back({m.x, m.y, m.z});
    }
  }

  /// Sorts; all clumps but the last are full.
  void run(std::span<uint32_t> segments) const {
    constexpr size_t kFull = CurveClumps::kPieces;
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
  const std::vector<uint32_t> pieces = pieces_of(mesh);
  std::vector<uint32_t> order(pieces.size());
  std::iota(order.begin(), order.end(), 0u);
  ClumpParting(mesh, pieces).run(order);
  for (uint32_t& one : order) one = pieces[one];
  clumps_.reserve((order.size() + kPieces - 1) / kPieces);
  for (size_t first = 0; first < order.size(); first += kPieces)
    clumps_.push_back(make(&order[first],
                           static_cast<uint32_t>(std::min<size_t>(kPieces, order.size() - first))));
}

CurveClumps::Clump CurveClumps::make(const uint32_t* first, uint32_t n) const {
  Clump out{};
  std::array<ClumpPiece, kPieces> pieces;
  Bounds box;
  for (uint32_t k = 0; k < kPieces; ++k) {
    pieces[k] = piece_of(mesh_, first[std::min(k, n - 1)]);
    for (const Vec3<float>& p : pieces[k].p) box.add(p);
    out.segment[k] = k < n ? first[k] / kPieceNodes : kNone;
  }
  const Vec3<float> step = (box.hi - box.lo) * (1.f / kCells);
  out.low = {box.lo.x, box.lo.y, box.lo.z};
  out.step = {step.x, step.y, step.z};
  const float widest = std::max(step.x, std::max(step.y, step.z));
  for (uint32_t k = 0; k < kPieces; ++k) {
    for (uint32_t p = 0; p < 4; ++p) {
      const Vec3<float> at = pieces[k].p[p] - box.lo;
      const float offset[3] = {at.x, at.y, at.z};
      for (uint32_t axis = 0; axis < 3; ++axis) {
        const uint32_t i = 3 * p + axis;
        const float cell = out.step[axis] > 0 ? offset[axis] / out.step[axis] : 0.f;
        out.cells[i / 2][k] |= static_cast<uint32_t>(std::min(cell + 0.5f, kCells))
                               << (16 * (i % 2));
      }
    }
    // Rounding to cells moves a point by less than one.
    out.radius[k] = 1.0001f * pieces[k].radius + widest;
  }
  return out;
}

Bounds CurveClumps::bounds(uint32_t clump) const {
  const Clump& c = clumps_[clump];
  Bounds box;
  for (uint32_t k = 0; k < kPieces; ++k)
    for (uint32_t p = 0; p < 4; ++p) {
      float lo[3], hi[3];
      for (uint32_t axis = 0; axis < 3; ++axis) {
        const uint32_t i = 3 * p + axis;
        const float cell = static_cast<float>((c.cells[i / 2][k] >> (16 * (i % 2))) & 0xffffu);
        const float x = c.low[axis] + c.step[axis] * cell;
        const float reach = c.radius[k] + 1e-6f * std::abs(x);
        lo[axis] = x - reach;
        hi[axis] = x + reach;
      }
      box.add({lo[0], lo[1], lo[2]});
      box.add({hi[0], hi[1], hi[2]});
    }
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
