// SPDX-License-Identifier: Apache-2.0
/// Connects camera paths of the reference integrator to light paths, and stores their merge points
/// (the counterpart of NoJointTracer in reference/path_tracer.h).
#pragma once

#include <optional>

#include "wavecomb/light_paths/reference/light_tracer.h"
#include "wavecomb/reference/trace_task.h"

namespace wavecomb {

/// Tracer that connects the vertices of camera paths to vertices of light paths, and stores merge
/// points.
class LightJointTracer {
  using F = float;

 public:
  LightJointTracer(const WaveContext& context, ReferenceWorker& worker)
      : context_(context), worker_(worker), light_(worker.joint) {
    if (context.joint.connects) tracer_.emplace(context, worker);
  }

  /// Traces the light path to which the camera path of the same pixel and sample connects.
  void begin(uint32_t pixel, uint32_t sample) {
    if (light_.merge_points) light_.merge_points.clear(1);
    if (tracer_) tracer_->trace(pixel, sample, true);
  }

  /// Connects the current vertex of the camera path to the stored vertex of the light path.
  void use_vertex(uint32_t depth, SingleRays& rays) {
    if (!tracer_) return;
    const ConnectionTarget<F> target = connection_target();
    if (!(max_component(target.row.light) > 0.f)) return;
    worker_.clock.enter(Phase::kShade);
    const auto from = load_row<LightPathRow, F>(light_.vertices.paths, kOnlySlot, true);
    VertexResult<F> v = shade(depth, rays, from, target);
    if (!v.has_shadow) return;
    worker_.clock.enter(Phase::kShadow);
    const uint32_t no_set = 0;
    const bool links = context_.scene.lights.links.members != nullptr;
    const float passed =
        rays.unoccluded(v.shadow_o, v.shadow_d, v.shadow_tfar, depth, links ? &no_set : nullptr);
    if (passed == 0.f) return;
    v.direct = v.direct * passed;
    worker_.events(context_).light<Technique::kConnection, F>(
        {depth, kOnlySlot, v.direct}, [&] { return from.light; }, true);
    light_.aovs.connect<F>(worker_.aovs.expressions(), kOnlySlot, v.direct, true);
  }

  void end(size_t index) {
    if (light_.merge_points) context_.film->set_joint_row(index, light_.merge_points.row(0));
  }
  void end_task(const WaveTask& task) {
    if (tracer_) end_light_task(context_, worker_, task);
  }

 private:
  ConnectionTarget<F> connection_target() const {
    const auto at = load_row<LightVertexRow, F>(light_.vertices.chosen, kOnlySlot, true);
    return {load_row<ConnectionRow, F>(light_.vertices.connections, kOnlySlot, true),
            at.depth == 0};
  }

  /// Shades the stored vertex of the light path; `from` is the row of the ray that hit it.
  VertexResult<F> shade(uint32_t depth, const SingleRays& rays, const LightPathRow<F>& from,
                        const ConnectionTarget<F>& target) {
    const SceneView& scene = context_.scene;
    const auto at = load_row<LightVertexRow, F>(light_.vertices.chosen, kOnlySlot, true);
    const auto hit = load_row<ShadingRecord, F>(light_.vertices.records, kOnlySlot, true);
    worker_.counts.add_records(depth, 1);
    if (worker_.aovs.models_cost())
      worker_.aovs.add_cost(kOnlySlot, context_.roulette_costs->material(at.material));
    const MeshHit<F> mesh_hit{hit.inst, hit.mesh, hit.prim, hit.u, hit.v, rays.time()};
    const PathState<F> state =
        light_path_state<F>(*context_.camera, from, hit.t, rays.time(), true);
    VertexAovs<F> aovs;
    aovs.wants_events = light_.aovs.wants_events();
    const VertexResult<F> v = kShadeLightVertex<F>[scene.material_program[at.material]](
                                  {scene, settings_, from.key, depth, mesh_hit, hit.geom, hit.t,
                                   at.material, state, &aovs, true, context_.guide},
                                  from.light_state(), setup_, & target)
                                  .v;
    if (aovs.wants_events) light_.aovs.record_connection<F>(kOnlySlot, aovs.light_scattering, true);
    return v;
  }

  const WaveContext& context_;
  ReferenceWorker& worker_;
  LightPathBuffers& light_;
  const ShadeSettings settings_ = light_shade_settings(*context_.settings);
  const LightPathSetup setup_{context_.joint, *context_.camera, nullptr};
  std::optional<LightTracer> tracer_;  ///< with connections
};

}  // namespace wavecomb
