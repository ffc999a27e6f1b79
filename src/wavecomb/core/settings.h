// SPDX-License-Identifier: Apache-2.0
/// Settings of a render.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "wavecomb/core/aov.h"
#include "wavecomb/core/error.h"
#include "wavecomb/core/path_expressions/path_expression.h"
#include "wavecomb/core/settings_choices.h"

namespace wavecomb {

/// Settings of a render. The members below the separator line do not change the image.
struct Settings {
  uint32_t width = 600, height = 600;  ///< pixels
  uint32_t spp = 64;                   ///< samples per pixel, 1 to 2^20
  uint32_t max_depth = 8;              ///< scattering events per path; 0 shows emitters only
  uint32_t seed = 0;
  SamplerKind sampler = SamplerKind::kSobol;
  FilterKind filter = FilterKind::kBlackmanHarris;
  /// Full width of the pixel filter in pixels. If not set, `default_filter_width` gives the width.
  std::optional<float> filter_width;
  RouletteKind roulette = RouletteKind::kAuto;
  uint32_t roulette_depth = 2;  ///< first vertex at which Russian roulette may terminate a path
  /// Whether Russian roulette decides if light samples of low contribution get a shadow ray. See
  /// `saves_shadow_rays()`.
  bool shadow_roulette = true;
  /// Source of material costs. Costs change the image only through cost-aware roulette; with
  /// `kMeasured` costs, such an image varies from run to run.
  CostSource costs = CostSource::kAuto;
  float clamp_indirect = 0;  ///< maximum luminance of an indirect contribution; 0 means no limit
  bool schlick_fresnel = false;
  TextureFilter texture_filter = TextureFilter::kAuto;
  LightSelection light_selection = LightSelection::kAuto;
  LightWeights light_weights = LightWeights::kCalibrated;
  Guiding guiding = Guiding::kAuto;
  /// Whether distances in homogeneous volumes are also sampled by equiangular sampling
  /// (medium/volume/equiangular.h).
  bool equiangular = false;
  Quality quality = Quality::kAuto;
  uint32_t learn_memory_mb = 64;  ///< memory limit of training data, in MB
  /// Whether the directions of all bounces except delta bounces are sampled from a cosine
  /// distribution.
  bool cosine_sampling = false;
  IntegratorKind integrator = IntegratorKind::kWavefront;
  Transport transport = Transport::kAuto;
  /// Whether light paths are aimed at regions where light paths of a training render before the
  /// first pass contributed to the image (light_paths/render/light_aiming.h).
  bool light_aim = true;
  LightSplats light_splats = LightSplats::kAuto;
  /// Merge radius in pixels, within which light paths end at points that the camera sees by
  /// specular reflection or refraction (light_paths/merge_grid.h). 0 means no merging, except where
  /// Transport::kAuto chooses it.
  float merge_radius = 0;
  /// Whether Transport::kAuto may merge within one pixel (light_paths/render/transport_choice.h).
  bool auto_merge = true;
  Firefly firefly = Firefly::kKeep;
  /// AOVs to store. They do not change the beauty, except through LightSplats::kAuto.
  AovSet aovs;
  /// Names of the light groups that `Aov::kLightGroups` stores. An empty list means all light
  /// groups.
  std::vector<std::string> light_groups;
  std::vector<NamedExpression> expressions;  ///< for Aov::kExpressions
  uint32_t deep_samples =
      DeepLimits{}.most;  ///< maximum number of samples in a pixel of the deep image
  float deep_tolerance = DeepLimits{}.tolerance;  ///< depth tolerance of deep images
  /// Error limit for adaptive sampling: sampling of a pixel stops when the pixel's error
  /// (`ErrorMap::error`) is at most this value. 0 means no limit.
  float adaptive = 0;
  /// Error limit of the whole image: the render stops when the mean relative error of the image is
  /// at most this value. 0 means no limit. This setting cannot be combined with `adaptive`.
  float noise = 0;
  uint32_t min_spp = 16;  ///< samples per pixel before the first error estimate of adaptive
                          ///< sampling
  /// Distribution of samples over pixels in renders whose total sample count is set by spp or a
  /// time limit.
  Allocate allocate = Allocate::kEven;
  /// Time limit of rendering in seconds. The image then consists of the samples that were
  /// completed. 0 means no limit.
  float time_limit = 0;
  /// Whether dome lights and distant lights are transparent to the camera, for compositing.
  bool alpha = false;
  bool error = false;  ///< whether to store error and variance estimates even if no other setting
                       ///< needs them
  /// Pixels to render; other pixels get no samples. If not set, all pixels are rendered. Rendered
  /// pixels have the same values as in a render of the whole image, except in adaptive renders,
  /// which estimate errors within the region only.
  std::optional<Region> region;
  /// Number of pixels that are added outside of the camera window at each edge. `width` and
  /// `height` include these pixels.
  uint32_t overscan = 0;
  bool crop = false;  ///< whether the film and the image contain only the pixels of `region`
  // ---- below: how the image is computed; never changes it ----
  uint32_t threads = 0;    ///< number of threads; 0 means all threads that the process may use
  uint32_t wave_size = 0;  ///< paths per wave, 64 to 2^20; 0 means the default
  /// Lane width of kernels: 1, 4, 8 or 16; 0 means the largest width in the build.
  uint32_t lanes = 0;
  /// Whether rays are traced in packets, which are faster than single rays and find bit-identical
  /// hits (docs/decisions/canonical-hits.md).
  Traversal traversal = Traversal::kPackets;
  std::string policy = "code";
  /// Whether queued hits are moved in memory into shading order; `kAuto` means `kOff`.
  Materialize materialize = Materialize::kAuto;
  RayOrder ray_order = RayOrder::kAuto;     ///< for bounce rays
  RayOrder shadow_order = RayOrder::kAuto;  ///< for shadow rays
  /// Whether the first passes have 1, 1, 2, 4, ... samples per pixel, so that a first version of
  /// the whole image appears soon.
  bool progressive = false;
  float cost_weight = 0.3f;  ///< weight of a pass in the moving average of costs, 0 to 1

  float used_filter_width() const { return filter_width.value_or(default_filter_width(filter)); }
  bool joins_light() const { return transport == Transport::kLight || connects(); }
  /// Returns whether vertices of camera paths are connected to vertices of light paths.
  bool connects() const { return transport == Transport::kBdpt; }
  /// Returns whether light paths are merged with points that the camera sees by specular reflection
  /// or refraction.
  bool merges() const { return transport == Transport::kLight && merge_radius > 0; }
  /// Returns whether Russian roulette decides about shadow rays. Its threshold depends on the
  /// brightness of the image, which the calibration of light weights estimates.
  bool saves_shadow_rays() const {
    return shadow_roulette && roulette != RouletteKind::kOff &&
           light_weights == LightWeights::kCalibrated;
  }
  bool splats_to_one_pixel() const {
    return light_splats == LightSplats::kPixel ||
           (light_splats == LightSplats::kAuto && aovs.has(AovSource::kGuide));
  }
  bool is_adaptive() const { return adaptive > 0 || noise > 0; }
  /// Returns the pixels that are rendered.
  Region rendered() const { return region.value_or(Region{0, 0, width, height}); }
  /// Returns the pixels of the film.
  Region film() const { return crop ? rendered() : Region{0, 0, width, height}; }
  bool allocates_samples() const { return allocate != Allocate::kEven; }
  bool needs_error() const { return error || is_adaptive() || allocates_samples(); }
  [[deprecated("use allocates_samples()")]] bool allots() const { return allocates_samples(); }
  [[deprecated("use needs_error()")]] bool keeps_error() const { return needs_error(); }
  /// Throws an `Error` that names the option and its valid values if a setting is invalid.
  void check() const;
  bool operator==(const Settings&) const = default;
};

/// Setting that cannot be combined with light paths, and the value to use instead. `what` is empty
/// if there is no such setting.
struct LightPathConflict {
  std::string what, instead;
};
using LightPathRefusal [[deprecated("use LightPathConflict")]] = LightPathConflict;
/// Returns the first setting of `settings` that cannot be combined with light paths. `what` of the
/// result is empty if there is none.
LightPathConflict light_path_conflict(const Settings& settings);
[[deprecated("use light_path_conflict()")]] inline LightPathConflict light_path_refusal(
    const Settings& settings) {
  return light_path_conflict(settings);
}
/// Returns an `Error` with a message for a setting that cannot be combined with light paths.
/// `settings` must use light paths.
Error light_path_error(const Settings& settings, const LightPathConflict& conflict);

}  // namespace wavecomb
