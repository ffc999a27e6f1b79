// SPDX-License-Identifier: Apache-2.0
/// Renders a scene: passes of waves, progress, cancellation, statistics.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "wavecomb/core/settings.h"
#include "wavecomb/film/aov_film.h"
#include "wavecomb/film/deep_film.h"
#include "wavecomb/render/render_status.h"
#include "wavecomb/render/watch.h"

namespace wavecomb {

class Film;
class RayRecorder;
class Scene;
class SchedulingPolicy;
struct CostProfile;
struct LearnedPlace;
struct PassState;
struct Pick;
struct RenderStatistics;
struct SceneEdit;
struct Snapshot;

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
  DeepLayer deep{};
};

/// What a render may be given beside its settings. Callbacks are called on the thread that called
/// render(); what they throw ends it.
struct RenderOptions {
  /// Called every interval, and once at the end unless the render was cancelled.
  std::function<Request(const RenderStatus&)> progress{};
  /// Called where progress asked for it, and at the end in any case.
  std::function<void(const Snapshot&)> snapshot{};
  /// Fills the empty film and the pass with what a snapshot of a render with these settings held,
  /// and gives the packed_training() of that; empty: it is learned again.
  std::function<std::vector<std::byte>(Film&, PassState&)> resume{};
  /// packed_training() of a render of such a scene, which guides this one in place of what it would
  /// learn; empty: it learns. What resume() gives comes first.
  std::vector<std::byte> learned{};
  /// Replaces the one that the settings name.
  const SchedulingPolicy* policy = nullptr;
  /// Costs to start from, for the order and for roulette; what it does not know is measured on
  /// synthetic hits or modelled.
  const CostProfile* profile = nullptr;
  /// Gets the rays of the wavefront integrator; what it throws ends the render.
  RayRecorder* recorder = nullptr;
  double interval_s = 0.1;  ///< seconds between calls of progress
  /// For trials of light paths: splats bring no light, but what it would add to the variance of a
  /// pixel's samples were it left to camera paths, over scene_brightness() (light_vertex.h).
  bool wants_camera_squares = false;
  /// False: the picture is empty, for who took what it needs from snapshots. A stopped render of a
  /// large picture ends sooner then.
  bool wants_picture = true;
};

/// A scene ready to be rendered, and to be changed: its acceleration structure is built here, and
/// again only as far as edits ask for it.
///
/// Contract: render() may be called any number of times, one at a time; edit() between renders, and
/// both by one thread at a time. All else may be called by any thread at any time.
class WavefrontRenderer {
 public:
  /// `threads`: for building; 0: all.
  explicit WavefrontRenderer(std::shared_ptr<const Scene> scene, uint32_t threads = 0);
  ~WavefrontRenderer();

  /// Renders with `settings`. The picture depends on the scene and the picture's settings only, not
  /// on threads, wave size, lanes or policy, nor on whether the render was resumed; but with a time
  /// limit, on how many samples there was time for. Throws Error for settings that cannot be.
  Picture render(const Settings& settings, const RenderOptions& options = {});
  /// Ends the render that goes on, if there is one, within a wave; it returns what was done.
  void stop();

  /// Changes the scene: `scene()` is another one then, which shares what did not change. Throws
  /// Error for bad values, as Scene::edited does, and while a render goes on; nothing is changed
  /// then.
  void edit(const SceneEdit& change);
  /// Another renderer of the same scene, to be edited and run by itself. They share hierarchy and
  /// geometry.
  std::unique_ptr<WavefrontRenderer> twin() const;
  std::shared_ptr<const Scene> scene() const;
  /// Edits so far.
  uint64_t version() const;
  /// wavecomb::pick for the scene as it is.
  std::optional<Pick> pick(float x, float y, uint32_t width, uint32_t height) const;
  /// What the render that goes on, or else the last one, has learned of the surface that pick()
  /// finds. Nothing where there is none, or before anything was learned.
  std::optional<LearnedPlace> learned(float x, float y, uint32_t width, uint32_t height) const;

  /// packed_training() of the last render() that was not stopped before it began.
  std::vector<std::byte> packed_learned() const;

  /// Costs after the last render(); a copy, since the next render replaces them.
  CostProfile cost_profile() const;
  /// Statistics of the last render(); a copy likewise.
  RenderStatistics statistics() const;

 private:
  struct Impl;
  explicit WavefrontRenderer(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace wavecomb
