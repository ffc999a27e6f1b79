// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/film/cascades.h"

#include <algorithm>

#include "wavecomb/core/vec.h"

namespace wavecomb {
namespace {

float brightness_of(const std::array<float, 3>& rgb) {
  return luminance(Vec3<float>{rgb[0], rgb[1], rgb[2]});
}

}  // namespace

Cascades::Cascades(const Region& window, float darkest)
    : width_(window.width()), height_(window.height()), sums_(window.pixels()) {
  for (float& brightness : brightness_) {
    brightness = darkest;
    darkest *= kBase;
  }
}

void Cascades::add(size_t pixel, const float* rgb) {
  const float y = brightness_of({rgb[0], rgb[1], rgb[2]});
  Sum& sum = sums_[pixel];
  uint32_t i = 0;
  while (i + 2 < kLayers && y > brightness_[i + 1]) ++i;
  const float low = brightness_[i];
  const float first = y > low ? std::max(0.f, (low / y - 1 / kBase) / (1 - 1 / kBase)) : 1.f;
  for (size_t c = 0; c < 3; ++c) {
    sum[i][c] += first * rgb[c];
    sum[i + 1][c] += (1 - first) * rgb[c];
  }
}

float Cascades::kept_fraction(const Levels& own, const Levels& around, float pixels, float samples,
                              float samples_around, uint32_t layer) const {
  const auto count = [&](const Levels& levels) {
    float sum = 0;
    for (uint32_t i = layer - 1; i <= std::min(layer + 1, kLayers - 1); ++i)
      sum += levels[i] / brightness_[i];
    return sum;
  };
  float below = 0;
  for (uint32_t i = 0; i < layer; ++i) below += around[i];
  const float near = count(around) / pixels;
  const float counted = ((near < 1 ? near : count(own)) - 1) / kEnough;
  const float little = samples * (below / samples_around) / (kTolerance * brightness_[layer]);
  return std::clamp(std::max(counted, little), 0.f, 1.f);
}

std::vector<float> Cascades::excess(const std::vector<uint32_t>& samples) const {
  if (empty()) return {};
  std::vector<Levels> levels(sums_.size());
  for (size_t i = 0; i < sums_.size(); ++i)
    for (uint32_t k = 0; k < kLayers; ++k) levels[i][k] = brightness_of(sums_[i][k]);
  std::vector<float> out(3 * sums_.size());
  for (uint32_t y = 0; y < height_; ++y)
    for (uint32_t x = 0; x < width_; ++x) {
      const size_t i = size_t{y} * width_ + x;
      const auto is_dark = [](float level) { return level <= 0; };
      if (samples[i] == 0 || std::all_of(levels[i].begin() + 1, levels[i].end(), is_dark)) continue;
      Levels around{};
      float pixels = 0, samples_around = 0;
      for (uint32_t v = y - std::min(y, 1u); v <= std::min(y + 1, height_ - 1); ++v)
        for (uint32_t u = x - std::min(x, 1u); u <= std::min(x + 1, width_ - 1); ++u) {
          const size_t j = size_t{v} * width_ + u;
          for (uint32_t k = 0; k < kLayers; ++k) around[k] += levels[j][k];
          samples_around += static_cast<float>(samples[j]);
          ++pixels;
        }
      const auto n = static_cast<float>(samples[i]);
      for (uint32_t k = 1; k < kLayers; ++k) {
        if (is_dark(levels[i][k])) continue;
        const float fraction = kept_fraction(levels[i], around, pixels, n, samples_around, k);
        for (size_t c = 0; c < 3; ++c) out[3 * i + c] += (1 - fraction) * sums_[i][k][c] / n;
      }
    }
  return out;
}

}  // namespace wavecomb
