// SPDX-License-Identifier: Apache-2.0
/// Trains the guiding field before the first pass.
///
/// Camera paths over the whole image are traced in rounds, each with twice as many paths as the
/// previous round. The first round only samples BSDFs, and each later round uses the field of the
/// previous rounds. The result does not depend on seed, region, threads, waves or lanes, so that
/// crops, resumed renders and merged renders are guided by the same field. Training paths do not
/// contribute to the image, because samples would be biased if a field built from them also guided
/// them.
#pragma once

#include <functional>
#include <memory>
#include <optional>

#include "wavecomb/core/settings.h"
#include "wavecomb/guiding/field/field.h"
#include "wavecomb/guiding/image_tiles.h"
#include "wavecomb/render/camera_path_part.h"
#include "wavecomb/render/wave_setup.h"
#include "wavecomb/scene/scene.h"

namespace wavecomb {

struct WaveContext;

/// Statistics of the training.
struct GuidingStatistics {
  GuidingFieldStatistics facts;  ///< statistics of the last field that was built
  uint64_t paths = 0;            ///< training paths; 0 if nothing was learned
  uint32_t rounds = 0;
  uint64_t field_bytes = 0;
  /// For Guiding::kAuto: ratio of the efficiency with the field to the efficiency without it,
  /// measured in pilot renders, or 0 if unknown. The efficiency includes light paths.
  double gain = 0;
  /// Expected fraction of vertices at which a path survives learned roulette.
  double survival = 1;
  bool used = false;  ///< whether the render uses the field for bounces or roulette
  double seconds = 0;
  bool is_reused = false;  ///< whether the training was taken over from an earlier render or a
                           ///< checkpoint
};

/// Result of the training.
struct GuidingTraining {
  std::shared_ptr<const GuidingField> field;  ///< null if nothing was learned
  std::optional<ImageTiles> tiles;  ///< brightness of the image; set if there is a guiding field
  GuidingStatistics statistics;
};

/// Returns the device layout of the field and of the tiles. The result is valid as long as
/// `training` exists.
GuidingView view_of(const GuidingTraining& training);

/// Returns the grid of a scene's guiding field.
GuidingGrid grid_of(const Scene& scene);

/// Returns the number of samples that a render is expected to take on `threads` threads. With a
/// time limit, Settings::spp may be out of reach.
uint64_t expected_samples(const Settings& settings, uint32_t threads);

/// Returns whether the settings ask for path guiding or learned roulette.
bool needs_training(const Settings& settings);

/// Render for which the field is trained.
struct TrainingInput {
  const WaveContext& context;  ///< of the render, with calibrated lights
  const Scene& scene;
  const WaveSetup& waves;
  CameraPathPart camera;  ///< of the render without guiding
};

/// Trains the field for a render. In a render with light paths, training samples have the MIS
/// weights of its camera paths, so that the field guides them to light that light paths do not
/// find. Gives up if `stopped` returns true; the result is then invalid.
GuidingTraining train_guiding(const TrainingInput& render, const std::function<bool()>& stopped);

}  // namespace wavecomb
