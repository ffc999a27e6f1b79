// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/render/transport_choice.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>

#include "wavecomb/core/backward_automaton.h"
#include "wavecomb/core/clock.h"

namespace wavecomb {
namespace {

/// Samples of a pixel of a trial, which Sobol's points and roulette are in as they are in the
/// picture, and pixels of it at least and at most.
constexpr uint32_t kTransportSamples = 8;
constexpr uint64_t kLeastTransportPixels = 576, kMostTransportPixels = 16'384;
/// Of the samples of a render, a trial has a pixel's: four pictures, of which two cost three times
/// as much, are then a fiftieth of the render at most.
constexpr uint64_t kTransportShare = 400;
constexpr std::array<uint32_t, 2> kTransportSeeds = {0x3c6ef372u, 0xa54ff53au};
/// Cost of a vertex in rays, and of one whose kernels know of light paths, for which there are no
/// least variants of programs.
constexpr double kPathVertex = 0.7, kJointVertex = 1.2;
/// Efficiency that light paths must promise.
constexpr double kWorthwhileLight = 1.3;
/// Below this a material's lobe is sharp enough for light that it sends on to be seen.
constexpr float kSharpRoughness = 0.4f;
/// Differences of pictures, over their variance, that are not noise: where there are as many cells
/// as the smallest trial has pixels, and the more the fewer they are, down to the least that tell.
constexpr double kMissed = 0.25;
constexpr size_t kLeastCells = 64;
/// Samples, in those of a trial, for which light that is missed counts.
constexpr double kMostLonger = 16;
constexpr int kMostShare = 2;  ///< exponent of the share of light paths, and its negative

/// Width and height of a trial of as many pixels as a render of `settings` bears; 0: of none.
std::array<uint32_t, 2> trial_size(const Settings& s) {
  const uint64_t samples = uint64_t{s.width} * s.height * s.spp;
  const uint64_t pixels = std::min({samples / kTransportShare / kTransportSamples,
                                    kMostTransportPixels, uint64_t{s.width} * s.height});
  if (pixels < kLeastTransportPixels) return {0, 0};
  const double shrink = std::sqrt(static_cast<double>(pixels) / (double{1} * s.width * s.height));
  const auto side = [&](uint32_t full) {
    return std::max(1u, static_cast<uint32_t>(std::lround(full * shrink)));
  };
  return {side(s.width), side(s.height)};
}

float brightness(const std::vector<float>& rgb, size_t pixel) {
  return luminance(Vec3<float>{rgb[3 * pixel], rgb[3 * pixel + 1], rgb[3 * pixel + 2]});
}

/// 1 / (I^2 + a hundredth of its mean's square) by pixel, I the mean of pictures over 3 x 3 pixels.
std::vector<double> inverse_squares(const std::vector<double>& mean, uint32_t width) {
  const auto height = static_cast<uint32_t>(mean.size() / width);
  double all = 0;
  for (const double v : mean) all += v / static_cast<double>(mean.size());
  std::vector<double> out(mean.size());
  for (uint32_t y = 0; y < height; ++y)
    for (uint32_t x = 0; x < width; ++x) {
      double sum = 0, count = 0;
      for (uint32_t v = y - std::min(y, 1u); v <= std::min(y + 1, height - 1); ++v)
        for (uint32_t u = x - std::min(x, 1u); u <= std::min(x + 1, width - 1); ++u) {
          sum += mean[size_t{v} * width + u];
          ++count;
        }
      const double square = sum / count * (sum / count) + 0.01 * all * all;
      out[size_t{y} * width + x] = square > 0 ? 1 / square : 0;
    }
  return out;
}

/// Brightnesses of a picture, or of a coarser one.
struct Plane {
  uint32_t width;
  std::vector<double> values;

  /// Means over 2 x 2 of them, at the edges of those that there are.
  Plane halved() const {
    const auto height = static_cast<uint32_t>(values.size() / width);
    Plane out{(width + 1) / 2, {}};
    for (uint32_t y = 0; y < height; y += 2)
      for (uint32_t x = 0; x < width; x += 2) {
        double sum = 0, count = 0;
        for (uint32_t v = y; v < std::min(y + 2, height); ++v)
          for (uint32_t u = x; u < std::min(x + 2, width); ++u, ++count)
            sum += values[size_t{v} * width + u];
        out.values.push_back(sum / count);
      }
    return out;
  }
};

Plane plane_of(const std::vector<float>& rgb, uint32_t width) {
  Plane out{width, std::vector<double>(rgb.size() / 3)};
  for (size_t i = 0; i < out.values.size(); ++i) out.values[i] = brightness(rgb, i);
  return out;
}

/// Squared light, times `scale`, that pictures with light paths have and the others lack, or the
/// other way round, summed over pixels; 0 where it may be noise. Light that few samples bring is
/// told in coarser pictures where it is not in a pixel, so the most is taken of all that tell.
double missed_light(const TransportTrial (&without)[2], const TransportTrial (&with)[2],
                    const std::vector<double>& scale, uint32_t width) {
  std::array<Plane, 5> planes = {
      plane_of(without[0].beauty, width), plane_of(without[1].beauty, width),
      plane_of(with[0].beauty, width), plane_of(with[1].beauty, width), Plane{width, scale}};
  const auto pixels = static_cast<double>(scale.size());
  double most = 0;
  while (planes[0].values.size() >= kLeastCells) {
    const auto cells = static_cast<double>(planes[0].values.size());
    double missed = 0, noise = 0;
    for (size_t i = 0; i < planes[0].values.size(); ++i) {
      const double p = planes[0].values[i] - planes[1].values[i];
      const double j = planes[2].values[i] - planes[3].values[i];
      const double both = planes[0].values[i] + planes[1].values[i] - planes[2].values[i] -
                          planes[3].values[i];
      missed += 0.25 * (both * both - p * p - j * j) * planes[4].values[i];
      noise += 0.5 * (p * p + j * j) * planes[4].values[i];
    }
    const double few = std::max(1.0, std::sqrt(double{kLeastTransportPixels} / cells));
    if (missed > kMissed * few * noise) most = std::max(most, missed * pixels / cells);
    for (Plane& plane : planes) plane = plane.halved();
  }
  return most;
}

double cost_of(const TransportTrial (&trials)[2], double vertex) {
  double cost = 0;
  for (const TransportTrial& t : trials)
    cost += static_cast<double>(t.rays) + vertex * static_cast<double>(t.records);
  return cost;
}

/// What a lobe of this roughness may be, where `varies`: anything.
bool is_sharp(float roughness, bool varies) {
  return varies || roughness < kSharpRoughness;
}

}  // namespace

TransportGain transport_gain(const TransportTrial (&without)[2], const TransportTrial (&with)[2],
                             uint32_t width, double longer) {
  const size_t pixels = without[0].beauty.size() / 3;
  std::vector<double> mean(pixels);
  for (size_t i = 0; i < pixels; ++i)
    for (const auto& trials : {&without, &with})
      for (const TransportTrial& t : *trials) mean[i] += 0.25 * double{brightness(t.beauty, i)};
  const std::vector<double> scale = inverse_squares(mean, width);
  double path = 0, camera = 0, light = 0;
  for (size_t i = 0; i < pixels; ++i) {
    const double p0 = brightness(without[0].beauty, i), p1 = brightness(without[1].beauty, i);
    const double j0 = brightness(with[0].beauty, i), j1 = brightness(with[1].beauty, i);
    const double l0 = brightness(with[0].by_light_paths, i);
    const double l1 = brightness(with[1].by_light_paths, i);
    const auto squared = [](double d) { return d * d; };
    path += 0.5 * squared(p0 - p1) * scale[i];
    light += 0.5 * squared(l0 - l1) * scale[i];
    camera += 0.5 * squared((j0 - l0) - (j1 - l1)) * scale[i];
  }
  // Light that no path from the camera has met is error that more samples do not take away.
  path += missed_light(without, with, scale, width) * std::min(longer, kMostLonger);
  const double path_cost = cost_of(without, kPathVertex);
  const double camera_cost = cost_of(without, kJointVertex);
  const double light_cost = std::max(0.0, cost_of(with, kJointVertex) - camera_cost);
  TransportGain best;
  for (int exponent = -kMostShare; exponent <= kMostShare; ++exponent) {
    const double s = std::ldexp(1.0, exponent);
    const double spent = (camera + light / s) * (camera_cost + s * light_cost);
    const double gain = spent > 0 ? path * path_cost / spent : 0;
    if (gain > best.gain) best = {gain, {exponent}};
  }
  return best;
}

bool focuses_light(const Scene& scene) {
  return std::any_of(scene.materials().begin(), scene.materials().end(), [](const Material& m) {
    const bool varies = m.graph != kNoGraph;
    switch (m.program) {
      case ProgramId::kDiffuse:
      case ProgramId::kEmissive:
        return false;
      case ProgramId::kDielectric:
        return true;
      default:
        break;
    }
    const bool passes = (m.opacity < 1 && !m.presence && m.opacity_threshold <= 0) ||
                        m.openpbr.transmission_weight > 0;
    const bool coats = m.clearcoat > 0 || m.has_texture(Input::kClearcoat);
    return varies || passes || is_sharp(m.roughness, m.has_texture(Input::kRoughness)) ||
           (coats && is_sharp(m.clearcoat_roughness, m.has_texture(Input::kClearcoatRoughness)));
  });
}

TransportChoice choose_transport(const Scene& scene, const Settings& settings,
                                 const RenderTrial& render, const std::function<bool()>& stopped) {
  const Clock::time_point start = Clock::now();
  TransportChoice choice;
  const auto refused = [&](const LightPathRefusal& refusal) {
    if (!refusal.what.empty()) choice.why = "light paths do not go with " + refusal.what;
    return !refusal.what.empty();
  };
  if (refused(light_path_refusal(settings)) || refused(light_path_refusal(scene))) return choice;
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
  if (!sends_paths(scene)) {
    choice.why = "no light sends paths";
    return choice;
  }
  const auto [width, height] = trial_size(settings);
  if (width == 0) {
    choice.why = "too few samples to find out whether light paths pay";
    return choice;
  }
  Settings small = settings;
  small.width = width;
  small.height = height;
  small.spp = kTransportSamples;
  small.region.reset();
  small.crop = false;
  small.time_limit = 0;
  small.firefly = Firefly::kKeep;
  small.adaptive = small.noise = 0;
  small.allocate = Allocate::kEven;
  small.error = false;
  small.costs = CostSource::kModel;
  small.aovs.bits = 0;
  small.light_groups.clear();
  small.expressions.clear();
  TransportTrial trials[2][2];
  for (size_t i = 0; i < std::size(kTransportSeeds); ++i) {
    small.seed = kTransportSeeds[i];
    for (const Transport transport : {Transport::kPath, Transport::kLight}) {
      const bool is_light = transport == Transport::kLight;
      small.transport = transport;
      small.aovs.bits = is_light ? static_cast<uint32_t>(Aov::kByLightPaths) : 0;
      trials[is_light ? 1 : 0][i] = render(small);
      if (stopped()) return choice;
    }
  }
  const TransportGain found = transport_gain(trials[0], trials[1], width,
                                             static_cast<double>(settings.spp) / kTransportSamples);
  choice.gain = found.gain;
  choice.why =
      "by a trial of " + std::to_string(width) + " x " + std::to_string(height) + " pixels";
  if (found.gain >= kWorthwhileLight) {
    choice.transport = Transport::kLight;
    choice.share = found.share;
  }
  choice.seconds = seconds_since(start);
  return choice;
}

}  // namespace wavecomb
