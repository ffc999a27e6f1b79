// SPDX-License-Identifier: Apache-2.0
/// Training of the target spheres at which light paths are aimed, before the first pass.
///
/// Light paths are traced in rounds. The first round aims at the points that the camera sees, each
/// later round at the target spheres fitted in the previous round. The training paths do not
/// contribute to the image. The result does not depend on seed, region, samples, threads, waves or
/// lanes, so that crops, resumed renders and merged renders aim at the same spheres.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>

#include "wavecomb/light/description/aim.h"
#include "wavecomb/render/wave_setup.h"
#include "wavecomb/wave/wave.h"

namespace wavecomb {

/// Target spheres of light paths, and statistics of their training.
struct LightAiming {
  LightAim aim;        ///< target spheres; if there are none, light paths are not aimed
  uint64_t paths = 0;  ///< training paths
  double seconds = 0;
};

/// Trains the target spheres for a render with `context`. The lights of `context` must be
/// calibrated and emit light paths. Stops early if `stopped` returns true; the result is then
/// invalid.
LightAiming learn_to_aim(const WaveContext& context, const Scene& scene, const WaveSetup& waves,
                         const std::function<bool()>& stopped);

/// Pilot of the light path transport that trains the target spheres. `run_pilots()` calls its
/// functions (render/joint_transport.h).
struct LightPathPilot {
  using Result = LightAiming;
  /// Makes the lights of `context` emit light paths, if the render uses light paths.
  static void prepare(const Scene& scene, WaveContext& context);
  /// Trains target spheres. If `earlier` is not null, uses the target spheres of this earlier
  /// result instead. The lights of `context` then point to the target spheres in the result, so
  /// `context` must not outlive the result. Returns null if light paths are not aimed.
  static std::shared_ptr<const LightAiming> run(const Scene& scene, const WaveSetup& waves,
                                                const std::shared_ptr<const LightAiming>& earlier,
                                                const std::function<bool()>& stopped,
                                                WaveContext& context);
};

}  // namespace wavecomb
