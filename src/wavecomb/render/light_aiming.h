// SPDX-License-Identifier: Apache-2.0
/// Learns where to aim paths from lights, before the first pass.
///
/// Paths are traced in rounds, the first aimed at what the camera sees, the others at what the
/// round before has found. They are not in the picture. Nothing of it depends on seed, region,
/// samples, threads, waves or lanes: so parts of a picture, a resumed one and merged ones are aimed
/// alike.
#pragma once

#include <cstdint>
#include <functional>

#include "wavecomb/integrate/wave.h"
#include "wavecomb/render/guide_training.h"
#include "wavecomb/scene/light_aim.h"

namespace wavecomb {

/// What came of it, and what a render says of it.
struct LightAiming {
  LightAim aim;        ///< of no spheres: paths are not aimed
  uint64_t paths = 0;  ///< that taught
  double seconds = 0;
};

/// Learns for a render with `context`, whose lights are weighed and send paths. `stopped`: give up;
/// what comes back is then of no use.
LightAiming learn_to_aim(const WaveContext& context, const Scene& scene, const WaveSetup& waves,
                         const std::function<bool()>& stopped);

}  // namespace wavecomb
