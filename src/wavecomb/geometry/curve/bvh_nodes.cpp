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

using ClumpLanes = FloatP<CurveClumps::kPieces>;

constexpr float kCells = 65535.f;
constexpr float kLargestCell = 65000.f;  ///< leaves room below kCells for rounding
constexpr float kSlender = 32.f;         ///< segments with a larger length / radius are split
constexpr size_t kManySegments = size_t{1} << 20;
constexpr float kClumpRounding = 4e-6f;  ///< relative error of float dot products

/// Capsule that contains a sub-segment: a line from a to b with a radius.
struct ClumpPiece {
  Vec3<float> a, b;
  float radius = 0;
};

/// Number of nodes per segment; a sub-segment's number is kPieceNodes * segment + node.
constexpr uint32_t kPieceNodes = CurvePiece::kNodes;

/// Returns the distance of a point from the line segment ab.
float distance_to_line(const Vec3<float>& p, const Vec3<float>& a, const Vec3<float>& b) {
  const Vec3<float> c = b - a, v = p - a;
  const float c2 = dot(c, c), at = c2 > 0 ? std::clamp(dot(v, c) / c2, 0.f, 1.f) : 0.f;
  return length(Vec3<float>(v - c * at));
}

/// Returns the capsule of a sub-segment. Distance to a line is convex, so the distances of the
/// control points bound the curve.
ClumpPiece piece_of(const Mesh& mesh, uint32_t number) {
  std::array<Vec3<float>, 4> p;
  std::array<float, 4> r;
  const auto points = static_cast<uint32_t>(mesh.segment_points());
  const size_t first = mesh.indices[number / kPieceNodes] & kCurveFirstPoint;
  for (uint32_t k = 0; k < points; ++k) {
    const float* at = &mesh.positions[3 * (first + k)];
    p[k] = {at[0], at[1], at[2]};
    r[k] = mesh.radii[first + k];
  }
  if (points == 2) {
    p = {p[0], p[0] + (p[1] - p[0]) * (1.f / 3), p[0] + (p[1] - p[0]) * (2.f / 3), p[1]};
    r = {r[0], r[0] + (r[1] - r[0]) * (1.f / 3), r[0] + (r[1] - r[0]) * (2.f / 3), r[1]};
  }
  const uint32_t node = number % kPieceNodes;
  for (uint32_t bit = std::bit_floor(node) / 2; bit > 0; bit /= 2) {
    curve_math::Bezier::keep_half(p.data(), (node & bit) != 0, 0.5f);
    curve_math::Bezier::keep_half(r.data(), (node & bit) != 0, 0.5f);
  }
  const float bend =
      std::max(distance_to_line(p[1], p[0], p[3]), distance_to_line(p[2], p[0], p[3]));
  return {p[0], p[3], *std::max_element(r.begin(), r.end()) + bend};
}

/// Returns how often to halve a segment. Shorter sub-segments give smaller node bounds and, if
/// curved, thinner capsules, but each takes memory.
uint32_t halvings(const Mesh& mesh, uint32_t segment, const ClumpPiece& whole) {
  if (!(length(Vec3<float>(whole.b - whole.a)) > kSlender * whole.radius)) {
    const float r = mesh.radii[mesh.indices[segment] & kCurveFirstPoint];
    if (whole.radius <= 2 * r) return 0;
  }
  return mesh.indices.size() <= kManySegments ? 2 : 1;
}

/// A sub-segment, or the first one of a segment: twice the midpoint of its axis, and its number.
struct ClumpEntry {
  std::array<float, 3> middle;
  uint32_t number;
};

ClumpEntry entry_of(const ClumpPiece& line, uint32_t number) {
  const Vec3<float> m = line.a + line.b;
  return {{m.x, m.y, m.z}, number};
}

/// Calls work(i) for first <= i < end, in parallel tasks of at most `grain` calls.
template <typename Work>
void over_all(size_t first, size_t end, size_t grain, const CurveClumps::Both& both,
              const Work& work) {
  if (end - first > grain) {
    const size_t middle = first + (end - first) / 2;
    return both([&] { over_all(first, middle, grain, both, work); },
                [&] { over_all(middle, end, grain, both, work); });
  }
  for (size_t i = first; i < end; ++i) work(i);
}

/// Partitions entries by their midpoints along the longest axis until each part has at most `full`
/// entries; all parts but the last have exactly `full`.
void part_entries(std::span<ClumpEntry> entries, size_t full, const CurveClumps::Both& both) {
  constexpr size_t kMany = 1u << 15;
  if (entries.size() <= full) return;
  std::array<float, 3> lo = entries[0].middle, hi = lo;
  for (const ClumpEntry& one : entries)
    for (size_t k = 0; k < 3; ++k) {
      lo[k] = std::min(lo[k], one.middle[k]);
      hi[k] = std::max(hi[k], one.middle[k]);
    }
  size_t axis = 0;
  for (size_t k = 1; k < 3; ++k)
    if (hi[k] - lo[k] > hi[axis] - lo[axis]) axis = k;
  const size_t half = ((entries.size() + full - 1) / full + 1) / 2 * full;
  const auto before = [axis](const ClumpEntry& a, const ClumpEntry& b) {
    const float x = a.middle[axis], y = b.middle[axis];
    return x != y ? x < y : a.number < b.number;
  };
  std::nth_element(entries.begin(), entries.begin() + static_cast<ptrdiff_t>(half), entries.end(),
                   before);
  const auto first = [&] { part_entries(entries.first(half), full, both); };
  const auto second = [&] { part_entries(entries.subspan(half), full, both); };
  if (entries.size() > kMany) return both(first, second);
  first();
  second();
}

/// Returns the number of sub-segments of a segment, which equals the node index of its first one.
uint32_t pieces_of(const ClumpEntry& segment) {
  return segment.number % kPieceNodes;
}

/// Returns all segments, ordered so that groups of `group` segments are compact in space.
std::vector<ClumpEntry> segments_of(const Mesh& mesh, size_t group, const CurveClumps::Both& both) {
  std::vector<ClumpEntry> out(mesh.indices.size());
  over_all(0, out.size(), 1u << 14, both, [&](size_t s) {
    const auto segment = static_cast<uint32_t>(s);
    const ClumpPiece whole = piece_of(mesh, kPieceNodes * segment + 1);
    out[s] = entry_of(whole, kPieceNodes * segment + (1u << halvings(mesh, segment, whole)));
  });
  part_entries(out, group, both);
  return out;
}

/// Returns the L1 norm of a vector.
float clump_size(const float* v) {
  return std::abs(v[0]) + std::abs(v[1]) + std::abs(v[2]);
}

}  // namespace

CurveClumps::CurveClumps(const Mesh& mesh, const Both& both) : mesh_(mesh) {
  // Sub-segments are created group by group to limit memory.
  constexpr size_t kGroup = 1u << 16;
  const std::vector<ClumpEntry> segments = segments_of(mesh, kGroup, both);
  const size_t groups = (segments.size() + kGroup - 1) / kGroup;
  const auto group = [&](size_t g) {
    return std::span(segments).subspan(g * kGroup, std::min(kGroup, segments.size() - g * kGroup));
  };
  std::vector<size_t> first(groups + 1, 0);
  over_all(0, groups, 1, both, [&](size_t g) {
    size_t pieces = 0;
    for (const ClumpEntry& s : group(g)) pieces += pieces_of(s);
    first[g + 1] = (pieces + kPieces - 1) / kPieces;
  });
  std::partial_sum(first.begin(), first.end(), first.begin());
  clumps_.resize(first.back());
  over_all(0, groups, 1, both, [&](size_t g) {
    std::vector<ClumpEntry> pieces;
    for (const ClumpEntry& s : group(g))
      for (uint32_t number = s.number; number < s.number + pieces_of(s); ++number)
        pieces.push_back(entry_of(piece_of(mesh, number), number));
    part_entries(pieces, kPieces, both);
    for (size_t at = 0, c = first[g]; at < pieces.size(); at += kPieces, ++c) {
      std::array<uint32_t, kPieces> numbers;
      const size_t n = std::min<size_t>(kPieces, pieces.size() - at);
      for (size_t k = 0; k < n; ++k) numbers[k] = pieces[at + k].number;
      clumps_[c] = make(numbers.data(), static_cast<uint32_t>(n));
    }
  });
}

CurveClumps::Clump CurveClumps::make(const uint32_t* first, uint32_t n) const {
  Clump out{};
  std::array<ClumpPiece, kPieces> pieces;
  Bounds box;
  for (uint32_t k = 0; k < kPieces; ++k) {
    pieces[k] = piece_of(mesh_, first[std::min(k, n - 1)]);
    box.add(pieces[k].a);
    box.add(pieces[k].b);
    out.number[k] = k < n ? first[k] : kNone;
  }
  float size = max_component(Vec3<float>(box.hi - box.lo));
  for (const ClumpPiece& piece : pieces) size = std::max(size, 1.001f * piece.radius);
  out.low = {box.lo.x, box.lo.y, box.lo.z};
  out.step = size * (1.f / kLargestCell);
  const auto cells = [&](float x) { return out.step > 0 ? std::min(x / out.step, kCells) : 0.f; };
  const auto cell = [&](float x, uint32_t axis) {
    return static_cast<uint32_t>(cells(x - out.low[axis]) + 0.5f);
  };
  for (uint32_t k = 0; k < kPieces; ++k) {
    const ClumpPiece& piece = pieces[k];
    const float a[3] = {piece.a.x, piece.a.y, piece.a.z};
    const float b[3] = {piece.b.x, piece.b.y, piece.b.z};
    for (uint32_t axis = 0; axis < 3; ++axis)
      out.cells[axis][k] = cell(a[axis], axis) | cell(b[axis], axis) << 16;
    // Covers the rounding of positions to cells, which moves a point by less than one cell.
    out.radius[k] = static_cast<uint16_t>(std::ceil(cells(1.0001f * piece.radius)) + 1.f);
  }
  return out;
}

Bounds CurveClumps::bounds(uint32_t clump) const {
  const Clump& c = clumps_[clump];
  Bounds box;
  for (uint32_t k = 0; k < kPieces; ++k)
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

uint32_t CurveClumps::may_meet(uint32_t clump, const CurveRay& ray, float tfar) const {
  using F = ClumpLanes;
  const Clump& c = clumps_[clump];
  const float from[3] = {c.low[0] - ray.origin[0], c.low[1] - ray.origin[1],
                         c.low[2] - ray.origin[2]};
  alignas(32) float radii[kPieces];
  for (uint32_t k = 0; k < kPieces; ++k) radii[k] = static_cast<float>(c.radius[k]);
  const F radius = load<F>(radii) * c.step;
  const F rounding =
      (radius + (clump_size(c.low.data()) + clump_size(ray.origin) + 3 * kCells * c.step)) *
      kClumpRounding;
  Vec3<F> cell_a, cell_b;
  const auto decode = [&](uint32_t axis, F& a, F& b) {
    const UInt<F> cells = load<UInt<F>>(c.cells[axis].data());
    a = F(Int<F>(cells & 0xffffu));
    b = F(Int<F>(cells >> 16u));
  };
  decode(0, cell_a.x, cell_b.x);
  decode(1, cell_a.y, cell_b.y);
  decode(2, cell_a.z, cell_b.z);
  // Transforms the ends to ray space, where the ray is the z axis.
  const auto seen = [&](uint32_t n, const Vec3<F>& cell) {
    const auto& e = ray.axis[n];
    const F start(e[0] * from[0] + e[1] * from[1] + e[2] * from[2]);
    return fma(cell.x, F(e[0] * c.step),
               fma(cell.y, F(e[1] * c.step), fma(cell.z, F(e[2] * c.step), start)));
  };
  const Vec3<F> a(seen(0, cell_a), seen(1, cell_a), seen(2, cell_a));
  const Vec3<F> b(seen(0, cell_b), seen(1, cell_b), seen(2, cell_b));
  const F z_far = F(tfar * ray.length * 1.00001f) + rounding;
  const Mask<F> passed = passes_capsules<F>(a, b, radius, rounding, F(-rounding), z_far) |
                         Mask<F>(load<UInt<F>>(c.number.data()) == UInt<F>(kNone));
  return lane_bits<F>(not_(passed));
}

}  // namespace wavecomb
