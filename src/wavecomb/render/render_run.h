// SPDX-License-Identifier: Apache-2.0
/// Execution of a render plan, from the empty film to the image.
#pragma once

#include <cstddef>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "wavecomb/core/clock.h"
#include "wavecomb/film/film.h"
#include "wavecomb/render/passes/pass_loop.h"
#include "wavecomb/render/passes/pass_runner.h"
#include "wavecomb/render/pilots/pilots.h"
#include "wavecomb/render/render_plan.h"
#include "wavecomb/render/renderer.h"
#include "wavecomb/render/statistics/render_costs.h"
#include "wavecomb/render/statistics/render_statistics.h"
#include "wavecomb/render/watch.h"
#include "wavecomb/wave/wave.h"

namespace wavecomb {

/// Data that is shared by all pilot renders for one image. Both pointers are null in renders that
/// are not pilots.
struct PilotShared {
  const Settings* image = nullptr;  ///< settings of the image for which lights are calibrated
  /// Result of the joint transport's pilot, from the first pilot render.
  std::shared_ptr<const JointPilot::Result>* joint = {};
};

/// Execution of a render according to its plan.
///
/// Contract: one thread calls all functions. It calls run() once, and then finish() once as the
/// last function. The arguments of the constructor outlive the run.
class RenderRun {
 public:
  /// `build_s` is the build time of the accelerator in seconds, for statistics. `transport` is the
  /// choice of the transport for the plan, if the settings did not specify the transport.
  RenderRun(std::shared_ptr<const Scene> scene, const RenderPlan& plan,
            const RenderOptions& options, Watch& watch, double build_s,
            std::optional<TransportChoice> transport);

  /// Runs the pilots and all passes. Calls `learned` on the worker thread when the pilots are done,
  /// unless the render was stopped before. Rethrows exceptions of callbacks and workers.
  void run(PilotCache& cache, const PilotShared& shared,
           const std::function<void(const PilotResults&)>& learned);

  /// Returns the statistics of the render so far. Contract: no worker runs during the call.
  RenderStatistics statistics() const;
  CostProfile cost_profile() const { return costs_.profile(); }
  /// Returns the image and frees the film. Adds the error of the image and the peak memory to
  /// `statistics`.
  RenderedImage finish(RenderStatistics& statistics);

 private:
  /// Fills the film from a checkpoint, if there is one. Returns the state of the checkpoint's pass.
  PassState resume();
  /// Returns the fractions of error and cost that camera paths cause in the render without guiding.
  CameraPathPart camera_part() const;
  void work(PilotCache& cache, const PilotShared& shared,
            const std::function<void(const PilotResults&)>& learned);
  void take_snapshot(bool is_finished);
  /// Throws Error if a texture could not be read, since pixels that show this texture are black.
  void check_textures() const;

  std::shared_ptr<const Scene> scene_;
  const RenderPlan& plan_;
  const RenderOptions& options_;
  Watch& watch_;
  double build_s_;
  std::optional<TransportChoice> transport_;
  RenderCosts costs_;
  Film film_;
  std::vector<std::byte> learned_before_;  ///< packed_training() of an earlier render
  JointPasses joint_;
  WaveContext context_;
  Clock::time_point start_ = Clock::now();
  std::unique_ptr<Integrator> integrator_;
  PassRunner runner_;
  PassLoop loop_;
  PilotResults pilots_;
};

}  // namespace wavecomb
