// SPDX-License-Identifier: Apache-2.0
/// A render by a plan, from the empty film to the image.
#pragma once

#include <cstddef>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "wavecomb/core/clock.h"
#include "wavecomb/film/film.h"
#include "wavecomb/integrate/visible_points.h"
#include "wavecomb/integrate/wave.h"
#include "wavecomb/render/pass_loop.h"
#include "wavecomb/render/pass_runner.h"
#include "wavecomb/render/pilots.h"
#include "wavecomb/render/render_costs.h"
#include "wavecomb/render/render_plan.h"
#include "wavecomb/render/render_statistics.h"
#include "wavecomb/render/renderer.h"
#include "wavecomb/render/watch.h"

namespace wavecomb {

/// Data that the trials for one image share. Both pointers are null in other renders.
struct TrialShared {
  const Settings* image = nullptr;                  ///< whose lights are calibrated
  std::shared_ptr<const LightAiming>* aiming = {};  ///< learned by the first trial, for the others
};

/// Contract: all functions on one thread; run() once, finish() once and last. The arguments of the
/// constructor outlive the run.
class RenderRun {
 public:
  /// `build_s`: seconds that the accelerator took to build, for statistics.
  RenderRun(std::shared_ptr<const Scene> scene, const RenderPlan& plan,
            const RenderOptions& options, Watch& watch, double build_s);

  /// Runs the pilots and all passes. `learned`: called when the pilots are done, by the thread that
  /// works, unless the render was stopped before. Throws what callbacks and workers throw.
  void run(PilotCache& cache, const TrialShared& shared,
           const std::function<void(const PilotResults&)>& learned);

  /// Statistics of the render so far. Contract: while no worker runs.
  RenderStatistics statistics() const;
  CostProfile cost_profile() const { return costs_.profile(); }
  /// The image. The film is freed meanwhile. `statistics`: get the error of the image and the peak
  /// of memory.
  Picture finish(RenderStatistics& statistics);

 private:
  /// Fills the film by what a checkpoint kept, if there is one; returns its pass.
  PassState resume();
  void work(PilotCache& cache, const TrialShared& shared,
            const std::function<void(const PilotResults&)>& learned);
  void take_snapshot(bool is_finished);
  /// Throws where a texture could not be read: pixels that used it are black.
  void check_textures() const;

  std::shared_ptr<const Scene> scene_;
  const RenderPlan& plan_;
  const RenderOptions& options_;
  Watch& watch_;
  double build_s_;
  RenderCosts costs_;
  Film film_;
  std::vector<std::byte> learned_before_;  ///< packed_training() of an earlier render
  VisibleGrid visible_;
  WaveContext context_;
  Clock::time_point start_ = Clock::now();
  std::unique_ptr<Integrator> integrator_;
  PassRunner runner_;
  PassLoop loop_;
  PilotResults pilots_;
};

}  // namespace wavecomb
