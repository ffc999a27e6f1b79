// SPDX-License-Identifier: Apache-2.0
/// Light paths of the reference integrator, traced one after the other in scalar code.
#pragma once

#include "wavecomb/light_paths/light_path_start.h"
#include "wavecomb/light_paths/stages/light_kernels.h"
#include "wavecomb/light_paths/stages/light_splat.h"
#include "wavecomb/path/steps/survive.h"
#include "wavecomb/reference/reference_worker.h"
#include "wavecomb/reference/single_rays.h"

namespace wavecomb {

/// Tracer that traces light paths one after the other and adds their contributions to the film.
class LightTracer {
  using F = float;

 public:
  LightTracer(const WaveContext& context, ReferenceWorker& worker)
      : context_(context),
        settings_(light_shade_settings(*context.settings)),
        buffers_(worker.joint),
        merger_{context.joint.grid, &buffers_.splats, context.film},
        setup_{context.joint, *context.camera,
               context.joint.merges() && !context.joint.aim_samples ? &merger_ : nullptr},
        clock_(worker.clock),
        counts_(worker.counts),
        rays_(context, worker.counts, worker.aovs) {}

  /// Traces one light path. If `keeps` is true, stores one vertex of the light path for the camera
  /// path of the same pixel and sample.
  void trace(uint32_t pixel, uint32_t sample, bool keeps = false) {
    if (keeps) buffers_.vertices.clear(1);
    const SceneView& scene = context_.scene;
    const LightPath<F> start =
        begin_light_path<F>(scene.lights, *context_.settings, pixel, sample, true);
    const Emission<F>& e = start.emission;
    if (!e.valid) return;
    rays_.begin(start.key, context_.moves()
                               ? light_path_time<F>(*context_.settings, start.key, pixel, sample)
                               : 0.f);
    if (buffers_.aovs.wants_events()) buffers_.aovs.begin<F>(kOnlySlot, e.light, true);
    PathState<F> path = start.start();
    LightPathState<F> light = start.light_state();
    for (uint32_t depth = 0;; ++depth) {
      clock_.enter(Phase::kTrace);
      const SingleHit hit = rays_.intersect(path.o, path.dir, kInfinity, depth);
      clock_.enter(Phase::kShade);
      if (hit.inst == kNoHit || hit.inst == kLightShape) return;
      if (context_.joint.aim_samples && depth == 0)
        context_.joint.aim_samples->begin(light_path_number(*context_.settings, pixel),
                                          fma(path.dir, hit.t, path.o));
      const uint32_t mesh = rays_.mesh_of(hit), material = rays_.material_of(hit, mesh);
      if (settings_.cost_aware && depth >= settings_.roulette_depth) {
        const F q = cost_aware_survival<F>(scene, *context_.roulette_costs, material, path, true);
        if (!(cost_aware_number<F>(start.key, depth) < q)) return;
        path.throughput *= 1.f / q;
      }
      VertexAovs<F> aovs;
      aovs.wants_events = buffers_.aovs.wants_events();
      const LightVertexResult<F> out =
          shade({depth, light_path_row<F>(path, light, start.key)}, hit, mesh, material, aovs);
      const VertexResult<F>& v = out.v;
      if (aovs.wants_events) buffers_.aovs.shade<F>(depth, kOnlySlot, start.key, aovs, true);
      if (keeps)
        store_vertex({depth, light_path_row<F>(path, light, start.key)}, hit, mesh, material, out);
      if (v.has_shadow) {
        clock_.enter(Phase::kShadow);
        const float passed =
            rays_.unoccluded(v.shadow_o, v.shadow_d, v.shadow_tfar, depth, nullptr);
        if (passed > 0.f)
          add_contribution(pixel, sample, {depth, light_path_row<F>(path, light, start.key)}, out,
                           v.direct * passed);
      }
      if (!v.alive) return;
      path = v.next;
      light = out.next;
    }
  }

 private:
  /// State of a light path on arrival at vertex number `depth`.
  struct Arrival {
    uint32_t depth;
    LightPathRow<F> path;
  };

  void add_contribution(uint32_t pixel, uint32_t sample, const Arrival& at,
                        const LightVertexResult<F>& out, const Color<F>& c) {
    if (context_.joint.aim_samples) {
      context_.joint.aim_samples->add(light_path_number(*context_.settings, pixel), at.depth, c);
      return;
    }
    const LightSplatPoint point = light_splat_point(at.path.key, at.depth, out.x, out.y);
    add_light_splat(context_, buffers_.splats, sample, point, c);
    if (buffers_.aovs)
      buffers_.aovs.add_to_film(
          *context_.film, *context_.joint.filter,
          {.slot = kOnlySlot, .depth = at.depth, .light = at.path.light, .at = point, .c = c});
  }

  void store_vertex(const Arrival& at, const SingleHit& hit, uint32_t mesh, uint32_t material,
                    const LightVertexResult<F>& out) {
    const ShadingRecord<F> record{hit.t,    hit.u, hit.v,    hit.prim,
                                  hit.inst, mesh,  hit.geom, kOnlySlot};
    if (store_light_vertex<F>(buffers_.vertices, at.depth, at.path, record, material, out.p,
                              out.is_candidate) &&
        buffers_.aovs.wants_events())
      buffers_.aovs.mark_stored<F>(kOnlySlot, true);
  }

  LightVertexResult<F> shade(const Arrival& at, const SingleHit& hit, uint32_t mesh,
                             uint32_t material, VertexAovs<F>& aovs) {
    const SceneView& scene = context_.scene;
    counts_.add_records(at.depth, 1);
    const MeshHit<F> mesh_hit{hit.inst, mesh, hit.prim, hit.u, hit.v, rays_.time()};
    const PathState<F> state =
        light_path_state<F>(*context_.camera, at.path, hit.t, rays_.time(), true);
    return kShadeLightVertex<F>[scene.material_program[material]](
        {scene, settings_, at.path.key, at.depth, mesh_hit, hit.geom, hit.t, material, state, &aovs,
         true, context_.guide},
        at.path.light_state(), setup_, nullptr);
  }

  const WaveContext& context_;
  const ShadeSettings settings_;
  LightPathBuffers& buffers_;
  const Merger merger_;
  const LightPathSetup setup_;
  PhaseClock& clock_;
  Counts& counts_;
  SingleRays rays_;
};

/// Adds the contributions of a task's light paths to the film.
inline void end_light_task(const WaveContext& context, ReferenceWorker& worker,
                           const WaveTask& task) {
  if (!context.joint.aim_samples) context.film->take(worker.joint.splats);
  count_light_paths(context, task);
}

/// Traces the light paths of a task.
inline void trace_light_task(const WaveContext& context, ReferenceWorker& worker,
                             const WaveTask& task) {
  LightTracer tracer(context, worker);
  worker.clock.start(Phase::kGenerate);
  for (uint32_t p = 0; p < task.pixel_count; ++p)
    for (uint32_t s = 0; s < task.samples; ++s) {
      worker.clock.enter(Phase::kGenerate);
      tracer.trace(task.pixels[p], task.first_sample + s);
    }
  end_light_task(context, worker, task);
  worker.clock.stop();
}

}  // namespace wavecomb
