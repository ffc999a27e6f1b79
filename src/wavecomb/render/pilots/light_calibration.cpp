// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/render/pilots/light_calibration.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <unordered_map>

#include "wavecomb/core/clock.h"
#include "wavecomb/core/denormals.h"
#include "wavecomb/guiding/image_tiles.h"
#include "wavecomb/light/calibration/balance.h"
#include "wavecomb/light/sampling/tree_choice.h"
#include "wavecomb/light/tree/light_tree.h"
#include "wavecomb/reference/reference.h"
#include "wavecomb/scene/parallel.h"
#include "wavecomb/wave/cost_calibration.h"

namespace wavecomb {
namespace {

/// Calibration traces one path for every kPixelsOfPath pixels, within the limits kMinPaths and
/// kMaxPaths.
constexpr uint32_t kMaxPaths = 16384, kMinPaths = 1024, kPixelsOfPath = 4;
/// If there are no probabilities to calibrate, only one of kBrightnessShare paths is traced, which
/// suffices to estimate the brightness of the image.
constexpr uint32_t kBrightnessShare = 4;
/// Contribution below which roulette decides about the shadow ray, relative to the brightness of
/// the image (docs/decisions/roulette.md).
constexpr double kShadowThreshold = 0.2;
/// Number of vertices of a calibration path at which a light is selected.
constexpr uint32_t kVertices = 3;
constexpr size_t kChunk = 128;
/// Calibration changes the selection odds of light tree nodes whose depth is below this value.
constexpr uint32_t kTiltDepth = 6;
/// Number of lights up to which the odds of nodes are changed. The nodes are copied, which takes 64
/// bytes for each light.
constexpr size_t kMaxTilted = size_t{1} << 20;

uint32_t path_count(const Settings& settings) {
  const uint64_t pixels = uint64_t{settings.width} * settings.height;
  return static_cast<uint32_t>(std::clamp<uint64_t>(pixels / kPixelsOfPath, kMinPaths, kMaxPaths));
}

/// Returns pixels spread over the whole image by M. Roberts' R2 sequence, in integer arithmetic.
std::vector<uint32_t> spread_pixels(const Settings& settings, uint32_t count) {
  std::vector<uint32_t> pixels(count);
  for (uint32_t i = 0; i < count; ++i) {
    const uint32_t u = (i + 1) * 3242174889u, v = (i + 1) * 2447445414u;
    const auto x = static_cast<uint32_t>(uint64_t{u} * settings.width >> 32);
    const auto y = static_cast<uint32_t>(uint64_t{v} * settings.height >> 32);
    pixels[i] = x | y << 16;
  }
  return pixels;
}

/// Returns the new selection odds of the upper light tree nodes, estimated from the samples that
/// passed through these nodes.
std::vector<NodeTilt> balance_nodes(const LightTreeView& tree, const LightProbes& probes,
                                    std::span<const double> scales) {
  std::unordered_map<uint32_t, size_t> index;
  std::vector<std::pair<uint32_t, NodeBalance>> nodes;
  const DenormalsOff denormals_off;
  for (size_t path = 0; path < scales.size(); ++path) {
    for (uint32_t k = 0; k < probes.counts[path]; ++k) {
      const LightProbe& probe = probes.probes[path * probes.most + k];
      if (!(probe.value > 0) || probe.light == kNoLight) continue;
      uint32_t trail = tree.trails[probe.light];
      if (trail == kNoLight) continue;
      uint32_t depth = 0, at = tree.root;
      const LightReceiver<float> to({probe.at[0], probe.at[1], probe.at[2]}, probe.normal);
      detail::descend<float>(tree, to, true, [&](float left, bool) {
        const bool right = (trail & 1u) != 0;
        trail >>= 1;
        if (depth++ < kTiltDepth) {
          const auto [found, fresh] = index.try_emplace(at, nodes.size());
          if (fresh) nodes.push_back({at, {}});
          nodes[found->second].second.add(right, double{right ? 1.f - left : left},
                                          double{probe.value} * scales[path], double{probe.weight});
          at = tree.nodes[at].child[right ? 1 : 0].next;
        }
        return right;
      });
    }
  }
  std::vector<NodeTilt> tilts;
  for (const auto& [node, balance] : nodes)
    if (const float odds = balance.odds(); odds != 1) tilts.push_back({node, odds});
  return tilts;
}

/// Returns LightView::shadow_threshold for an image of the given brightness. Dark parts of the
/// image count most, as in relMSE: the threshold is relative to 1 / sqrt(mean of 1 / brightness^2).
float shadow_threshold(const ImageTiles& tiles) {
  if (!tiles.is_lit()) return 0;
  double squares = 0;
  for (const double inverse : tiles.inverse_scales()) squares += inverse * inverse;
  const auto count = static_cast<double>(tiles.inverse_scales().size());
  return static_cast<float>(kShadowThreshold / std::sqrt(squares / count));
}

/// Returns whether a calibration for settings `a` is valid for `b`.
bool is_valid_for(const Settings& a, const Settings& b) {
  return a.width == b.width && a.height == b.height && a.max_depth == b.max_depth &&
         a.filter == b.filter && a.used_filter_width() == b.used_filter_width() &&
         a.light_selection == b.light_selection && a.saves_shadow_rays() == b.saves_shadow_rays() &&
         a.schlick_fresnel == b.schlick_fresnel && a.cosine_sampling == b.cosine_sampling &&
         a.texture_filter == b.texture_filter;
}

/// Traces the calibration paths through the scene of `view`, whose lights have the initial
/// probabilities.
LightProbes trace_probes(const Scene& scene, const EmbreeAccelerator& accel, const SceneView& view,
                         const Settings& settings, std::span<const uint32_t> pixels,
                         const std::function<bool()>& stopped) {
  Settings probing;
  probing.width = settings.width;
  probing.height = settings.height;
  probing.max_depth = std::min(settings.max_depth, kVertices);
  probing.schlick_fresnel = settings.schlick_fresnel;
  probing.cosine_sampling = settings.cosine_sampling;
  probing.texture_filter = settings.texture_filter;
  probing.sampler = SamplerKind::kIndependent;
  probing.seed = 0x9e3779b9u;
  const FilterTable filter(settings.filter, settings.used_filter_width());
  const CameraSetup camera(scene.camera(), settings.width, settings.height, filter,
                           settings.overscan);
  Film film(1, 1, AovLayout{});
  WaveContext context{};
  context.scene = view;
  context.accel = &accel;
  context.settings = &probing;
  context.camera = &camera;
  context.film = &film;
  context.traversal_width = 1;
  LightProbes probes(pixels.size(), kVertices);
  parallel_for((pixels.size() + kChunk - 1) / kChunk, [&](size_t chunk) {
    if (stopped()) return;
    const DenormalsOff denormals_off;
    const size_t first = chunk * kChunk;
    run_light_probes(context, pixels, first, std::min(kChunk, pixels.size() - first), probes);
  });
  return probes;
}

}  // namespace

void LightCalibration::apply(LightView& view) const {
  tables.apply(view);
  view.shadow_threshold = shadow_threshold;
}

LightCalibration calibrate_lights(const Scene& scene, const EmbreeAccelerator& accel,
                                  const SceneView& view, const Settings& settings,
                                  const std::function<bool()>& stopped) {
  const auto start = std::chrono::steady_clock::now();
  LightCalibration out;
  if (settings.light_weights == LightWeights::kPower || settings.max_depth == 0) return out;
  LightParts parts = divide_lights(scene, view.lights.by_tree);
  const LightSet& set = scene.light_set();
  const LightTree& tree = parts.by_tree ? scene.light_tree(settings.threads) : set.tree;
  const bool has_nodes =
      parts.by_tree && parts.size() > 0 && tree.nodes.size() > 1 && set.size() <= kMaxTilted;
  if (parts.size() < 2 && !has_nodes) {
    if (!settings.saves_shadow_rays() || view.lights.count == 0) return out;
    const std::vector<uint32_t> pixels =
        spread_pixels(settings, path_count(settings) / kBrightnessShare);
    const LightProbes probes = trace_probes(scene, accel, view, settings, pixels, stopped);
    out.shadow_threshold = shadow_threshold(ImageTiles(settings, pixels, probes.luminance));
    out.seconds = seconds_since(start);
    return out;
  }

  // Mix the probabilities with uniform ones, so that lights of little power are sampled as well.
  std::vector<double> even(parts.size());
  for (size_t i = 0; i < parts.size(); ++i)
    even[i] = 0.5 * parts.power[i] + 0.5 / static_cast<double>(parts.size());
  LightTableBuilder table_builder(set, tree, parts);
  const CalibratedLights first = table_builder.build_tables(even, {});
  SceneView probing = view;
  first.apply(probing.lights);
  const std::vector<uint32_t> pixels = spread_pixels(settings, path_count(settings));
  const LightProbes probes = trace_probes(scene, accel, probing, settings, pixels, stopped);
  if (stopped()) return out;

  const ImageTiles tiles(settings, pixels, probes.luminance);
  if (settings.saves_shadow_rays()) out.shadow_threshold = shadow_threshold(tiles);
  std::vector<double> scales;
  if (tiles.is_lit())
    for (const uint32_t pixel : pixels) scales.push_back(tiles.inverse_scale(pixel));
  LightBalance balance(first.shares, size_t{tiles.count()} * kVertices);
  for (size_t path = 0; path < scales.size(); ++path) {
    for (uint32_t k = 0; k < probes.counts[path]; ++k) {
      const LightProbe& probe = probes.probes[path * probes.most + k];
      const uint32_t part = parts.of(probe.light);
      if (part != kNoPart)
        balance.add(tiles.of(pixels[path]) * kVertices + k, part,
                    double{probe.value} * scales[path], double{probe.weight});
    }
  }
  std::vector<NodeTilt> tilts;
  if (has_nodes) tilts = balance_nodes(probing.lights.tree, probes, scales);
  out.tables = table_builder.build_tables(balance.shares(parts.power), tilts);
  out.parts = std::move(parts);
  out.paths = static_cast<uint32_t>(pixels.size());
  out.tilted_nodes = static_cast<uint32_t>(tilts.size());
  out.seconds = seconds_since(start);
  return out;
}

std::shared_ptr<const LightCalibration> LightCalibrationCache::get(
    const std::shared_ptr<const Scene>& scene, const EmbreeAccelerator& accel,
    const SceneView& view, const Settings& settings, const std::function<bool()>& stopped) {
  const bool is_off = settings.light_weights == LightWeights::kPower;
  if (!last_ || is_off || scene_.lock() != scene || !is_valid_for(settings_, settings)) {
    last_ = std::make_shared<const LightCalibration>(
        calibrate_lights(*scene, accel, view, settings, stopped));
    settings_ = settings;
    scene_ = stopped() || is_off ? std::weak_ptr<const Scene>() : scene;
  } else if (!last_->kept) {
    auto kept = std::make_shared<LightCalibration>(*last_);
    kept->kept = true;
    kept->seconds = 0;
    last_ = kept;
  }
  return last_;
}

}  // namespace wavecomb
