// SPDX-License-Identifier: Apache-2.0
/// Which kinds of rays see what: by the paths of prims, as they are seen through their instances.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace wavecomb {

class ObjectNames;
class Scene;

/// Kinds of rays, and what else a camera ray does.
enum RayVisibility : uint32_t {
  kSeenByCamera = 1,
  kSeenByShadowRays = 2,
  kSeenByBounces = 4,
  kSeenByAll = kSeenByCamera | kSeenByShadowRays | kSeenByBounces,
  /// A camera ray ends here and brings nothing: black, and alpha 0.
  kHeldOut = 8,
};

/// What is said of a prim and of all below it that says nothing else. What is inside of a group is
/// named as the group's first placement has it, and is so in all of them.
struct VisibilityRule {
  std::string path;
  uint32_t said = 0;  ///< the bits of RayVisibility that it says anything of
  uint32_t bits = 0;  ///< and what
};

/// RayVisibility of all objects, meshes of instances one after the other as in
/// InstanceRecord::emissive; empty where all rays see everything.
std::vector<uint32_t> object_visibility(const Scene& scene, const ObjectNames& names);

/// The kind of a path's ray after `depth` vertices, or of its shadow ray there.
constexpr uint32_t ray_kind(uint32_t depth, bool shadow) {
  if (shadow) return kSeenByShadowRays;
  return depth == 0 ? kSeenByCamera : kSeenByBounces;
}

}  // namespace wavecomb
