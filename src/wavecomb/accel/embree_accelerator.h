// SPDX-License-Identifier: Apache-2.0
/// Ray traversal by Embree, which only .cpp files and embree_*.h of this folder include.
#pragma once

#include <cstdint>
#include <memory>

#include "wavecomb/scene/scene.h"

struct RTCSceneTy;  // Embree's

namespace wavecomb {

/// Rays to trace, column by column. Directions are unit, tnear is 0.
struct RaySpan {
  const float *ox, *oy, *oz, *dx, *dy, *dz;
  const float* tfar;     ///< null: no limit
  const uint32_t* slot;  ///< for presence, see PresenceKeys; may be null
  size_t size;
  const float* time = nullptr;  ///< of the shutter, in [0, 1]; null: 0
};

/// Where hits go: barycentric u, v as in HitBuffer; `inst` is an index into SceneView::instances
/// and `geom` a geometry within its group, or `inst` is kLightShape and geom is the light's number
/// among the records.
struct HitSpan {
  float *t, *u, *v;
  uint32_t *prim, *geom, *inst;
};
inline constexpr uint32_t kNoHit = 0xffffffffu;
inline constexpr uint32_t kLightShape = 0xfffffffeu;

/// What stands for a mesh as an instance shows it, in PresenceKeys::object. Two of a scene's have
/// the same one only by chance of 2^-32, from some ten thousands of instances on.
template <typename U>
inline U object_of(const U& inst, const U& mesh) {
  return U(inst * 0x9e3779b1u) + mesh;
}

/// What decides whether a partly present surface is there for a path: random numbers keyed by the
/// path, so that no traversal order matters. Indexed by slot.
struct PresenceKeys {
  const uint32_t* pixel_hash = nullptr;
  const uint32_t* sample = nullptr;
  uint32_t stride = 1;  ///< words from one slot's to the next one's
  /// Different for every depth and for shadow rays, so that crossings are independent.
  uint32_t salt = 0;
  /// Of shadow rays where lights are linked: 1 + the set of geometry that is in their way, 0: all.
  const uint32_t* shadow_set = nullptr;
  uint32_t shadow_stride = 0;
  uint32_t ray_kind = kSeenByCamera;  ///< of RayVisibility
  /// Of rays that meet one object alone, and no light: its object_of, indexed as the hash is.
  const uint32_t* object = nullptr;
};

/// Which of equally close hits a hierarchy is built to give.
enum class HitRule : uint8_t {
  kCanonical,  ///< the same one for any packet (docs/decisions/canonical-hits.md)
  kList,       ///< likewise, and small still scenes by a list (triangle_list.h): the default
  kEmbree,     ///< whichever Embree keeps; no filter anywhere. For BareTraversal only
};

/// A two-level bounding volume hierarchy: each group of meshes committed once, instanced any number
/// of times; the world's own meshes in the top level.
///
/// Contract: reads the Scene's arrays without copies and shares its ownership; tracing is
/// thread-safe.
class EmbreeAccelerator {
 public:
  /// Builds with up to `threads` threads (0: all). Throws Error when Embree refuses (out of memory
  /// ...).
  EmbreeAccelerator(std::shared_ptr<const Scene> scene, uint32_t threads,
                    HitRule rule = HitRule::kList);
  /// For a scene that was edited out of origin's: shares the hierarchy, or those groups of it whose
  /// meshes are as they were. Built anew are groups with meshes that begin or cease to be partly
  /// present, and then, or where a light's shape or place is another, the top level.
  EmbreeAccelerator(std::shared_ptr<const Scene> edited, const EmbreeAccelerator& origin,
                    uint32_t threads);
  ~EmbreeAccelerator();

  /// Closest hits. `width`: rays per packet, 1, 4, 8 or 16, of 16 or 8 the native width where that
  /// is less. `coherent`: the rays of a packet go much the same way, and are traversed together.
  /// Hits do not depend on width or order, nor on coherence for rays from one point; from several,
  /// rays at edges may differ (docs/decisions/canonical-hits.md). Where things move, none are taken
  /// for coherent; where instances do, each ray is traced alone (docs/decisions/motion.md).
  void intersect(const RaySpan& rays, const HitSpan& hits, uint32_t width, bool coherent,
                 const PresenceKeys& keys) const;
  /// occluded[i] = 1 where something lies before tfar, else 0.
  void occluded(const RaySpan& rays, uint32_t* occluded, uint32_t width, bool coherent,
                const PresenceKeys& keys) const;

  /// Whether rays are tested against a list in place of the hierarchy.
  bool has_list() const;
  /// Memory that Embree holds for the hierarchy, bytes.
  size_t bytes() const;
  /// Widest packets that Embree traces natively here.
  uint32_t native_width() const;
  /// The top level, as an RTCScene. The same for scenes that share it.
  RTCSceneTy* embree_scene() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace wavecomb
