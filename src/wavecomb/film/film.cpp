// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/film/film.h"

#include <limits>

namespace wavecomb {
namespace {

double inverse(uint32_t n) {
  return n == 0 ? 0.0 : 1.0 / n;
}

/// Frees what a vector holds.
template <typename T>
void release(std::vector<T>& values) {
  std::vector<T>().swap(values);
}

}  // namespace

Film::Film(uint32_t width, uint32_t height, const AovLayout& aovs)
    : width_(width),
      height_(height),
      pixels_(size_t{width} * height),
      aovs_(size_t{width} * height, aovs) {}

std::vector<float> Film::beauty() const {
  std::vector<float> out(3 * pixels_.size());
  for (size_t i = 0; i < pixels_.size(); ++i) {
    const Pixel& p = pixels_[i];
    const double s = inverse(p.samples);
    out[3 * i] = static_cast<float>(p.r * s);
    out[3 * i + 1] = static_cast<float>(p.g * s);
    out[3 * i + 2] = static_cast<float>(p.b * s);
  }
  return out;
}

std::vector<float> Film::albedo() const {
  return aovs_.albedo([&](size_t i) { return pixels_[i].samples; });
}

std::vector<float> Film::normal() const {
  return aovs_.normal([&](size_t i) { return pixels_[i].samples; });
}

std::vector<float> Film::depth() const {
  return aovs_.depth();
}

std::vector<uint32_t> Film::samples() const {
  std::vector<uint32_t> out(pixels_.size());
  for (size_t i = 0; i < pixels_.size(); ++i) out[i] = pixels_[i].samples;
  return out;
}

Film::Layers Film::finish(const std::vector<std::string>& light_groups) && {
  Layers layers;
  layers.beauty = beauty();
  layers.samples = samples();
  release(pixels_);
  const auto count = [&](size_t i) { return layers.samples[i]; };
  layers.albedo = aovs_.albedo(count);
  layers.normal = aovs_.normal(count);
  layers.depth = aovs_.depth();
  layers.aovs = std::move(aovs_).finish(layers.samples, light_groups);
  return layers;
}

}  // namespace wavecomb
