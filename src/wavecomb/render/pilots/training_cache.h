// SPDX-License-Identifier: Apache-2.0
/// Reuse of a training by later renders, which skip their own: as bytes in a checkpoint, or in
/// memory when a scene is rendered again.
#pragma once

#include <cstddef>
#include <functional>
#include <memory>
#include <span>
#include <vector>

#include "wavecomb/render/pilots/guiding_training.h"
#include "wavecomb/scene/scene.h"

namespace wavecomb {

/// Serializes a training: the size of the field and a few hundred bytes. Returns nothing if nothing
/// was learned, because the render is too short or was stopped.
std::vector<std::byte> packed_training(const GuideTraining& training);

/// Restores the training that packed_training() wrote, for the same scene and image size. Throws
/// Error if `bytes` are damaged or of another version or build.
GuideTraining unpacked_training(std::span<const std::byte> bytes, const Scene& scene,
                                const Settings& settings);

/// Cache of the last training, reused by renders of the same scene whose settings lead to the same
/// training: seed, region, layers and scheduling may differ.
///
/// Contract: one thread at a time.
class GuideTrainingCache {
 public:
  /// Returns the cached training, or calls train_guide().
  std::shared_ptr<const GuideTraining> get(const std::shared_ptr<const Scene>& scene,
                                           const WaveContext& context, const WaveSetup& waves,
                                           const std::function<bool()>& stopped);

 private:
  std::weak_ptr<const Scene> scene_;
  Settings settings_;
  std::shared_ptr<const GuideTraining> last_;
};

}  // namespace wavecomb
