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
#include <optional>

#include "wavecomb/core/settings.h"
#include "wavecomb/learn/guide_field.h"
#include "wavecomb/render/picture_tiles.h"
#include "wavecomb/render/wave_setup.h"
#include "wavecomb/scene/scene.h"

namespace wavecomb {

struct WaveContext;

/// What a render says of it.
struct GuideStatistics {
  GuideFacts facts;    ///< of the last field that was made
  uint64_t paths = 0;  ///< that taught; 0: nothing was learned
  uint32_t rounds = 0;
  uint64_t field_bytes = 0;
  /// Of Guiding::kAuto: efficiency of some pixels with the field to the same without; 0: not known.
  double gain = 0;
  /// Of the roulette that was learned, as training expects it: the share of vertices from which
  /// paths go on.
  double survival = 1;
  bool used = false;  ///< whether the picture is guided, or its roulette told, by the field
  double seconds = 0;
  bool is_kept = false;  ///< learned by a render that this one goes on with
};

/// What came of it.
struct GuideTraining {
  std::shared_ptr<const GuideField> field;  ///< null: nothing was learned
  std::optional<PictureTiles> tiles;        ///< of the picture, with a field
  GuideStatistics statistics;
};

/// The field and the tiles as kernels read them. Contract: valid as long as `training`.
GuideView view_of(const GuideTraining& training);

/// The grid of a scene's field.
GuideGrid grid_of(const Scene& scene);

/// Whether a render with such settings is guided, or told where paths end, by what is learned.
bool is_taught(const Settings& settings);

/// Trains for a render with `context`, whose lights are weighed. `stopped`: give up; what comes
/// back is then of no use.
GuideTraining train_guide(const WaveContext& context, const Scene& scene, const WaveSetup& waves,
                          const std::function<bool()>& stopped);

}  // namespace wavecomb
