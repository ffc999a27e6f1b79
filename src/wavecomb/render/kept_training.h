// SPDX-License-Identifier: Apache-2.0
/// What was learned, kept for a later render, which then learns nothing again: as bytes, in a
/// checkpoint of a render that goes on; or as it is, where a scene is rendered once more.
#pragma once

#include <cstddef>
#include <functional>
#include <memory>
#include <span>
#include <vector>

#include "wavecomb/render/guide_training.h"
#include "wavecomb/scene/scene.h"

namespace wavecomb {

/// The bytes of a training: as many as the field has, and a few hundred. Empty where nothing was
/// learned, since the render is too short or was stopped before.
std::vector<std::byte> packed_training(const GuideTraining& training);

/// The training that packed_training() gave `bytes` of, for the same scene and size of the picture.
/// Throws Error where they are not such.
GuideTraining unpacked_training(std::span<const std::byte> bytes, const Scene& scene,
                                const Settings& settings);

/// The last training, for renders of the same scene with settings that lead to the same: seeds,
/// regions, layers and what never changes the picture may be others.
///
/// Contract: one thread at a time.
class GuideTrainingCache {
 public:
  /// train_guide(), or what it gave before.
  std::shared_ptr<const GuideTraining> get(const std::shared_ptr<const Scene>& scene,
                                           const WaveContext& context, const WaveSetup& waves,
                                           const std::function<bool()>& stopped);

 private:
  std::weak_ptr<const Scene> scene_;
  Settings settings_;
  std::shared_ptr<const GuideTraining> last_;
};

}  // namespace wavecomb
