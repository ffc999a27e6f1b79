// SPDX-License-Identifier: Apache-2.0
/// Teaches the field that guides bounces, before the first pass.
///
/// Paths of the whole picture's camera are traced in rounds of twice as many each, the first by the
/// materials alone, the others by the field that the rounds before have taught. Nothing of it
/// depends on seed, region, threads, waves or lanes; so parts of a picture, a resumed one and
/// merged ones are guided alike. Its paths are not in the picture, which a field made of its own
/// samples would bias.
#pragma once

#include <functional>
#include <memory>

#include "wavecomb/integrate/wave.h"
#include "wavecomb/learn/guide_field.h"

namespace wavecomb {

/// What came of it.
struct GuideTraining {
  std::unique_ptr<const GuideField> field;  ///< null: bounces are not guided
  GuideFacts facts;                         ///< of the last field that was made
  uint64_t paths = 0;
  uint32_t rounds = 0;
  double seconds = 0;
};

/// How training paths are run.
struct TrainingMeans {
  uint32_t lanes, threads, wave_size;
};

/// Trains for a render with `context`, whose lights are weighed. `stopped`: give up; what comes
/// back is then of no use.
GuideTraining train_guide(const WaveContext& context, const Scene& scene,
                          const TrainingMeans& means, const std::function<bool()>& stopped);

}  // namespace wavecomb
