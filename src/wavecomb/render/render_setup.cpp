// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/render/render_setup.h"

#include <tbb/info.h>

#include <algorithm>

namespace wavecomb {
namespace {

/// Paths a wave holds unless told otherwise (docs/decisions/wave-size.md), and samples of a pixel
/// that a pass adds.
constexpr uint32_t kDefaultWaveSize = 4096;
constexpr uint32_t kPassSamples = 16;

}  // namespace

uint32_t thread_count(const Settings& settings) {
  return settings.threads != 0 ? settings.threads
                               : static_cast<uint32_t>(tbb::info::default_concurrency());
}

uint32_t wave_size_for(const Settings& settings, uint64_t pixels) {
  const uint64_t total = settings.spp * pixels;
  const uint64_t share = std::max<uint64_t>(64, total / (uint64_t{thread_count(settings)} * 4));
  return static_cast<uint32_t>(
      std::min<uint64_t>(settings.wave_size != 0 ? settings.wave_size : kDefaultWaveSize, share));
}

uint32_t pass_step(const Settings& settings, uint64_t pixels, uint32_t wave_size) {
  // One sample of a pixel is seen in mirrors at a time.
  if (settings.merges()) return 1;
  const auto fill = static_cast<uint32_t>((wave_size + pixels - 1) / pixels);
  return std::min({settings.spp, wave_size, std::max(kPassSamples, fill)});
}

std::vector<std::unique_ptr<SchedulingPolicy>> choose_policies(const std::string& name) {
  std::vector<std::unique_ptr<SchedulingPolicy>> policies;
  if (name == "adaptive")
    for (const char* one : {"none", "code", "material", "texture", "texture-locality"})
      policies.push_back(make_policy(one));
  else
    policies.push_back(make_policy(name));
  return policies;
}

OrderGrid order_grid(const Bounds& bounds) {
  OrderGrid grid;
  if (bounds.empty()) return grid;
  const float lo[3] = {bounds.lo.x, bounds.lo.y, bounds.lo.z};
  const float hi[3] = {bounds.hi.x, bounds.hi.y, bounds.hi.z};
  for (int i = 0; i < 3; ++i) {
    grid.lo[i] = lo[i];
    grid.scale[i] = hi[i] > lo[i] ? 1024.f / (hi[i] - lo[i]) : 0.f;
  }
  return grid;
}

std::vector<CryptoManifest> crypto_manifests(const Scene& scene,
                                             const std::vector<AovLayer>& layers) {
  std::vector<CryptoManifest> manifests;
  for (const AovLayer& layer : layers)
    for (const Aov level : {Aov::kCryptoObject, Aov::kCryptoMaterial, Aov::kCryptoAsset})
      if (layer.name == aov_name(level))
        manifests.push_back({layer.name, crypto_manifest(scene, level, crypto_ids(layer))});
  return manifests;
}

}  // namespace wavecomb
