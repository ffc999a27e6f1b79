// SPDX-License-Identifier: Apache-2.0
/// Learns where to aim light paths, before the first pass.
///
/// Light paths are traced in rounds. The first round aims at the points that the camera sees, the
/// others at the results of the round before. The paths of this pilot do not contribute to the
/// image. The result does not depend on seed, region, samples, threads, waves or lanes, so that
/// crops, resumed renders and merged renders aim alike.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>

#include "wavecomb/light/description/aim.h"
#include "wavecomb/render/wave_setup.h"
#include "wavecomb/wave/wave.h"

namespace wavecomb {

/// Result of the pilot that learns where to aim, with statistics.
struct LightAiming {
  LightAim aim;        ///< paths are not aimed if it has no spheres
  uint64_t paths = 0;  ///< training paths
  double seconds = 0;
};

/// Learns for a render with `context`, whose lights are calibrated and send paths. Gives up if
/// `stopped` returns true; the result is then invalid.
LightAiming learn_to_aim(const WaveContext& context, const Scene& scene, const WaveSetup& waves,
                         const std::function<bool()>& stopped);

/// Pilot of light paths, which run_pilots() calls (render/joint_transport.h).
struct LightPathPilot {
  using Result = LightAiming;
  /// Makes the lights of `context` emit light paths, if the render has any.
  static void prepare(const Scene& scene, WaveContext& context);
  /// Learns to aim, unless `earlier` is the result of an earlier pilot, and aims the lights of
  /// `context`, which must not outlive the result. Returns null if light paths are not aimed.
  static std::shared_ptr<const LightAiming> run(const Scene& scene, const WaveSetup& waves,
                                                const std::shared_ptr<const LightAiming>& earlier,
                                                const std::function<bool()>& stopped,
                                                WaveContext& context);
};

}  // namespace wavecomb
