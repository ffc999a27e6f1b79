// SPDX-License-Identifier: Apache-2.0
/// Pilot renders: small renders before the first pass, which measure data that the render needs.
///
/// The pilots run in this order, and each pilot uses the results of the previous ones:
/// 1. light calibration: the contribution of each light to the image (light_calibration.h);
/// 2. costs of materials (render_costs.h);
/// 3. aiming: directions for light paths (light_paths/render/light_aiming.h);
/// 4. training: where light comes from (guiding_training.h).
/// Each pilot returns its result, its statistics, and its run time in seconds. The results describe
/// the whole image. They depend only on sample counts and not on timing, except for material costs,
/// which do not affect the image. The pilot renders that decide the transport run before these
/// pilots, in the planner (planner.h), because the plan of the render depends on the transport.
#pragma once

#include <cstddef>
#include <functional>
#include <memory>
#include <span>

#include "wavecomb/guiding/field/field_view.h"
#include "wavecomb/render/joint_transport.h"
#include "wavecomb/render/pilots/guiding_training.h"
#include "wavecomb/render/pilots/light_calibration.h"
#include "wavecomb/render/pilots/training_cache.h"
#include "wavecomb/render/render_plan.h"

namespace wavecomb {

/// Results of the pilots of earlier renders of the same scene.
///
/// Contract: only one thread at a time uses the object.
struct PilotCache {
  LightCalibrationCache lights;
  GuidingTrainingCache trainings;
  TransportChoiceCache transports;
};

/// Results of the pilots of one render.
struct PilotResults {
  std::shared_ptr<const LightCalibration> lights;  ///< null if not calibrated yet
  /// Result of the joint transport's pilot; may be null.
  std::shared_ptr<const JointPilot::Result> joint;
  /// Training of the guiding field. The pointer is never null, but there is no field unless
  /// training has succeeded.
  std::shared_ptr<const GuidingTraining> training = std::make_shared<const GuidingTraining>();
  /// Lights with calibrated weights, and with target spheres if they emit light paths.
  LightView light_view;
  GuidingView guiding_view;  ///< view of the guiding field of `training`, if any

  /// Makes the waves of `context` use these results. Contract: this object exists and does not
  /// change while the context is in use.
  void apply(WaveContext& context) const;
};

/// Input of the pilots.
struct PilotInput {
  std::shared_ptr<const Scene> scene;
  const RenderPlan& plan;
  const WaveContext& context;  ///< of the render
  RenderCosts& costs;          ///< receives the measured costs
  /// Costs of an earlier render, or null.
  const CostProfile* profile = nullptr;
  /// Settings of the image for which lights are calibrated: the plan's settings or, in a pilot
  /// render, the settings of the actual render.
  const Settings& light_settings;
  /// Fractions of the error and cost that camera paths cause in the render without guiding.
  CameraPathPart camera;
  /// Packed training of an earlier render (packed_training()), used instead of new training; may be
  /// empty.
  std::span<const std::byte> learned;
  /// Result of the joint transport in an earlier pilot render of the same image; may be null.
  std::shared_ptr<const JointPilot::Result> joint;
  std::function<bool()> stopped;  ///< returns true if the pilots should stop
  std::function<bool()> halted;   ///< returns whether a pause was requested
};

/// Runs the pilots of a render. The results are invalid if `stopped` returned true.
PilotResults run_pilots(const PilotInput& input, PilotCache& cache);

}  // namespace wavecomb
