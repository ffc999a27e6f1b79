// SPDX-License-Identifier: Apache-2.0
/// `LightPathPlan` and `LightPathPasses`, which plan the light paths of a render and of each pass
/// (render/joint_transport.h).
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "wavecomb/core/settings.h"
#include "wavecomb/film/error/error_map.h"
#include "wavecomb/film/film.h"
#include "wavecomb/film/splats/light_splat_filter.h"
#include "wavecomb/light_paths/context.h"
#include "wavecomb/light_paths/merge_grid.h"
#include "wavecomb/light_paths/setup.h"
#include "wavecomb/render/passes/pass_plan.h"
#include "wavecomb/scene/scene.h"

namespace wavecomb {

struct LightAiming;
struct RenderStatistics;

/// Plan of the light paths of a render; empty if the settings do not use light paths.
///
/// Contract: scene and settings outlive the plan, and the plan outlives the contexts made from it.
class LightPathPlan {
 public:
  /// `filter` is the pixel filter of the camera. Throws Error if the settings use light paths, but
  /// the scene does not support them.
  LightPathPlan(const Scene& scene, const Settings& settings, LightPathShare share,
                const CameraSetup& camera, const FilterTable& filter);

  /// Returns the samples per pixel of a pass. `samples` is the number that the pass would have
  /// without light paths.
  static uint32_t pass_samples(const Settings& settings, uint32_t samples);
  /// Allocates the sums of light path contributions and the merge points of an empty film.
  void allocate(Film& film) const;
  /// Creates the light path data that all waves of the render read. `grid` is from LightPathPasses.
  LightPathContext context(const MergeGrid* grid) const;
  LightPathShare share() const { return share_; }
  /// Makes the light splats of a render hold variances instead of radiance
  /// (LightPathContext::camera_squares).
  void measure_squares(LightPathContext& context) const;
  /// Adds the statistics of light paths. `aiming` is null if light paths are not aimed.
  void report(const LightAiming* aiming, RenderStatistics& statistics) const;

 private:
  const Scene& scene_;
  const Settings& settings_;
  LightPathShare share_;
  LightSplatFilter filter_;
  /// Names of the lights that emit no light paths, for the statistics.
  std::vector<std::string> lights_without_paths_;
};

/// Returns the number of samples of each light path at the end of a pass.
///
/// `done` is the number of samples of light paths so far. `before` and `after` are the sample
/// counts of pixels at the start and the end of the pass. `share` is the maximum number of samples
/// of light paths, which follows from the render's ratio of light paths to camera paths.
/// `active_share` is |A| / P below.
///
/// With |A| active pixels, a pass traces |A| (after - before) camera paths. Each sample of the P
/// light paths traces P paths. If V_c and V_l are the variances of one sample of camera paths and
/// light paths, n samples of pixels and m samples of light paths have the error V_c / n + V_l / m.
/// For a given cost, the error is least if
///   m / n = sqrt(V_l |A| / (V_c P)).
/// Both variances are estimated from half buffers over the active pixels. The number of light path
/// samples is limited to `share`, because a larger number would require different MIS weights. The
/// number of samples depends only on earlier passes, so the image stays unbiased.
uint32_t light_samples_after(const NoiseParts& noise, uint32_t done, uint32_t before,
                             uint32_t after, uint32_t share, double active_share);

/// Light paths of the passes of a render. Each pass traces light paths after its camera paths.
///
/// Contract: only one thread uses the object at a time.
class LightPathPasses {
 public:
  explicit LightPathPasses(const LightPathPlan& plan, const Settings& settings);

  /// Returns the grid of merge points, for LightPathPlan::context(), or null if the render has no
  /// merging.
  const MergeGrid* grid() const { return grid_.get(); }
  /// Returns the number of samples of each light path if each pixel has `samples` samples.
  uint32_t samples(uint32_t samples) const { return share_.samples(samples); }
  /// Returns the number of samples of each light path after a pass of an adaptive render. `done`
  /// and `light_done` are the samples of pixels and of light paths before the pass. `pass` holds
  /// the active pixels of the pass and their target sample count; `active` is their number.
  uint32_t adaptive_samples(const Film& film, const PassState& pass, uint32_t done,
                            uint32_t light_done, uint64_t active) const;
  /// Plans the light paths that a pass still has to trace, until each has `target` samples. The
  /// plan is empty if the render has no light paths.
  PassPlan plan(const Film& film, uint32_t target) const;
  /// Prepares the light paths of a pass. Call this function after the camera paths of the pass are
  /// finished.
  void begin(const Film& film);

 private:
  const Settings& settings_;
  LightPathShare share_;
  /// Light path numbers, stored as pixel coordinates in Morton order.
  std::vector<uint32_t> order_;
  std::unique_ptr<MergeGrid> grid_;
};

}  // namespace wavecomb
