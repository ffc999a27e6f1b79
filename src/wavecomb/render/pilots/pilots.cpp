// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/render/pilots/pilots.h"

#include <utility>

namespace wavecomb {
namespace {

/// Returns the guiding training that a render uses, which may come from an earlier render.
std::shared_ptr<const GuidingTraining> training_for(const PilotInput& input,
                                                    const WaveContext& context, PilotCache& cache) {
  if (!input.learned.empty()) {
    auto earlier = std::make_shared<const GuidingTraining>(
        unpacked_training(input.learned, *input.scene, input.plan.settings));
    if (earlier->statistics.paths > 0) return earlier;
  }
  return cache.trainings.get(input.scene,
                             {.context = context,
                              .scene = *input.scene,
                              .waves = input.plan.waves,
                              .camera = input.camera},
                             input.stopped);
}

}  // namespace

void PilotResults::apply(WaveContext& context) const {
  context.scene.lights = light_view;
  if (training->field) context.guide = &guiding_view;
}

PilotResults run_pilots(const PilotInput& input, PilotCache& cache) {
  const RenderPlan& plan = input.plan;
  WaveContext context = input.context;
  LightView& view = context.scene.lights;
  PilotResults found;
  found.lights = cache.lights.get(input.scene, plan.accelerator, plan.view, input.light_settings,
                                  input.stopped);
  found.lights->apply(view);
  JointPilot::prepare(*input.scene, context);
  input.costs.start(context, plan.kernels, input.profile, input.halted);
  found.joint = JointPilot::run(*input.scene, plan.waves, input.joint, input.stopped, context);
  found.light_view = view;
  found.training = training_for(input, context, cache);
  if (found.training->field) found.guiding_view = view_of(*found.training);
  return found;
}

}  // namespace wavecomb
