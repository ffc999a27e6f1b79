// SPDX-License-Identifier: Apache-2.0
/// What a render can be told.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "wavecomb/core/aov.h"
#include "wavecomb/core/error.h"
#include "wavecomb/core/path_expression.h"

namespace wavecomb {

enum class SamplerKind : uint8_t { kSobol, kIndependent };
enum class FilterKind : uint8_t { kBox, kGaussian, kBlackmanHarris };

/// Full width of a filter in pixels where none is asked for: the box is the pixel itself; a
/// Gaussian of 3 (sigma 1/2) is pbrt's, a Blackman-Harris window of 3 is Cycles' default.
constexpr float default_filter_width(FilterKind kind) {
  return kind == FilterKind::kBox ? 1.f : 3.f;
}

enum class IntegratorKind : uint8_t { kWavefront, kReference };
/// Where paths begin: at the camera, or as many at the lights, too, joined by multiple importance
/// sampling (docs/light-paths.md). kAuto: the second where it pays (render/transport_choice.h).
/// kBdpt: the second, whose vertices are connected with each other, too.
enum class Transport : uint8_t { kPath, kLight, kAuto, kBdpt };
/// What becomes of samples that are so bright that too few of them are there to be trusted: they
/// stay, or count as far as they are (film/cascades.h).
enum class Firefly : uint8_t { kKeep, kReweight };
/// How the light is chosen that a vertex is lit by: by its power alone, or by tree for the vertex
/// (light/light_tree.h). kAuto: by tree where there are lights enough for it to pay.
enum class LightSelection : uint8_t { kAuto, kTree, kPower };
/// What shares of the choice lights have: by what they bring to the picture, as a calibration finds
/// before the first pass (render/light_calibration.h), or by power.
enum class LightWeights : uint8_t { kCalibrated, kPower };
/// How paths end early (integrate/steps/survive.h). kAuto: kEfficient where bounces are guided,
/// else kThroughput.
enum class RouletteKind : uint8_t { kAuto, kOff, kThroughput, kCostAware, kEfficient };
/// Order of rays before traversal.
enum class RayOrder : uint8_t { kSlot, kMorton, kMortonOctant, kDirection, kAuto };
/// Where costs of materials come from. kAuto: measured for the order of shading, the fixed model
/// for roulette, so that pictures are reproducible.
enum class CostSource : uint8_t { kAuto, kMeasured, kModel };
/// How rays are given to the accelerator: in packets, or each alone.
enum class Traversal : uint8_t { kPackets, kSingle };
/// How textures are filtered. kAuto: whole where the camera sees them, by one texel after bounces
/// (docs/decisions/one-texel.md).
enum class TextureFilter : uint8_t { kAuto, kWhole };
/// How a render's samples are allotted to pixels (render/allotment.h).
enum class Allocate : uint8_t { kEven, kError, kEfficiency };
/// Whether bounces are guided by a field that paths before the first pass have taught
/// (render/guide_training.h). kAuto: where it pays.
enum class Guiding : uint8_t { kAuto, kOn, kOff };
enum class Materialize : uint8_t { kAuto, kOn, kOff };

/// Largest picture.
inline constexpr uint32_t kMaxSize = 65535;
inline constexpr uint32_t kMaxPixels = 1u << 28;

/// Pixels x0 to x1 - 1 of rows y0 to y1 - 1, row 0 at the top.
struct Region {
  uint32_t x0 = 0, y0 = 0, x1 = 0, y1 = 0;

  bool contains(uint32_t x, uint32_t y) const { return x >= x0 && x < x1 && y >= y0 && y < y1; }
  uint32_t width() const { return x1 - x0; }
  uint32_t height() const { return y1 - y0; }
  uint64_t pixels() const { return uint64_t{width()} * height(); }
  bool operator==(const Region&) const = default;
  /// Number of a pixel of it, row by row.
  size_t index(uint32_t x, uint32_t y) const { return size_t{y - y0} * width() + (x - x0); }
};

/// Settings of a render. The picture depends on those above the line only.
struct Settings {
  uint32_t width = 600, height = 600;  ///< pixels
  uint32_t spp = 64;                   ///< samples per pixel, 1 to 2^20
  uint32_t max_depth = 8;              ///< scattering vertices of a path; 0 sees emitters only
  uint32_t seed = 0;
  SamplerKind sampler = SamplerKind::kSobol;
  FilterKind filter = FilterKind::kBlackmanHarris;
  std::optional<float> filter_width;  ///< full width in pixels; without: the filter's own
  RouletteKind roulette = RouletteKind::kAuto;
  uint32_t roulette_depth = 2;  ///< first vertex after which a path may end
  /// Costs decide over the picture through cost-aware roulette only, and then kMeasured makes it
  /// vary.
  CostSource costs = CostSource::kAuto;
  float clamp_indirect = 0;  ///< largest luminance of one indirect contribution; 0: off
  bool schlick_fresnel = false;
  TextureFilter texture_filter = TextureFilter::kAuto;
  LightSelection light_selection = LightSelection::kAuto;
  LightWeights light_weights = LightWeights::kCalibrated;
  Guiding guiding = Guiding::kOff;
  /// Distances in even volumes are chosen by lamps, too (medium/equiangular.h).
  bool equiangular = false;
  uint32_t learn_memory_mb = 64;  ///< that what is learned may take
  /// Sample every non-delta bounce by cosine (the dissertation's way).
  bool cosine_sampling = false;
  IntegratorKind integrator = IntegratorKind::kWavefront;
  Transport transport = Transport::kPath;
  /// Paths from lights go where others before the first pass have brought something
  /// (render/light_aiming.h).
  bool light_aim = true;
  /// Pixels, within which paths from lights end at what the camera sees in mirrors and through
  /// glass (integrate/visible_points.h); 0: they never do.
  float merge_radius = 0;
  Firefly firefly = Firefly::kKeep;
  AovSet aovs;  ///< to be kept beside the beauty, which they do not change
  std::vector<std::string> light_groups;          ///< of Aov::kLightGroups, by name; empty: all
  std::vector<NamedExpression> expressions;       ///< of Aov::kExpressions
  uint32_t deep_samples = DeepLimits{}.most;      ///< of Aov::kDeep: the most of a pixel
  float deep_tolerance = DeepLimits{}.tolerance;  ///< of Aov::kDeep
  /// Adaptive sampling: a pixel is done when its error is no larger (ErrorMap::error); 0: off.
  float adaptive = 0;
  /// Adaptive sampling until the picture's mean relative error is no larger; 0: off. Not both.
  float noise = 0;
  uint32_t min_spp = 16;  ///< adaptive: before the first look at errors; spp is the most
  /// How samples are allotted where spp, or a time limit, says how many there are in all.
  Allocate allocate = Allocate::kEven;
  /// The most seconds that rendering may take; 0: no limit. What is done by then is the picture.
  float time_limit = 0;
  /// The camera itself sees no domes and distant lights, so that the picture goes over another.
  bool alpha = false;
  bool error = false;  ///< keep errors and variances where nothing else asks for them
  /// The pixels that are rendered; all others have no samples. Without: all. A pixel of it is the
  /// same as in the whole picture, but in adaptive renders, which see errors within it only.
  std::optional<Region> region;
  /// Pixels along each edge beyond what the camera's window shows; width and height are with them.
  uint32_t overscan = 0;
  bool crop = false;  ///< the film, and so the picture, is of the region alone
  // ---- below: how it is computed; never changes the picture ----
  uint32_t threads = 0;    ///< 0: all that the process may use
  uint32_t wave_size = 0;  ///< paths per wave, 64 to 2^20; 0: default
  uint32_t lanes = 0;      ///< 1, 4, 8, 16; 0: widest built
  /// Packets are faster; both find the same hits, to the bit (docs/decisions/canonical-hits.md).
  Traversal traversal = Traversal::kPackets;
  std::string policy = "code";
  Materialize materialize = Materialize::kAuto;  ///< kAuto: gather by index, which measures faster
  RayOrder ray_order = RayOrder::kAuto;          ///< of bounce rays
  RayOrder shadow_order = RayOrder::kAuto;       ///< of shadow rays
  /// Passes of 1, 1, 2, 4 ... samples a pixel, so that the whole picture is there soon.
  bool progressive = false;
  float cost_weight = 0.3f;  ///< of a pass's measurement in the moving average, 0 to 1

  float used_filter_width() const { return filter_width.value_or(default_filter_width(filter)); }
  bool joins_light() const { return transport == Transport::kLight || connects(); }
  /// Whether vertices of camera paths connect to those of paths from lights.
  bool connects() const { return transport == Transport::kBdpt; }
  /// Whether paths from lights end at what is seen in mirrors and through glass.
  bool merges() const { return transport == Transport::kLight && merge_radius > 0; }
  bool is_adaptive() const { return adaptive > 0 || noise > 0; }
  /// Pixels that are rendered.
  Region rendered() const { return region.value_or(Region{0, 0, width, height}); }
  /// Pixels that the film has.
  Region film() const { return crop ? rendered() : Region{0, 0, width, height}; }
  bool allots() const { return allocate != Allocate::kEven; }
  bool keeps_error() const { return error || is_adaptive() || allots(); }
  /// Throws Error naming the option and what it may be.
  void check() const;
  bool operator==(const Settings&) const = default;
};

/// What of some settings paths from lights do not go with, and what to give in its place; empty:
/// there is nothing.
struct LightPathRefusal {
  std::string what, instead;
};
LightPathRefusal light_path_refusal(const Settings& settings);
/// What to throw where there is something; `settings` join light.
Error light_path_error(const Settings& settings, const LightPathRefusal& refusal);

}  // namespace wavecomb
