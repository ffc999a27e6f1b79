// SPDX-License-Identifier: Apache-2.0
/// Ray traversal with Embree. Only .cpp files and embree_*.h of this folder include Embree.
#pragma once

#include <cstdint>
#include <memory>

#include "wavecomb/scene/scene.h"

struct RTCSceneTy;  // Embree's scene type

namespace wavecomb {

/// Rays to trace, in SoA layout. Directions are unit vectors; tnear is 0.
struct RaySpan {
  const float *ox, *oy, *oz, *dx, *dy, *dz;
  const float* tfar;     ///< maximum distance of each ray; null means no limit
  const uint32_t* slot;  ///< path slots for PresenceKeys; null means that the ray index is the slot
  size_t size;
  const float* time = nullptr;  ///< shutter time of each ray in [0, 1]; null means 0
};

/// Output columns for hits. The barycentrics u and v are defined as in HitBuffer. `inst` is an
/// index into SceneView::instances and `geom` a geometry within its group; or `inst` is kLightShape
/// and `geom` the index of the light record, or `inst` is kNoHit.
struct HitSpan {
  float *t, *u, *v;
  uint32_t *prim, *geom, *inst;
};
inline constexpr uint32_t kNoHit = 0xffffffffu;
inline constexpr uint32_t kLightShape = 0xfffffffeu;

/// Returns a hash of an instanced mesh for PresenceKeys::object. Two objects of a scene collide
/// with probability 2^-32, which matters from some ten thousand instances on.
template <typename U>
inline U object_of(const U& inst, const U& mesh) {
  return U(inst * 0x9e3779b1u) + mesh;
}

/// Per-path data that decides whether a surface with partial presence stops a ray. The random
/// numbers are keyed by the path, so that traversal order has no effect. The arrays are indexed by
/// path slot.
struct PresenceKeys {
  const uint32_t* pixel_hash = nullptr;
  const uint32_t* sample = nullptr;
  uint32_t stride = 1;  ///< distance between the values of consecutive slots, in 32-bit words
  /// Differs for each depth and for shadow rays, so that crossings are independent.
  uint32_t salt = 0;
  /// For shadow rays with light linking: 1 + index of the set of geometry that casts shadows, or 0
  /// for all geometry. The pointer is null without light linking.
  const uint32_t* shadow_set = nullptr;
  uint32_t shadow_stride = 0;
  uint32_t ray_kind = kVisibleToCamera;  ///< a RayVisibility flag
  /// The only object that each ray can hit, as a value of object_of(), with the same stride as
  /// pixel_hash. Rays that are restricted to one object hit no lights. A null pointer means that
  /// rays hit all objects.
  const uint32_t* object = nullptr;
};

/// Rule by which traversal chooses among hits at the same distance.
enum class HitRule : uint8_t {
  kCanonical,  ///< the same hit for all packets and orders (docs/decisions/canonical-hits.md)
  kList,       ///< like kCanonical, but small static scenes use triangle_list.h; the default
  kEmbree,     ///< the hit that Embree keeps without filters; for BareTraversal only
};

/// Two-level bounding volume hierarchy. Each group of meshes is built once and instanced any number
/// of times; the meshes of the world group are in the top level.
///
/// Contract: reads the Scene's arrays without copies and shares its ownership; tracing is
/// thread-safe.
class EmbreeAccelerator {
 public:
  /// Builds the acceleration structure with up to `threads` threads; 0 means all threads. Throws
  /// Error if Embree fails, for example if out of memory.
  EmbreeAccelerator(std::shared_ptr<const Scene> scene, uint32_t threads,
                    HitRule rule = HitRule::kList);
  /// Creates an accelerator for an edited version of the scene of `origin`. Shares the BVH with
  /// `origin`, or the groups whose meshes are unchanged. Groups are rebuilt if the presence
  /// filtering or hair status of a mesh changes; then, or if an object moves or the shape or
  /// position of a light changes, the top level is rebuilt.
  EmbreeAccelerator(std::shared_ptr<const Scene> edited, const EmbreeAccelerator& origin,
                    uint32_t threads);
  ~EmbreeAccelerator();

  /// Finds closest hits. `width`: rays per packet, 1, 4, 8 or 16, limited to the native width.
  /// `coherent`: the rays of a packet have similar directions and are traversed together. Hits do
  /// not depend on width or order, nor on `coherent` if the rays share an origin; otherwise hits at
  /// edges may differ (docs/decisions/canonical-hits.md). Scenes with motion ignore `coherent`;
  /// scenes with moving instances trace single rays (docs/decisions/motion.md).
  void intersect(const RaySpan& rays, const HitSpan& hits, uint32_t width, bool coherent,
                 const PresenceKeys& keys) const;
  /// Writes occluded[i] = 1 if ray i hits something before tfar, else 0.
  void occluded(const RaySpan& rays, uint32_t* occluded, uint32_t width, bool coherent,
                const PresenceKeys& keys) const;

  /// Returns whether a triangle list replaces the BVH.
  bool has_list() const;
  /// Returns the memory of the BVH in bytes.
  size_t bytes() const;
  /// Returns the width of the widest packet that Embree traces natively on this CPU.
  uint32_t native_width() const;
  /// Top-level RTCScene. Accelerators that share the BVH return the same RTCScene.
  RTCSceneTy* embree_scene() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace wavecomb
