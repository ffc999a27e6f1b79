// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/light_paths/render/transport_choice.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "wavecomb/core/clock.h"
#include "wavecomb/core/path_expressions/backward_automaton.h"
#include "wavecomb/material/lobes/ggx.h"
#include "wavecomb/wave/wave.h"

namespace wavecomb {
namespace {

/// Limits of the number of pixels of a pilot render.
constexpr uint64_t kMinTransportPixels = 400, kMaxTransportPixels = 16'384;
/// A pilot render takes one sample for every kTransportShare samples of the render. There are at
/// least four pilot renders, and at most ten if merging is considered. Together they take 2 % of
/// the render time on average.
constexpr uint64_t kTransportShare = 1000;
constexpr std::array<uint32_t, 2> kTransportSeeds = {0x3c6ef372u, 0xa54ff53au};
/// Minimum predicted gain in efficiency for which light paths are used.
constexpr double kMinLightPathGain = 1.3;
/// Gains of the larger ratio predicted from the smaller one are correct to within this factor.
constexpr double kPredictionFactor = 1.5;
/// Minimum fraction of missed light for which the noise of this light is estimated.
constexpr double kMinMissed = 0.1;
/// Minimum predicted gain of merging over renders without light paths, and over light paths without
/// merging.
constexpr double kMinMergingGain = 2;
/// Roughness below which a lobe is sharp enough for visible caustics.
constexpr float kSharpRoughness = 0.4f;

/// Returns the width and height of a pilot render for a render with settings `s`, or 0 if its
/// number of samples is too small.
std::array<uint32_t, 2> pilot_size(const Settings& s, uint64_t samples) {
  const uint64_t pixels = std::min({samples / kTransportShare / kTransportSamples,
                                    kMaxTransportPixels, uint64_t{s.width} * s.height});
  if (pixels < kMinTransportPixels) return {0, 0};
  const double shrink = std::sqrt(static_cast<double>(pixels) / (double{1} * s.width * s.height));
  const auto side = [&](uint32_t full) {
    return std::max(1u, static_cast<uint32_t>(std::lround(full * shrink)));
  };
  return {side(s.width), side(s.height)};
}

/// Returns the settings of the pilot renders, which trace light paths and store only the layers
/// that the choice needs.
Settings pilot_settings(const Settings& settings, uint32_t width, uint32_t height) {
  Settings small = settings;
  small.width = width;
  small.height = height;
  small.spp = kTransportSamples;
  small.overscan = static_cast<uint32_t>(uint64_t{small.overscan} * width / settings.width);
  small.region.reset();
  small.crop = false;
  small.time_limit = 0;
  small.firefly = Firefly::kKeep;
  small.adaptive = small.noise = 0;
  small.allocate = Allocate::kEven;
  small.error = false;
  small.costs = CostSource::kModel;
  small.light_splats =
      settings.splats_to_one_pixel() ? LightSplats::kPixel : LightSplats::kFiltered;
  small.aovs.bits = static_cast<uint32_t>(Aov::kByLightPaths);
  small.light_groups.clear();
  small.expressions.clear();
  small.transport = Transport::kLight;
  // Guiding is decided after the transport.
  small.guiding = Guiding::kOff;
  return small;
}

/// Returns whether a lobe of the given roughness is sharp. Returns true if the roughness varies,
/// since the lobe may be sharp at some points.
bool is_sharp(float roughness, bool varies) {
  return varies || roughness < kSharpRoughness;
}

/// Returns whether `is_low(roughness, varies)` for a lobe of the base or the clearcoat of `m`, or
/// whether a graph drives the material.
template <typename IsLow>
bool may_have_lobe(const Material& m, const IsLow& is_low) {
  const bool coats = m.clearcoat > 0 || m.has_texture(Input::kClearcoat);
  return has_trait(m.program, program_trait::kGlossy) &&
         (m.graph != kNoGraph || is_low(m.roughness, m.has_texture(Input::kRoughness)) ||
          (coats && is_low(m.clearcoat_roughness, m.has_texture(Input::kClearcoatRoughness))));
}

}  // namespace

bool focuses_light(const Scene& scene) {
  return std::ranges::any_of(scene.materials(), [](const Material& m) {
    const bool transmits =
        has_trait(m.program, program_trait::kGlossy) && m.openpbr.transmission_weight > 0;
    return has_trait(m.program, program_trait::kGlass) || transmits || may_have_lobe(m, is_sharp);
  });
}

namespace {

/// Returns whether the camera may see caustics in a mirror or through glass, where camera paths
/// have only delta bounces.
bool shows_caustics(const Scene& scene) {
  const auto is_smooth = [](float roughness, bool varies) {
    return varies || alpha_from_roughness(roughness) < kDeltaAlpha;
  };
  return std::ranges::any_of(scene.materials(),
                             [&](const Material& m) { return may_have_lobe(m, is_smooth); });
}

/// Makes pilot renders that share all settings except seed, transport and merging.
class PilotRenders {
 public:
  PilotRenders(const Settings& small, const RenderPilot& render) : small_(small), render_(render) {
    pilots_.width = small.width;
    pilots_.merges = small.merge_radius > 0;
  }

  /// Renders the images without light paths.
  void add_path() {
    Settings path = small_;
    path.transport = Transport::kPath;
    path.merge_radius = 0;
    path.aovs.bits = 0;
    pilots_.path = both(path, kCandidateShares[0]);
  }
  /// Copies the images without light paths from `other`, to avoid rendering them again.
  void add_path(const PilotRenders& other) { pilots_.path = other.pilots_.path; }

  /// Renders the images of the ratio with index `ratio` in kCandidateShares.
  void add(size_t ratio) { pilots_.with[ratio] = both(small_, kCandidateShares[ratio]); }

  /// Renders the image of variances, unless camera paths find nearly all light that light paths
  /// find. `unit` is the brightness of the scene.
  void add_variance(double unit) {
    if (missed_light(pilots_) < kMinMissed) return;
    small_.seed = kTransportSeeds[0];
    const std::vector<float> rgb = render_(small_, kCandidateShares.back(), true).by_light_paths;
    for (size_t i = 0; i + 2 < rgb.size(); i += 3)
      pilots_.variance.push_back(unit *
                                 double{luminance(Vec3<float>{rgb[i], rgb[i + 1], rgb[i + 2]})});
  }

  const TransportPilots& pilots() const { return pilots_; }

 private:
  std::array<TransportPilot, 2> both(Settings settings, LightPathShare share) const {
    std::array<TransportPilot, 2> out;
    for (size_t i = 0; i < out.size(); ++i) {
      settings.seed = kTransportSeeds[i];
      out[i] = render_(settings, share, false);
    }
    return out;
  }

  Settings small_;
  const RenderPilot& render_;
  TransportPilots pilots_;
};

}  // namespace

TransportChoice choose_transport(const Scene& scene, const Settings& settings, uint64_t samples,
                                 const RenderPilot& render, const std::function<bool()>& stopped) {
  const Clock::time_point start = Clock::now();
  TransportChoice choice;
  const auto reject = [&](const LightPathConflict& conflict) {
    if (!conflict.what.empty()) choice.why = "light paths do not go with " + conflict.what;
    return !conflict.what.empty();
  };
  if (settings.max_depth == 0) {
    choice.why = "no light is scattered at a maximum depth of 0";
    return choice;
  }
  if (reject(light_path_conflict(settings)) || reject(light_path_conflict(scene))) return choice;
  try {
    (void)BackwardAutomaton(PathAutomaton(settings.expressions, scene.light_groups()));
  } catch (const Error&) {
    choice.why = "light paths have no room for so many light path expressions";
    return choice;
  }
  if (!focuses_light(scene)) {
    choice.why = "nothing in the stage is clear or glossy";
    return choice;
  }
  if (!emits_paths(scene)) {
    choice.why = "no light sends paths";
    return choice;
  }
  const auto [width, height] = pilot_size(settings, samples);
  if (width == 0) {
    choice.why = "too few samples to find out whether light paths pay";
    return choice;
  }
  const double unit = scene_brightness(scene);
  const double pixels = double{1} * settings.width * settings.height;
  const double longer = static_cast<double>(samples) / pixels / kTransportSamples;
  constexpr size_t kMost = kCandidateShares.size() - 1;
  const auto is_late = [&] {
    choice.seconds = seconds_since(start);
    if (stopped()) choice.why = "a trial took too much of the time limit";
    return stopped();
  };
  PilotRenders unmerged(pilot_settings(settings, width, height), render);
  unmerged.add_path();
  unmerged.add(0);
  if (is_late()) return choice;
  unmerged.add_variance(unit);
  if (kPredictionFactor * possible_gain(unmerged.pilots(), longer) >= kMinLightPathGain)
    unmerged.add(kMost);
  if (is_late()) return choice;
  TransportGain found = transport_gain(unmerged.pilots(), longer);
  Settings merging = settings;
  merging.merge_radius = 1.f;
  if (settings.auto_merge && settings.merge_radius == 0 && shows_caustics(scene) &&
      light_path_conflict(merging).what.empty()) {
    PilotRenders merged(pilot_settings(merging, width, height), render);
    merged.add_path(unmerged);
    merged.add(kMost);
    if (is_late()) return choice;
    merged.add_variance(unit);
    if (is_late()) return choice;
    const TransportGain by_merging = transport_gain(merged.pilots(), longer);
    choice.merges =
        by_merging.gain >= kMinMergingGain && merging_gain(by_merging, found) >= kMinMergingGain;
    if (choice.merges) found = by_merging;
  }
  choice.gain = found.gain;
  choice.why =
      "by a trial of " + std::to_string(width) + " x " + std::to_string(height) + " pixels";
  if (found.gain >= kMinLightPathGain) {
    choice.transport = Transport::kLight;
    choice.share = found.share;
    choice.camera = found.camera;
  }
  choice.seconds = seconds_since(start);
  return choice;
}

}  // namespace wavecomb
