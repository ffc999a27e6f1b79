// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/film/film.h"

#include <limits>

namespace wavecomb {
namespace {

double inverse(uint32_t n) {
  return n == 0 ? 0.0 : 1.0 / n;
}

/// Means of an AOV of three numbers, where pixel i has count(i) samples.
template <typename Count>
std::vector<float> aov_means(const std::vector<Film::AovPixel>& aovs,
                             double (Film::AovPixel::*sum)[3], const Count& count) {
  std::vector<float> out(3 * aovs.size());
  for (size_t i = 0; i < aovs.size(); ++i)
    for (size_t c = 0; c < 3; ++c)
      out[3 * i + c] = static_cast<float>((aovs[i].*sum)[c] * inverse(count(i)));
  return out;
}

/// Frees what a vector holds.
template <typename T>
void release(std::vector<T>& values) {
  std::vector<T>().swap(values);
}

}  // namespace

Film::Film(uint32_t width, uint32_t height, bool with_aovs, bool with_error)
    : width_(width), height_(height), pixels_(size_t{width} * height) {
  if (with_aovs) aovs_.resize(pixels_.size());
  if (with_error) errors_.resize(pixels_.size());
}

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
  return aov_means(aovs_, &AovPixel::albedo, [&](size_t i) { return pixels_[i].samples; });
}

std::vector<float> Film::normal() const {
  return aov_means(aovs_, &AovPixel::normal, [&](size_t i) { return pixels_[i].samples; });
}

std::vector<float> Film::depth() const {
  std::vector<float> out(aovs_.size());
  for (size_t i = 0; i < aovs_.size(); ++i)
    out[i] = aovs_[i].depth_samples == 0
                 ? std::numeric_limits<float>::infinity()
                 : static_cast<float>(aovs_[i].depth * inverse(aovs_[i].depth_samples));
  return out;
}

std::vector<uint32_t> Film::samples() const {
  std::vector<uint32_t> out(pixels_.size());
  for (size_t i = 0; i < pixels_.size(); ++i) out[i] = pixels_[i].samples;
  return out;
}

std::vector<float> Film::variance() const {
  std::vector<float> out(3 * errors_.size());
  for (size_t i = 0; i < errors_.size(); ++i) {
    const double n = pixels_[i].samples;
    for (size_t c = 0; c < 3; ++c)
      out[3 * i + c] = n < 2 ? std::numeric_limits<float>::infinity()
                             : static_cast<float>(errors_[i].m2[c] / (n * (n - 1)));
  }
  return out;
}

std::vector<Film::Block> Film::blocks() {
  std::vector<Block> out;
  const auto add = [&](const char* name, auto& values) {
    if (!values.empty()) out.push_back({name, std::as_writable_bytes(std::span(values))});
  };
  add("pixels", pixels_);
  add("aovs", aovs_);
  add("errors", errors_);
  return out;
}

Film::Layers Film::finish() && {
  Layers layers;
  layers.beauty = beauty();
  layers.samples = samples();
  layers.variance = variance();
  release(errors_);
  release(pixels_);
  const auto count = [&](size_t i) { return layers.samples[i]; };
  layers.albedo = aov_means(aovs_, &AovPixel::albedo, count);
  layers.normal = aov_means(aovs_, &AovPixel::normal, count);
  layers.depth = depth();
  release(aovs_);
  return layers;
}

}  // namespace wavecomb
