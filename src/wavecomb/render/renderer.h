// SPDX-License-Identifier: Apache-2.0
/// Renders a scene: passes of waves, progress, cancellation, statistics.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <vector>

#include "wavecomb/core/settings.h"
#include "wavecomb/film/aov_film.h"
#include "wavecomb/film/film.h"
#include "wavecomb/integrate/ray_recorder.h"
#include "wavecomb/render/pass_loop.h"
#include "wavecomb/render/process_memory.h"
#include "wavecomb/render/render_statistics.h"
#include "wavecomb/scene/scene.h"
#include "wavecomb/schedule/policy.h"

namespace wavecomb {

/// Names of the ids of one Cryptomatte level that a picture holds.
struct CryptoManifest {
  std::string level;  ///< name of the AOV
  std::vector<std::pair<std::string, uint32_t>> names;
};

/// A picture: means over the samples, row 0 at the top. What was not asked for is empty.
struct Picture {
  uint32_t width = 0, height = 0;
  std::vector<float> beauty;  ///< rgb, linear Rec.709
  std::vector<float> albedo;  ///< rgb
  std::vector<float> normal;  ///< xyz, world space, mean of unit vectors
  std::vector<float> depth;   ///< along the camera's axis; infinite where nothing was hit
  std::vector<uint32_t> samples;
  // Empty unless Settings::keeps_error():
  std::vector<float> error{};     ///< ErrorMap::error
  std::vector<float> variance{};  ///< rgb, Film::variance
  std::vector<AovLayer> aovs{};   ///< further layers that Settings::aovs asks for
  std::vector<CryptoManifest> manifests{};
};

/// A render that stands still. Valid while the callback that gets it runs.
struct Snapshot {
  Film& film;
  const PassState& pass;
  RenderStatus status;
  bool finished;  ///< done, cancelled or out of time: there is no more to come
};

/// What a render may be given beside its settings. Callbacks are called on the thread that called
/// render(); what they throw ends it.
struct RenderOptions {
  /// Called some ten times a second, and once at the end unless the render was cancelled.
  std::function<Request(const RenderStatus&)> progress{};
  /// Called where progress asked for it, and at the end in any case.
  std::function<void(const Snapshot&)> snapshot{};
  /// Fills the empty film and the pass with what a snapshot of a render with these settings held.
  std::function<void(Film&, PassState&)> resume{};
  /// Replaces the one that the settings name.
  const SchedulingPolicy* policy = nullptr;
  /// Costs to start from, for the order and for roulette; without, they are measured on synthetic
  /// hits or modelled.
  const CostProfile* profile = nullptr;
  /// Gets the rays of the wavefront integrator; what it throws ends the render.
  RayRecorder* recorder = nullptr;
};

/// A scene ready to be rendered: its acceleration structure is built here, once.
///
/// Contract: render() may be called any number of times, one at a time.
class WavefrontRenderer {
 public:
  /// `threads`: for building; 0: all.
  explicit WavefrontRenderer(std::shared_ptr<const Scene> scene, uint32_t threads = 0);
  ~WavefrontRenderer();

  /// Renders with `settings`. The picture depends on the scene and the picture's settings only, not
  /// on threads, wave size, lanes or policy, nor on whether the render was resumed; but with a time
  /// limit, on how many samples there was time for. Throws Error for settings that cannot be.
  Picture render(const Settings& settings, const RenderOptions& options = {});
  /// Costs after the last render().
  const CostProfile& cost_profile() const;
  /// Of the last render().
  const RenderStatistics& statistics() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace wavecomb
