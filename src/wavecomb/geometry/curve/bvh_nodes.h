// SPDX-License-Identifier: Apache-2.0
/// BVH nodes of up to eight curve sub-segments.
///
/// Bounding boxes of hair segments are a hundred times longer than a strand is wide, so a ray
/// misses nearly all segments whose boxes it hits, and each of these tests costs a cache miss.
/// Embree therefore builds its BVH over nodes of nearby sub-segments: whole segments, or parts of
/// slender ones. A node stores their capsules side by side, quantised to 16 bits, and tests a ray
/// against all eight at once. intersect_curve() then tests those that may be hit. The node test is
/// conservative, so it never changes the image.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <vector>

#include "wavecomb/geometry/curve/intersect.h"

namespace wavecomb {

/// Nodes of a mesh of curves that does not deform (see serve()); the mesh must outlive them.
class CurveClumps {
 public:
  static constexpr uint32_t kPieces = 8;  ///< maximum number of sub-segments per node

  /// Returns whether nodes can be built for a mesh.
  static bool serve(const Mesh& mesh) { return mesh.is_strands() && !mesh.deforms(); }

  /// Function that runs two tasks, possibly in parallel.
  using Task = std::function<void()>;
  using Both = std::function<void(const Task&, const Task&)>;

  /// Builds the nodes. `both`: runs parallel tasks; the default runs them one after another.
  explicit CurveClumps(
      const Mesh& mesh, const Both& both = [](const Task& a, const Task& b) {
        a();
        b();
      });

  uint32_t count() const { return static_cast<uint32_t>(clumps_.size()); }
  size_t bytes() const { return clumps_.size() * sizeof(Clump); }

  /// Returns conservative bounds of a node.
  Bounds bounds(uint32_t clump) const;

  /// Returns a bit mask of the sub-segments of a node that a ray may hit with 0 < t <= tfar.
  uint32_t may_meet(uint32_t clump, const CurveRay& ray, float tfar) const;

  /// Returns the sub-segment of bit k of may_meet().
  CurvePiece piece(uint32_t clump, uint32_t k) const {
    const uint32_t number = clumps_[clump].number[k];
    return {number / CurvePiece::kNodes, number % CurvePiece::kNodes};
  }

 private:
  static constexpr uint32_t kNone = 0xffffffffu;

  /// Node with quantised capsules. The ends of sub-segment k are at low[axis] + step * cell. The
  /// lower 16 bits of cells[axis][k] are the cell of the first end, the upper 16 bits that of the
  /// second. The radius is step * radius[k]. number[k] is segment * CurvePiece::kNodes + node, or
  /// kNone.
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
