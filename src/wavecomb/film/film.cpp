// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/film/film.h"

#include <limits>

#include "wavecomb/film/storage.h"

namespace wavecomb {

Film::Film(const Region& window, const AovLayout& aovs, bool with_error)
    : window_(window), pixels_(window.pixels()), aovs_(window.pixels(), aovs) {
  if (with_error) errors_.resize(pixels_.size());
}

std::vector<float> Film::beauty() const {
  return means(cascades_.excess(samples()));
}

std::vector<float> Film::means(const std::vector<float>& excess) const {
  std::vector<float> out(3 * pixels_.size());
  for (size_t i = 0; i < pixels_.size(); ++i) {
    const Pixel& p = pixels_[i];
    const double s = inverse_count(p.samples);
    std::array<double, 3> mean{p.r * s, p.g * s, p.b * s};
    if (!splats_.empty()) {
      const std::array<double, 3> splat = splats_.mean(i);
      for (size_t c = 0; c < 3; ++c) mean[c] += splat[c];
    }
    for (size_t c = 0; c < 3; ++c) {
      if (!excess.empty()) mean[c] -= double{excess[3 * i + c]};
      out[3 * i + c] = static_cast<float>(mean[c]);
    }
  }
  return out;
}

void Film::update_splat_aovs() {
  if (splats_.empty()) return;
  aovs_.set_light_splat_scale(splats_.scale());
  for (size_t i = 0; i < pixels_.size(); ++i) {
    double* sums = aovs_.sums(kSplatAov, i);
    if (!sums) return;
    const std::array<double, 3> mean = splats_.mean(i);
    for (size_t c = 0; c < 3; ++c) sums[c] = mean[c] * pixels_[i].samples;
  }
}

std::vector<float> Film::albedo() const {
  return aovs_.layer(Aov::kAlbedo, samples()).values;
}

std::vector<float> Film::normal() const {
  return aovs_.layer(Aov::kNormal, samples()).values;
}

std::vector<float> Film::depth() const {
  return aovs_.layer(Aov::kDepth, samples()).values;
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
    std::array<double, 3> splats{};
    if (!splats_.empty()) splats = splats_.difference(i);
    for (size_t c = 0; c < 3; ++c)
      out[3 * i + c] =
          n < 2 ? std::numeric_limits<float>::infinity()
                : static_cast<float>(errors_[i].m2[c] / (n * (n - 1)) + splats[c] * splats[c]);
  }
  return out;
}

std::vector<Film::Block> Film::blocks() {
  std::vector<Block> out;
  const auto add = [&](const std::string& name, auto& values) {
    if (!values.empty()) out.push_back({name, std::as_writable_bytes(std::span(values))});
  };
  add("pixels", pixels_);
  aovs_.for_each_block(add);
  add("errors", errors_);
  splats_.for_each_block(add);
  cascades_.for_each_block(add);
  add("visible_points", joint_rows_);
  return out;
}

Film::Layers Film::finish(const std::vector<std::string>& multi_layer_names) && {
  Layers layers;
  layers.beauty = beauty();
  layers.samples = samples();
  layers.variance = variance();
  std::vector<float> kept;
  if (has_cascades()) kept = unbiased();
  update_splat_aovs();
  release(errors_);
  release(pixels_);
  splats_ = {};
  cascades_ = {};
  release(joint_rows_);
  layers.deep = aovs_.take_deep(layers.samples);
  layers.albedo = aovs_.take(Aov::kAlbedo, layers.samples).values;
  layers.normal = aovs_.take(Aov::kNormal, layers.samples).values;
  layers.depth = aovs_.take(Aov::kDepth, layers.samples).values;
  layers.aovs = std::move(aovs_).finish(layers.samples, multi_layer_names);
  if (!kept.empty()) layers.aovs.push_back({"unbiased", 3, std::move(kept)});
  return layers;
}

}  // namespace wavecomb
