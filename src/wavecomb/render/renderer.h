// SPDX-License-Identifier: Apache-2.0
/// Renderer of a scene, with progress, cancellation and statistics.
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
struct LearnedData;
struct PassState;
struct Pick;
struct RenderStatistics;
struct SceneEdit;
struct Snapshot;

/// Names of the ids of one Cryptomatte level in an image.
struct CryptoManifest {
  std::string level;  ///< name of the AOV
  std::vector<std::pair<std::string, uint32_t>> names;
};

/// Rendered image: means over the samples, row 0 at the top. Layers that were not requested are
/// empty.
struct RenderedImage {
  uint32_t width = 0, height = 0;
  std::vector<float> beauty;  ///< rgb, linear Rec.709
  std::vector<float> albedo;  ///< rgb
  std::vector<float> normal;  ///< xyz in world space; mean of unit vectors
  std::vector<float> depth;   ///< along the camera's axis; infinite where rays leave the scene
  std::vector<uint32_t> samples;
  // The following layers are empty unless Settings::needs_error() is true.
  std::vector<float> error{};     ///< ErrorMap::error
  std::vector<float> variance{};  ///< rgb, Film::variance
  std::vector<AovLayer> aovs{};   ///< other layers of Settings::aovs
  std::vector<CryptoManifest> manifests{};
  DeepLayer deep{};
};
using Picture [[deprecated("use RenderedImage")]] = RenderedImage;

/// Callbacks and inputs of a render, in addition to its settings. The thread that called render()
/// calls the callbacks. An exception from a callback ends the render.
struct RenderOptions {
  /// Called every `interval_s`, and once at the end unless the render was cancelled.
  std::function<Request(const RenderStatus&)> progress{};
  /// Called if `progress` requests a snapshot, and always at the end.
  std::function<void(const Snapshot&)> snapshot{};
  /// Restores the empty film and the pass state from a snapshot of a render with these settings.
  /// Returns the packed_training() of that render, or nothing if this render is to train again.
  std::function<std::vector<std::byte>(Film&, PassState&)> resume{};
  /// packed_training() of an earlier render of the same scene, or of the render that is resumed.
  /// These data replace training and the choice of the transport. If empty, the render trains and
  /// chooses the transport itself. The result of resume() takes precedence for the training.
  std::vector<std::byte> learned{};
  /// Replaces the policy of the settings.
  const SchedulingPolicy* policy = nullptr;
  /// Initial costs for shading order and roulette. Costs that are not in the profile are measured
  /// on synthetic hits, or modelled.
  const CostProfile* profile = nullptr;
  /// Records the rays of the wavefront integrator. An exception from the recorder ends the render.
  RayRecorder* recorder = nullptr;
  double interval_s = 0.1;  ///< seconds between calls of `progress`
  /// If true, as in pilot renders with light paths, light splats hold variance instead of light.
  /// This is the variance that one sample of a pixel would have if camera paths had to find the
  /// light, divided by scene_brightness() (light_vertex.h).
  bool wants_camera_squares = false;
  /// If false, render() returns an empty image, for callers that use snapshots. Without the image,
  /// stopping a large render is faster.
  bool wants_picture = true;
};

/// Renderer of an editable scene. The constructor builds the acceleration structure, and an edit
/// rebuilds only the parts that it changes.
///
/// Contract: render() may be called any number of times, and edit() between renders, but only one
/// thread at a time may call them. Any thread may call the other functions at any time.
class WavefrontRenderer {
 public:
  /// `threads` is the number of threads for building; 0 means all.
  explicit WavefrontRenderer(std::shared_ptr<const Scene> scene, uint32_t threads = 0);
  ~WavefrontRenderer();

  /// Renders with `settings`. The image depends only on the scene and on the settings that affect
  /// the image, not on threads, wave size, lanes or policy, nor on whether the render was resumed.
  /// With a time limit, the image also depends on the number of samples rendered in that time.
  /// Throws Error for invalid settings.
  RenderedImage render(const Settings& settings, const RenderOptions& options = {});
  /// Stops the running render, if there is one, at the end of a wave. render() then returns the
  /// samples so far.
  void stop();

  /// Edits the scene: `scene()` returns a new scene afterwards, which shares all unchanged data
  /// with the old one. Throws Error, and leaves the scene unchanged, for invalid values (see
  /// Scene::edited) and during a render.
  void edit(const SceneEdit& change);
  /// Returns another renderer of the same scene, which can be edited and run independently. Both
  /// renderers share the acceleration structure and the geometry.
  std::unique_ptr<WavefrontRenderer> clone() const;
  [[deprecated("use clone()")]] std::unique_ptr<WavefrontRenderer> twin() const { return clone(); }
  std::shared_ptr<const Scene> scene() const;
  /// Returns the number of edits so far.
  uint64_t version() const;
  /// Finds the surface or light of the current scene at an image point (wavecomb::pick).
  std::optional<Pick> pick(float x, float y, uint32_t width, uint32_t height) const;
  /// Returns the learned data at the surface that pick() finds, from the running render or, if none
  /// is running, from the last render. Returns nothing if there is no surface or nothing was
  /// learned yet.
  std::optional<LearnedData> learned(float x, float y, uint32_t width, uint32_t height) const;

  /// Returns the packed_training() of the last render, unless it was stopped during its pilots.
  std::vector<std::byte> packed_learned() const;

  /// Returns a copy of the costs after the last render, since the next render replaces them.
  CostProfile cost_profile() const;
  /// Returns a copy of the statistics of the last render, since the next render replaces them.
  RenderStatistics statistics() const;

 private:
  struct Impl;
  explicit WavefrontRenderer(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace wavecomb
