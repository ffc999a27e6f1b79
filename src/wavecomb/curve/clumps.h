// SPDX-License-Identifier: Apache-2.0
/// Pieces of curves in clumps of eight, and what a ray may meet of a clump.
///
/// Boxes of hair are a hundred times longer than a strand is wide: of the segments whose box a ray
/// meets, it passes by nearly all, and each of them costs memory from another place. So a hierarchy
/// is made over clumps of pieces that lie close together: segments, or parts of slender ones. A
/// clump has the lines that these lie about side by side, in 16 bits, and a ray is tested against
/// the eight at once. Pieces that may be met go to intersect_curve; a clump's own
/// test says nothing but "perhaps" or "certainly not", so that it changes no picture.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <vector>

#include "wavecomb/curve/intersect.h"

namespace wavecomb {

/// Of one mesh of curves that keeps its shape (see serve); the mesh must outlive it.
class CurveClumps {
 public:
  static constexpr uint32_t kPieces = 8;  ///< of a clump, at most

  /// Whether a mesh is one of those that clumps are for.
  static bool serve(const Mesh& mesh) { return mesh.is_strands() && !mesh.deforms(); }

  /// Does two things, one beside the other or one after the other.
  using Task = std::function<void()>;
  using Both = std::function<void(const Task&, const Task&)>;

  explicit CurveClumps(
      const Mesh& mesh, const Both& both = [](const Task& a, const Task& b) {
        a();
        b();
      });

  uint32_t count() const { return static_cast<uint32_t>(clumps_.size()); }
  size_t bytes() const { return clumps_.size() * sizeof(Clump); }

  /// A box around the pieces of a clump, a little larger than they are.
  Bounds bounds(uint32_t clump) const;

  /// A bit for each piece that a ray may meet with 0 < t <= tfar.
  uint32_t may_meet(uint32_t clump, const CurveRay& ray, float tfar) const;

  /// The piece of a bit k of may_meet.
  CurvePiece piece(uint32_t clump, uint32_t k) const {
    const uint32_t number = clumps_[clump].number[k];
    return {number / CurvePiece::kNodes, number % CurvePiece::kNodes};
  }

 private:
  static constexpr uint32_t kNone = 0xffffffffu;

  /// The ends of piece k along an axis are low[axis] + step * cell, with cells of 16 bits: those of
  /// the first are the lower halves of cells[axis][k], those of the second the upper ones. Its
  /// radius about the line between them is step * radius[k]. Its number is that of its segment
  /// times kNodes, and its node.
  struct alignas(32) Clump {
    std::array<std::array<uint32_t, kPieces>, 3> cells;
    std::array<uint32_t, kPieces> number;
    std::array<uint16_t, kPieces> radius;
    std::array<float, 3> low;
    float step;
  };
  static_assert(sizeof(Clump) == 160);

  Clump make(const uint32_t* first, uint32_t n) const;

  const Mesh& mesh_;
  std::vector<Clump> clumps_;
};

}  // namespace wavecomb
