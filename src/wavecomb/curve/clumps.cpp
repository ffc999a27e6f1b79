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
constexpr float kSlender = 32.f;  ///< length over radius above which segments are halved
constexpr size_t kManySegments = size_t{1} << 20;
constexpr float kClumpRounding = 4e-6f;  ///< of sums of products in float, over their terms

/// A part of a segment as a line from a to b with a radius, in which all of the part lies.
struct ClumpPiece {
  Vec3<float> a, b;
  float radius = 0;
};

/// Pieces are numbered segment by segment as nodes of a tree: 1 is all of a segment, 2 n and 2 n +
/// 1 are the halves of n.
constexpr uint32_t kPieceNodes = 8;

/// De Casteljau's first or second half.
template <typename T>
void keep_half(std::array<T, 4>& p, bool second) {
  const T a = (p[0] + p[1]) * 0.5f, m = (p[1] + p[2]) * 0.5f, b = (p[2] + p[3]) * 0.5f;
  const T am = (a + m) * 0.5f, mb = (m + b) * 0.5f, middle = (am + mb) * 0.5f;
  if (second)
    p = {middle, mb, b, p[3]};
  else
    p = {p[0], a, am, middle};
}

float distance_to_line(const Vec3<float>& p, const Vec3<float>& a, const Vec3<float>& b) {
  const Vec3<float> c = b - a, v = p - a;
  const float c2 = dot(c, c), at = c2 > 0 ? std::clamp(dot(v, c) / c2, 0.f, 1.f) : 0.f;
  return length(Vec3<float>(v - c * at));
}

/// Control points are no farther from the line than all between them: distance to it is convex.
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
    keep_half(p, (node & bit) != 0);
    keep_half(r, (node & bit) != 0);
  }
  const float bend =
      std::max(distance_to_line(p[1], p[0], p[3]), distance_to_line(p[2], p[0], p[3]));
  return {p[0], p[3], *std::max_element(r.begin(), r.end()) + bend};
}

/// How often a segment is halved. A clump's box is as large as the pieces in it are long, and a
/// bent piece is thicker than the curve; but each piece takes memory.
uint32_t halvings(const Mesh& mesh, uint32_t segment) {
  const ClumpPiece whole = piece_of(mesh, kPieceNodes * segment + 1);
  if (!(length(Vec3<float>(whole.b - whole.a)) > kSlender * whole.radius)) {
    const float r = mesh.radii[mesh.indices[segment] & kCurveFirstPoint];
    if (whole.radius <= 2 * r) return 0;
  }
  return mesh.indices.size() <= kManySegments ? 2 : 1;
}

/// A piece's number, and the middle of its line, twice.
struct ClumpEntry {
  std::array<float, 3> middle;
  uint32_t piece;
};

/// Calls work(i) for each i below the end, parts of them side by side.
template <typename Work>
void over_all(size_t first, size_t end, const CurveClumps::Both& both, const Work& work) {
  constexpr size_t kMost = 1u << 14;
  if (end - first > kMost) {
    const size_t middle = first + (end - first) / 2;
    return both([&] { over_all(first, middle, both, work); },
                [&] { over_all(middle, end, both, work); });
  }
  for (size_t i = first; i < end; ++i) work(i);
}

std::vector<ClumpEntry> pieces_of(const Mesh& mesh, const CurveClumps::Both& both) {
  const size_t segments = mesh.indices.size();
  std::vector<uint32_t> end(segments);
  over_all(0, segments, both,
           [&](size_t s) { end[s] = 1u << halvings(mesh, static_cast<uint32_t>(s)); });
  std::partial_sum(end.begin(), end.end(), end.begin());
  std::vector<ClumpEntry> out(segments > 0 ? end.back() : 0);
  over_all(0, segments, both, [&](size_t s) {
    const uint32_t first = s > 0 ? end[s - 1] : 0, n = end[s] - first;
    for (uint32_t i = 0; i < n; ++i) {
      const uint32_t number = kPieceNodes * static_cast<uint32_t>(s) + n + i;
      const ClumpPiece piece = piece_of(mesh, number);
      const Vec3<float> m = piece.a + piece.b;
      out[first + i] = {{m.x, m.y, m.z}, number};
    }
  });
  return out;
}

/// Parts pieces by their middles until each part fills one clump; all but the last are full.
void part_pieces(std::span<ClumpEntry> pieces, const CurveClumps::Both& both) {
  constexpr size_t kFull = CurveClumps::kPieces, kMany = 1u << 15;
  if (pieces.size() <= kFull) return;
  std::array<float, 3> lo = pieces[0].middle, hi = lo;
  for (const ClumpEntry& one : pieces)
    for (size_t k = 0; k < 3; ++k) {
      lo[k] = std::min(lo[k], one.middle[k]);
      hi[k] = std::max(hi[k], one.middle[k]);
    }
  size_t axis = 0;
  for (size_t k = 1; k < 3; ++k)
    if (hi[k] - lo[k] > hi[axis] - lo[axis]) axis = k;
  const size_t half = ((pieces.size() + kFull - 1) / kFull + 1) / 2 * kFull;
  const auto before = [axis](const ClumpEntry& a, const ClumpEntry& b) {
    const float x = a.middle[axis], y = b.middle[axis];
    return x != y ? x < y : a.piece < b.piece;
  };
  std::nth_element(pieces.begin(), pieces.begin() + static_cast<ptrdiff_t>(half), pieces.end(),
                   before);
  const auto first = [&] { part_pieces(pieces.first(half), both); };
  const auto second = [&] { part_pieces(pieces.subspan(half), both); };
  if (pieces.size() > kMany) return both(first, second);
  first();
  second();
}

float clump_size(const float* v) {
  return std::abs(v[0]) + std::abs(v[1]) + std::abs(v[2]);
}

}  // namespace

CurveClumps::CurveClumps(const Mesh& mesh, const Both& both) : mesh_(mesh) {
  std::vector<ClumpEntry> pieces = pieces_of(mesh, both);
  part_pieces(pieces, both);
  clumps_.resize((pieces.size() + kPieces - 1) / kPieces);
  over_all(0, clumps_.size(), both, [&](size_t c) {
    std::array<uint32_t, kPieces> numbers;
    const size_t n = std::min<size_t>(kPieces, pieces.size() - c * kPieces);
    for (size_t k = 0; k < n; ++k) numbers[k] = pieces[c * kPieces + k].piece;
    clumps_[c] = make(numbers.data(), static_cast<uint32_t>(n));
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
    out.segment[k] = k < n ? first[k] / kPieceNodes : kNone;
  }
  const Vec3<float> step = (box.hi - box.lo) * (1.f / kCells);
  out.low = {box.lo.x, box.lo.y, box.lo.z};
  out.step = {step.x, step.y, step.z};
  const auto cell = [&](float x, uint32_t axis) {
    const float at = out.step[axis] > 0 ? (x - out.low[axis]) / out.step[axis] : 0.f;
    return static_cast<uint32_t>(std::min(at + 0.5f, kCells));
  };
  for (uint32_t k = 0; k < kPieces; ++k) {
    const ClumpPiece& piece = pieces[k];
    const float a[3] = {piece.a.x, piece.a.y, piece.a.z};
    const float b[3] = {piece.b.x, piece.b.y, piece.b.z};
    for (uint32_t axis = 0; axis < 3; ++axis)
      out.cells[axis][k] = cell(a[axis], axis) | cell(b[axis], axis) << 16;
    // Rounding to cells moves a point by less than one.
    out.radius[k] = 1.0001f * piece.radius + std::max(step.x, std::max(step.y, step.z));
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
  Vec3<F> cell_a, cell_b;
  const auto decode = [&](uint32_t axis, F& a, F& b) {
    const UInt<F> cells = load<UInt<F>>(c.cells[axis].data());
    a = F(Int<F>(cells & 0xffffu));
    b = F(Int<F>(cells >> 16u));
  };
  decode(0, cell_a.x, cell_b.x);
  decode(1, cell_a.y, cell_b.y);
  decode(2, cell_a.z, cell_b.z);
  // The ends as the ray sees them, which is the z axis here.
  const auto seen = [&](uint32_t n, const Vec3<F>& cell) {
    const auto& e = ray.axis[n];
    const F start(e[0] * from[0] + e[1] * from[1] + e[2] * from[2]);
    return fma(cell.x, F(e[0] * c.step[0]),
               fma(cell.y, F(e[1] * c.step[1]), fma(cell.z, F(e[2] * c.step[2]), start)));
  };
  const F ax = seen(0, cell_a), ay = seen(1, cell_a), az = seen(2, cell_a);
  const F bx = seen(0, cell_b), by = seen(1, cell_b), bz = seen(2, cell_b);
  // Whether both ends lie farther than the radius on one side of a line through the ray, along the
  // piece or square to it.
  const F cx = bx - ax, cy = by - ay, length = sqrt(fma(cx, cx, F(cy * cy)));
  // The piece's direction is rounded as its ends are; where one of these is within the radius, the
  // other is no farther than the piece is long beyond that.
  const F reach = fma(radius, length, F(rounding * (length + radius)));
  const F beside = abs(fma(cx, ay, F(-(cy * ax))));
  const F along_a = fma(cx, ax, F(cy * ay)), along_b = fma(cx, bx, F(cy * by));
  const F deep = radius + rounding;
  const Mask<F> passed = (beside > reach) | (along_a > reach) | (along_b < -reach) |
                         (max(az, bz) < -deep) |
                         (min(az, bz) - deep > F(tfar * ray.length * 1.00001f)) |
                         Mask<F>(load<UInt<F>>(c.segment.data()) == UInt<F>(kNone));
  return lane_bits<F>(not_(passed));
}

}  // namespace wavecomb
