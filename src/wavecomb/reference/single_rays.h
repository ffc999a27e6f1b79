// SPDX-License-Identifier: Apache-2.0
/// Ray tracing of the reference integrator, one ray at a time.
#pragma once

#include "wavecomb/accel/embree_accelerator.h"
#include "wavecomb/aov/path_aovs.h"
#include "wavecomb/geometry/hit/hit_material.h"
#include "wavecomb/path/statistics.h"
#include "wavecomb/wave/wave.h"

namespace wavecomb {

/// Slot index of the path that is being traced.
inline constexpr uint32_t kOnlySlot = 0;

struct SingleHit {
  float t, u, v;
  uint32_t prim, geom, inst;
  uint32_t event_material;  ///< valid if inst is kNoSurface
};

/// Traces rays for the paths of the reference integrator, which are traced one after the other.
class SingleRays {
 public:
  SingleRays(const WaveContext& context, Counts& counts, PathAovs& aovs)
      : context_(context), counts_(counts), aovs_(aovs) {}

  /// Starts a path with `key`, which must outlive its rays, at shutter time `time`.
  void begin(const SampleKey<float>& key, float time) {
    keys_ = {&key.pixel_hash, &key.sample, 1, 0};
    keys_.passes_straight = true;
    time_ = time;
  }
  float time() const { return time_; }
  /// Returns the presence keys of the last ray.
  const PresenceKeys& keys() const { return keys_; }

  /// Traces a ray. `bounce_pdf` is PresenceKeys::bounce_pdf and must outlive keys().
  SingleHit intersect(const Vec3<float>& o, const Vec3<float>& d, float tfar, uint32_t depth,
                      const float* bounce_pdf = nullptr) {
    SingleHit h;
    keys_.salt = 2 * depth;
    keys_.ray_kind = ray_kind(depth, false);
    keys_.bounce_pdf = bounce_pdf;
    keys_.shadow_set = nullptr;
    context_.accel->intersect(span(o, d, tfar), {&h.t, &h.u, &h.v, &h.prim, &h.geom, &h.inst}, 1,
                              false, keys_);
    counts_.add_rays(depth, 1);
    charge();
    return h;
  }

  /// Returns the fraction of the light that reaches the end of a shadow ray: 0 if the ray is
  /// blocked, and the transmittance of partly transparent surfaces otherwise. `shadow_set` is
  /// VertexResult::shadow_set, or null.
  float unoccluded(const Vec3<float>& o, const Vec3<float>& d, float tfar, uint32_t depth,
                   const uint32_t* shadow_set) {
    uint32_t blocked = 0, optical_depth = 0;
    keys_.salt = 2 * depth + 1;
    keys_.ray_kind = ray_kind(depth, true);
    keys_.bounce_pdf = nullptr;
    keys_.shadow_set = shadow_set;
    keys_.optical_depth = &optical_depth;
    context_.accel->occluded(span(o, d, tfar), &blocked, 1, false, keys_);
    counts_.add_shadow_rays(depth, 1);
    keys_.optical_depth = nullptr;
    charge();
    return blocked != 0 ? 0.f : surface_transmittance<float>(optical_depth);
  }

  uint32_t mesh_of(const SingleHit& hit) const {
    const SceneView& scene = context_.scene;
    return scene.geometry_mesh[scene.instances[hit.inst].geometry + hit.geom];
  }
  uint32_t material_of(const SingleHit& hit, uint32_t mesh) const {
    const SceneView& scene = context_.scene;
    return hit_material<float>(scene, scene.instances[hit.inst].material, mesh, hit.prim, true);
  }

 private:
  RaySpan span(const Vec3<float>& o, const Vec3<float>& d, const float& tfar) const {
    return {&o.x, &o.y,  &o.z,       &d.x, &d.y,
            &d.z, &tfar, &kOnlySlot, 1,    context_.scene.has_motion ? &time_ : nullptr};
  }
  void charge() {
    aovs_.charge_rays(1, [](size_t) { return kOnlySlot; });
  }

  const WaveContext& context_;
  Counts& counts_;
  PathAovs& aovs_;
  PresenceKeys keys_;
  float time_ = 0;
};

}  // namespace wavecomb
