// SPDX-License-Identifier: Apache-2.0
/// Visibility of objects for kinds of rays. Visibility is set for prim paths as seen through
/// instances.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace wavecomb {

class ObjectNames;
class Scene;

/// Bits for the kinds of rays, and the holdout flag.
enum RayVisibility : uint32_t {
  kVisibleToCamera = 1,
  kVisibleToShadowRays = 2,
  kVisibleToBounces = 4,
  kVisibleToAll = kVisibleToCamera | kVisibleToShadowRays | kVisibleToBounces,
  /// Holdout: camera rays stop at the object, with black radiance and alpha 0.
  kHoldout = 8,
};

/// Visibility rule for a prim, and for all descendants that do not have another rule. For prims
/// inside a group, the path is as seen through the group's first placement, and the rule applies to
/// all placements.
struct VisibilityRule {
  std::string path;
  uint32_t specified = 0;  ///< mask of the RayVisibility bits that the rule sets
  uint32_t bits = 0;       ///< values of the bits in the mask
};

/// Returns the RayVisibility bits of all mesh instances, indexed like SceneView::emissive_lights.
/// The result is empty if every object is visible to all rays.
std::vector<uint32_t> object_visibility(const Scene& scene, const ObjectNames& names);

/// Returns the RayVisibility bit of the ray that a path traces after `depth` vertices. With
/// `shadow`, returns the bit of shadow rays.
constexpr uint32_t ray_kind(uint32_t depth, bool shadow) {
  if (shadow) return kVisibleToShadowRays;
  return depth == 0 ? kVisibleToCamera : kVisibleToBounces;
}

}  // namespace wavecomb
