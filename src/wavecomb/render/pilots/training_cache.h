// SPDX-License-Identifier: Apache-2.0
/// Reuse of a training and of the choice of the transport by later renders, which then skip their
/// pilot renders. The data is stored as bytes in a checkpoint, or in memory if a scene is rendered
/// again.
#pragma once

#include <cstddef>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "wavecomb/render/pilots/guiding_training.h"
#include "wavecomb/render/statistics/render_statistics.h"
#include "wavecomb/scene/scene.h"

namespace wavecomb {

/// Serializes a training and the choice of the transport, if there is one. The result has the size
/// of the guiding field plus a few hundred bytes, or no bytes if nothing was chosen or trained.
/// This happens if the settings fix the choice, if the render is too short, or if it was stopped.
std::vector<std::byte> packed_training(const GuidingTraining& training,
                                       const std::optional<TransportChoice>& transport);

/// Restores the training that packed_training() wrote, for the same scene and image size. Throws
/// Error if `bytes` are damaged or come from another version or build.
GuidingTraining unpacked_training(std::span<const std::byte> bytes, const Scene& scene,
                                  const Settings& settings);

/// Returns the choice of the transport that packed_training() wrote; Transport::kPath if there is
/// none. Throws Error if `bytes` are damaged or come from another version or build.
TransportChoice unpacked_transport(std::span<const std::byte> bytes);

/// Cache of the last choice of the transport. Renders of the same scene reuse the choice if their
/// settings lead to the same choice; seed, region and scheduling may differ.
///
/// Contract: one thread at a time.
class TransportChoiceCache {
 public:
  /// Returns the cached choice of the transport, or nothing.
  std::optional<TransportChoice> find(const std::shared_ptr<const Scene>& scene,
                                      const Settings& settings) const;
  void keep(const std::shared_ptr<const Scene>& scene, const Settings& settings,
            const TransportChoice& choice);

 private:
  std::weak_ptr<const Scene> scene_;
  Settings settings_;
  std::optional<TransportChoice> last_;
};

/// Cache of the last training. Renders of the same scene reuse the training if their settings lead
/// to the same training; seed, region, layers and scheduling may differ.
///
/// Contract: one thread at a time.
class GuidingTrainingCache {
 public:
  /// Returns the cached training, or calls train_guiding().
  std::shared_ptr<const GuidingTraining> get(const std::shared_ptr<const Scene>& scene,
                                             const TrainingInput& render,
                                             const std::function<bool()>& stopped);

 private:
  std::weak_ptr<const Scene> scene_;
  Settings settings_;
  CameraPathPart camera_;
  float light_share_ = 0;  ///< LightPathContext::share
  std::shared_ptr<const GuidingTraining> last_;
};

}  // namespace wavecomb
