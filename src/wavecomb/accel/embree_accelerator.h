// SPDX-License-Identifier: Apache-2.0
/// Ray traversal with Embree. Only .cpp files and embree_*.h of this folder include Embree.
#pragma once

#include <cstdint>
#include <memory>

#include "wavecomb/core/math.h"
#include "wavecomb/scene/scene_view.h"

struct RTCSceneTy;  // Embree's scene type

namespace wavecomb {

class Scene;

/// Rays to trace, as one array per component. Directions are unit vectors, and rays start at
/// distance 0.
struct RaySpan {
  const float *ox, *oy, *oz, *dx, *dy, *dz;
  const float* tfar;     ///< maximum distance of each ray; null means no limit
  const uint32_t* slot;  ///< slot of each ray's path, an index into the arrays of `PresenceKeys`;
                         ///< null means that ray i belongs to slot i
  size_t size;
  const float* time = nullptr;  ///< shutter time of each ray in [0, 1]; null means 0
};

/// Arrays to which hits are written. The barycentric coordinates `u` and `v` are defined as in
/// `HitBuffer`. If a ray hits a mesh, `inst` is an index into `SceneView::instances` and `geom` the
/// index of a geometry in the instance's group. If a ray hits a light, `inst` is `kLightShape` and
/// `geom` the index of the light record. If a ray hits nothing, `inst` is `kNoHit`.
struct HitSpan {
  float *t, *u, *v;
  uint32_t *prim, *geom, *inst;
};
inline constexpr uint32_t kNoHit = 0xffffffffu;
inline constexpr uint32_t kLightShape = 0xfffffffeu;

/// Returns a hash that identifies an instanced mesh in `PresenceKeys::object`. Two objects of a
/// scene have the same hash with probability 2^-32, so collisions are likely only with tens of
/// thousands of instances.
template <typename U>
inline U object_of(const U& inst, const U& mesh) {
  return U(inst * 0x9e3779b1u) + mesh;
}

/// Data of each path for the decision whether a partly transparent surface stops a ray. The random
/// number depends on the path's sample and the primitive, so that it does not depend on the order
/// of traversal. The arrays are indexed by path slot.
struct PresenceKeys {
  const uint32_t* pixel_hash = nullptr;
  const uint32_t* sample = nullptr;
  uint32_t stride = 1;  ///< distance between the values of consecutive slots in `pixel_hash` and
                        ///< `sample`, in 32-bit words
  /// Further input of the hash. Each path depth has a different value, and shadow rays have other
  /// values than bounce rays, so that decisions along a path are independent.
  uint32_t salt = 0;
  /// For each shadow ray, 1 + the index of the set of geometry that casts shadows from the ray's
  /// light, or 0 if all geometry casts shadows. Null if the scene has no light linking.
  const uint32_t* shadow_set = nullptr;
  uint32_t shadow_stride = 0;
  uint32_t ray_kind = kVisibleToCamera;  ///< a RayVisibility flag
  /// For each ray, PathRow::pdf, which is 0 after a delta bounce; the stride is the same as for
  /// `pixel_hash`. Null for camera rays, shadow rays and light paths, which do not hit lights of
  /// ShapeVisibility::kDeltaBounces.
  const float* bounce_pdf = nullptr;
  /// For each ray, the only object that it can hit, as returned by `object_of`. The stride is the
  /// same as for `pixel_hash`. Rays that are restricted to an object hit no lights. Null means that
  /// rays can hit all objects.
  const uint32_t* object = nullptr;
  /// Whether rays pass surfaces that transmit straight. If not, such surfaces are opaque, as for
  /// picking.
  bool passes_straight = false;
  /// For each slot, the optical depth of its shadow ray in units of log(2) / kOpticalDepthUnit, to
  /// which occlusion queries add -log2 of the fraction of light that each partly transparent
  /// surface lets pass. The sum is undefined for blocked rays. If null, partly transparent surfaces
  /// stop rays at random.
  uint32_t* optical_depth = nullptr;
};
inline constexpr float kOpticalDepthUnit = 65536.f;
/// Optical depth above which a shadow ray is blocked: a transmittance of 2^-32.
inline constexpr uint32_t kOpaqueDepth = 32u << 16;

/// Returns the fraction of light that an unblocked shadow ray with PresenceKeys::optical_depth
/// `depth` lets pass.
template <typename F>
inline F surface_transmittance(const UInt<F>& depth) {
  return exp(F(F(depth) * (-0.693147181f / kOpticalDepthUnit)));
}

/// Rule for the choice among hits at the same distance.
enum class HitRule : uint8_t {
  kCanonical,  ///< hit that does not depend on packet width or the order of rays
               ///< (docs/decisions/canonical-hits.md)
  kList,    ///< same hits as kCanonical, but small static scenes use a `TriangleList`; the default
  kEmbree,  ///< the hit that Embree finds without filter functions; for `BareTraversal` only
};

/// Two-level bounding volume hierarchy. A BVH is built once for each group of meshes, which can be
/// instanced any number of times. The meshes of group 0, in world space, are in the top level.
///
/// Contract: the accelerator reads the scene's arrays without copying them and keeps the scene
/// alive. Several threads can trace rays at the same time.
class EmbreeAccelerator {
 public:
  /// Builds the acceleration structure with up to `threads` threads; 0 means all threads. Throws
  /// Error if Embree fails, for example if out of memory.
  EmbreeAccelerator(std::shared_ptr<const Scene> scene, uint32_t threads,
                    HitRule rule = HitRule::kList);
  /// Creates an accelerator for an edited version of the scene of `origin`. The new accelerator
  /// shares those BVHs of `origin` that are still valid for the edited scene. The BVH of a group is
  /// rebuilt if the edit changes whether one of its meshes needs a hit filter or can be hit from
  /// outside only. The top level is rebuilt if a group is rebuilt, an object moves, or the shape or
  /// position of a light changes.
  EmbreeAccelerator(std::shared_ptr<const Scene> edited, const EmbreeAccelerator& origin,
                    uint32_t threads);
  ~EmbreeAccelerator();

  /// Finds the closest hits of rays. `width` is the number of rays per packet: 1, 4, 8 or 16, but
  /// at most the native width. If `coherent` is true, the rays of a packet should have similar
  /// directions, and Embree traverses them together. The hits do not depend on `width` or the order
  /// of rays. If all rays have the same origin, the hits do not depend on `coherent` either;
  /// otherwise, hits at edges may differ (docs/decisions/canonical-hits.md). Scenes with motion
  /// ignore `coherent`, and scenes with moving instances also ignore `width`
  /// (docs/decisions/motion.md).
  void intersect(const RaySpan& rays, const HitSpan& hits, uint32_t width, bool coherent,
                 const PresenceKeys& keys) const;
  /// Sets `occluded[i]` to 1 if ray `i` hits something before its `tfar`, and to 0 otherwise.
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
