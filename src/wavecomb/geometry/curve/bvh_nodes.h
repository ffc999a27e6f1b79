// SPDX-License-Identifier: Apache-2.0
/// BVH nodes of up to eight curve sub-segments.
///
/// The bounding boxes of hair segments are a hundred times longer than a strand is wide, so a ray
/// that hits boxes of segments misses nearly all of these segments, and each test of a segment
/// causes a cache miss. Embree therefore builds its BVH over nodes of nearby sub-segments: whole
/// segments, or parts of slender segments. A node stores the capsules of its sub-segments,
/// quantised to 16 bits, and tests a ray against all capsules at once with SIMD instructions. The
/// function `intersect_curve` then tests the sub-segments that the ray may hit. The test of the
/// capsules is conservative, so that it never misses a hit.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <vector>

#include "wavecomb/geometry/curve/intersect.h"

namespace wavecomb {

/// BVH nodes of a mesh of curves. The mesh must not deform (see supports()) and must exist as long
/// as the nodes.
class CurveBvhNodes {
 public:
  static constexpr uint32_t kMaxSubSegments = 8;  ///< maximum number of sub-segments per node

  /// Returns whether curve BVH nodes can be built for a mesh.
  static bool supports(const Mesh& mesh) { return mesh.is_strands() && !mesh.deforms(); }

  /// Type of function that runs two given tasks, possibly in parallel.
  using Task = std::function<void()>;
  using RunBoth = std::function<void(const Task&, const Task&)>;

  /// Builds the nodes. `run_both` runs two tasks, possibly in parallel. By default, the tasks run
  /// one after another.
  explicit CurveBvhNodes(
      const Mesh& mesh, const RunBoth& run_both = [](const Task& a, const Task& b) {
        a();
        b();
      });

  uint32_t count() const { return static_cast<uint32_t>(nodes_.size()); }
  size_t bytes() const { return nodes_.size() * sizeof(Node); }

  /// Returns a bounding box that contains all sub-segments of a node.
  Bounds bounds(uint32_t node) const;

  /// Returns a bit mask of the sub-segments of a node that a ray may hit at a distance t with 0 < t
  /// <= tfar.
  uint32_t may_hit(uint32_t node, const CurveRay& ray, float tfar) const;

  /// Returns the sub-segment that bit `k` of the result of may_hit() represents.
  SubSegment sub_segment(uint32_t node, uint32_t k) const {
    const uint32_t number = nodes_[node].number[k];
    return {number / SubSegment::kNodes, number % SubSegment::kNodes};
  }

 private:
  static constexpr uint32_t kNone = 0xffffffffu;

  /// Node with quantised capsules. The ends of sub-segment k have the coordinates low[axis] + step
  /// * cell. The lower 16 bits of `cells[axis][k]` are the cell of the first end, and the upper 16
  /// bits the cell of the second end. The radius of the capsule is `step * radius[k]`. `number[k]`
  /// is segment * SubSegment::kNodes + node, or `kNone` if the node has no sub-segment k.
  struct alignas(32) Node {
    std::array<std::array<uint32_t, kMaxSubSegments>, 3> cells;
    std::array<uint32_t, kMaxSubSegments> number;
    std::array<uint16_t, kMaxSubSegments> radius;
    std::array<float, 3> low;
    float step;
  };
  static_assert(sizeof(Node) == 160);

  Node make(const uint32_t* first, uint32_t n) const;

  const Mesh& mesh_;
  std::vector<Node> nodes_;
};

}  // namespace wavecomb
