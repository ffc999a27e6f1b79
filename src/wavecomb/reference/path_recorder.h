// SPDX-License-Identifier: Apache-2.0
/// Radiance and AOVs of the path that the reference integrator traces.
#pragma once

#include <span>

#include "wavecomb/aov/path_aovs.h"
#include "wavecomb/aov/screen_motion.h"
#include "wavecomb/path/media.h"
#include "wavecomb/path/path_history.h"
#include "wavecomb/path/steps/emit.h"
#include "wavecomb/path/steps/escape.h"
#include "wavecomb/reference/reference_worker.h"
#include "wavecomb/reference/single_rays.h"

namespace wavecomb {

/// Base class of PathTracer, which holds the state, radiance and AOVs of the current path.
class PathRecorder {
 protected:
  using F = float;

  PathRecorder(const WaveContext& context, ReferenceWorker& worker)
      : context_(context),
        settings_(*context.settings),
        counts_(worker.counts),
        rays_(context, worker.counts, worker.aovs),
        aovs_(worker.aovs),
        history_(worker.history) {}

  /// Adds the light of a path that leaves the scene or hits the shape of a light.
  void add_ended(uint32_t depth, const PathState<F>& path, const SingleHit& hit) {
    const SceneView& scene = context_.scene;
    const CameraSetup& camera = *context_.camera;
    if (hit.inst == kNoHit) {
      if (!settings_.adds_environment(depth)) return;
      radiance_.sum += environment_emission<F>(scene, settings_, depth, path, true);
      if (aovs_.wants_lights())
        aovs_.add_environment<F>(scene, settings_, depth, kSlot, path, true);
      return;
    }
    if (depth == 0) {
      const Vec3<F> p = fma(path.dir, hit.t, path.o);
      const F time = rays_.time();
      if (aovs_.wants_alpha()) aovs_.cover<F>(kSlot, true);
      aovs_.hit_light<F>(camera, kSlot, p, time, hit.geom, true);
      if (aovs_.wants_motion())
        aovs_.move<F>(
            kSlot, screen_motion_of_light<F>(scene.lights, camera, hit.geom, p, time, true), true);
    }
    add(hit.geom, shape_emission<F>(scene, settings_, depth, hit.geom, hit.t, path, true));
  }

  /// Records the first hit of a camera ray for AOVs. The ray with direction `dir` has hit a surface
  /// or a volume event at `p`.
  void note_first_hit(const Vec3<F>& dir, const Vec3<F>& p, const SingleHit& hit, uint32_t mesh,
                      uint32_t material) {
    const CameraSetup& camera = *context_.camera;
    const F time = rays_.time();
    if (hit.inst == kNoSurface) {
      aovs_.hit_volume<F>(camera, kSlot, p, time, volume_hit(material), true);
      return;
    }
    aovs_.hit_surface<F>(camera, kSlot, p, time,
                         {.inst = hit.inst, .geom = hit.geom, .material = material}, true);
    if (aovs_.wants_motion())
      aovs_.move<F>(
          kSlot,
          screen_motion_of_hit<F>(context_.scene, camera,
                                  {hit.inst, mesh, hit.prim, hit.u, hit.v, 0.f}, dir, true),
          true);
  }

  void record_choice(const VertexResult<F>& v, const VertexAovs<F>& aovs, F brought) {
    if (probe_count_ == probes_.size()) return;
    probes_[probe_count_++] = {
        aovs.light_id,
        brought,
        aovs.light_weight,
        {aovs.light_position.x, aovs.light_position.y, aovs.light_position.z},
        v.next.receiver};
  }

  /// Adds the contribution `c` of `light` to the radiance. `light` is kNoLight for emission of
  /// surfaces that are not lights.
  void add(uint32_t light, const Color<F>& c) {
    radiance_.sum += c;
    if (aovs_.wants_lights()) aovs_.add_light<F>(kSlot, light, c, true);
  }

  /// Adds the emission `c` of volumes to the radiance.
  void add_volume_emission(const Color<F>& c) {
    radiance_.sum += c;
    if (aovs_.wants_lights()) aovs_.add_volume_emission<F>(kSlot, c, true);
  }
  /// Records a ray segment with its free flight for AOVs. `throughput` is the throughput of the
  /// path after the flight.
  void record_segment(uint32_t depth, const Flight<F>& flight, const Color<F>& throughput) {
    const bool straight = !flight.stopped && !flight.has_scattered;
    if (depth == 0 && aovs_.wants_transmittance())
      aovs_.pass<F>(kSlot, straight ? throughput : Color<F>(0.f), true);
    if (aovs_.expressions() && flight.has_scattered) aovs_.expressions().walk<F>(kSlot, true);
  }
  /// Returns the volume or mesh whose medium has scattered the path. `material` is the material of
  /// the volume event.
  VolumeHit<F> volume_hit(uint32_t material) const {
    const SceneView& scene = context_.scene;
    if (context_.has_medium_stack() && material == scene.nested_media.event_material)
      return {0, medium_stack_.object, medium_stack_.medium, true};
    return {material - scene.volumes.first_material, 0, material, false};
  }

  static constexpr uint32_t kSlot = kOnlySlot;
  const WaveContext& context_;
  const ShadeSettings settings_;
  Counts& counts_;
  SingleRays rays_;
  PathAovs& aovs_;
  PathHistory& history_;
  RadianceRow<F> radiance_;
  MediumStackRow<F>
      medium_stack_{};            ///< medium stack of the path, if the scene has nested dielectrics
  std::span<LightProbe> probes_;  ///< sampled lights of the path; empty if unused
  uint32_t probe_count_ = 0;
};

}  // namespace wavecomb
