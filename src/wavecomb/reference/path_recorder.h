// SPDX-License-Identifier: Apache-2.0
/// Radiance and AOVs of the path that the reference integrator traces.
#pragma once

#include <span>

#include "wavecomb/aov/path_events.h"
#include "wavecomb/path/steps/emit.h"
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
        events_(worker.events(context)),
        radiance_(worker.radiance.row) {}

  /// Adds the light of a path that leaves the scene or hits the shape of a light.
  void add_ended(uint32_t depth, const PathState<F>& path, const SingleHit& hit) {
    if (hit.inst == kNoHit) {
      events_.environment<F>(settings_, depth, kSlot, path, true);
      return;
    }
    if (depth == 0)
      events_.hit_light<F>({kSlot, fma(path.dir, hit.t, path.o), rays_.time()}, hit.geom, true);
    const Color<F> c =
        shape_emission<F>(context_.scene, settings_, depth, hit.geom, hit.t, path, true);
    events_.light<Technique::kEmitter, F>({depth, kSlot, c}, [&] { return hit.geom; }, true);
  }

  /// Records the first hit of a camera ray for AOVs: a surface or a volume event at `p`. `dir` is
  /// the direction of the ray.
  void note_first_hit(const Vec3<F>& dir, const Vec3<F>& p, const SingleHit& hit, uint32_t mesh,
                      uint32_t material) {
    const RayEnd<F> end{kSlot, p, rays_.time()};
    if (hit.inst == kNoSurface)
      events_.hit_volume<F>(
          end,
          volume_hit<F>(context_.scene, reinterpret_cast<const float*>(&medium_stack_), kSlot,
                        material, true),
          true);
    else
      events_.hit_surface<F>(end, dir, {.inst = hit.inst, .geom = hit.geom, .material = material},
                             {hit.inst, mesh, hit.prim, hit.u, hit.v, 0.f}, true);
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

  static constexpr uint32_t kSlot = kOnlySlot;
  const WaveContext& context_;
  const ShadeSettings settings_;
  Counts& counts_;
  SingleRays rays_;
  PathAovs& aovs_;
  const PathEvents events_;
  RadianceRow<F>& radiance_;
  MediumStackRow<F>
      medium_stack_{};            ///< medium stack of the path, if the scene has nested dielectrics
  std::span<LightProbe> probes_;  ///< sampled lights of the path; empty if unused
  uint32_t probe_count_ = 0;
};

}  // namespace wavecomb
