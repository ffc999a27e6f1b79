// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/film/aov_film.h"

#include <algorithm>
#include <bit>
#include <limits>

#include "wavecomb/film/storage.h"

namespace wavecomb {
namespace {

/// Prefix of the layer names of light groups.
constexpr const char* kLightPrefix = "light_";
/// Prefix of the layer names of light path expressions.
constexpr const char* kExpressionPrefix = "lpe_";

/// Makes an image layer. The function `write(i, pointer)` writes the values of pixel `i` to
/// `pointer`.
template <typename Write>
AovLayer make_layer(std::string name, uint32_t channels, size_t pixels, const Write& write) {
  AovLayer layer{std::move(name), channels, std::vector<float>(pixels * channels)};
  for (size_t i = 0; i < pixels; ++i) write(i, layer.values.data() + i * channels);
  return layer;
}

/// Sorts `ids` and removes duplicates.
void sort_unique(std::vector<uint32_t>& ids) {
  std::sort(ids.begin(), ids.end());
  ids.erase(std::unique(ids.begin(), ids.end()), ids.end());
}

}  // namespace

AovFilm::AovFilm(size_t pixels, const AovLayout& layout)
    : layout_(layout), light_splat_layout_(layout), pixels_(pixels) {
  for (const AovRow& row : kAovs) {
    if (!layout.set.has(row.aov)) continue;
    switch (row.kind) {
      case AovKind::kMean:
      case AovKind::kMeanOfHits:
      case AovKind::kGroups:
      case AovKind::kExpressions:
      case AovKind::kSum:
      case AovKind::kMedian:
        sums_[aov_index(row.aov)].resize(pixels * words_of(row));
        break;
      case AovKind::kNearest:
        nearest_[aov_index(row.aov)].resize(pixels * words_of(row));
        break;
      case AovKind::kCoverage:
        crypto_[level_index(row.aov)].resize(pixels);
        break;
      case AovKind::kDeep:
        deep_ = DeepFilm(pixels, layout.deep);
        break;
    }
  }
  if (layout.set.has(AovKind::kMeanOfHits)) hits_.resize(pixels);
  if (layout.set.has(AovKind::kNearest))
    centre2_.resize(pixels, std::numeric_limits<float>::infinity());
}

size_t AovFilm::bytes() const {
  const auto of = [](const auto& v) { return v.size() * sizeof(v[0]); };
  size_t n = of(hits_) + of(centre2_) + deep_.bytes() + splats_.bytes();
  for (const auto& sums : sums_) n += of(sums);
  for (const auto& values : nearest_) n += of(values);
  for (const auto& level : crypto_) n += of(level);
  return n;
}

AovLayer AovFilm::crypto_layer(Aov level, const std::vector<uint32_t>& samples) const {
  const std::vector<CryptoPixel>& pixels = crypto_[level_index(level)];
  return make_layer(aov_name(level), 2 * kCryptoRanks, pixels_, [&](size_t i, float* out) {
    const CryptoPixel& p = pixels[i];
    uint32_t order[CryptoPixel::kIds];
    for (uint32_t k = 0; k < CryptoPixel::kIds; ++k) order[k] = k;
    std::sort(order, order + CryptoPixel::kIds, [&](uint32_t a, uint32_t b) {
      return p.count[a] != p.count[b] ? p.count[a] > p.count[b] : p.id[a] < p.id[b];
    });
    for (uint32_t rank = 0; rank < kCryptoRanks; ++rank) {
      const uint32_t k = order[rank];
      if (p.count[k] == 0) break;
      out[2 * rank] = std::bit_cast<float>(p.id[k]);
      out[2 * rank + 1] = static_cast<float>(p.count[k] * inverse_count(samples[i]));
    }
  });
}

AovLayer AovFilm::layer(Aov aov, const std::vector<uint32_t>& samples) const {
  const AovRow& row = row_of(aov);
  if (!layout_.set.has(aov)) return {};
  const std::vector<double>& sums = sums_[aov_index(aov)];
  const auto scaled = [&](const auto& scale) {
    return make_layer(row.name, row.channels, pixels_, [&](size_t i, float* out) {
      for (uint32_t c = 0; c < row.channels; ++c)
        out[c] = static_cast<float>(sums[i * row.channels + c] * scale(i));
    });
  };
  switch (row.kind) {
    case AovKind::kMean: {
      AovLayer layer = scaled([&](size_t i) { return inverse_count(samples[i]); });
      if (const uint32_t sum_index = light_splat_layout_.of(aov);
          !splats_.empty() && sum_index != LightSplatLayout::kNotStored)
        for (size_t i = 0; i < layer.values.size(); ++i)
          layer.values[i] = static_cast<float>(sums[i] * inverse_count(samples[i / 3]) +
                                               light_splat_mean(i / 3, sum_index, i % 3));
      return layer;
    }
    case AovKind::kMeanOfHits: {
      AovLayer layer = scaled([&](size_t i) { return inverse_count(hits_[i]); });
      for (size_t i = 0; i < layer.values.size(); ++i)
        if (hits_[i / row.channels] == 0) layer.values[i] = std::numeric_limits<float>::infinity();
      return layer;
    }
    case AovKind::kSum:
      return scaled([](size_t /*i*/) { return 1.0; });
    case AovKind::kNearest:
      return {row.name, row.channels, nearest_[aov_index(aov)]};
    case AovKind::kCoverage:
      return crypto_layer(aov, samples);
    case AovKind::kMedian:
      return make_layer(row.name, row.channels, pixels_, [&](size_t i, float* out) {
        *out = static_cast<float>(median_of(sums.data() + i * MedianSketch::kWords));
      });
    case AovKind::kGroups:
    case AovKind::kExpressions:
    case AovKind::kDeep:
      break;
  }
  return {};
}

AovLayer AovFilm::multi_layer(Aov aov, uint32_t which, std::string name,
                              const std::vector<uint32_t>& samples) const {
  const std::vector<double>& sums = sums_[aov_index(aov)];
  const size_t words = words_of(row_of(aov));
  const uint32_t sum_index = light_splat_layout_.of(aov, which);
  return make_layer(std::move(name), 3, pixels_, [&](size_t i, float* v) {
    for (size_t c = 0; c < 3; ++c)
      v[c] = static_cast<float>(sums[i * words + 3 * which + c] * inverse_count(samples[i]) +
                                light_splat_mean(i, sum_index, c));
  });
}

template <typename Layer>
void AovFilm::for_each_multi_layer(const std::vector<std::string>& multi_layer_names,
                                   const Layer& layer) const {
  const uint32_t groups = layout_.light_groups;
  for (uint32_t g = 0; layout_.set.has(Aov::kLightGroups) && g < groups; ++g)
    layer(Aov::kLightGroups, g, kLightPrefix + multi_layer_names[g]);
  for (uint32_t e = 0; layout_.set.has(Aov::kExpressions) && e < layout_.expressions; ++e)
    layer(Aov::kExpressions, e, kExpressionPrefix + multi_layer_names[groups + e]);
}

AovLayer AovFilm::layer(const std::string& name, const std::vector<uint32_t>& samples,
                        const std::vector<std::string>& multi_layer_names) const {
  AovLayer found;
  for_each_multi_layer(multi_layer_names, [&](Aov aov, uint32_t which, const std::string& one) {
    if (name == one) found = multi_layer(aov, which, one, samples);
  });
  if (!found.name.empty()) return found;
  for (const AovRow& row : kAovs)
    if (name == row.name) return layer(row.aov, samples);
  return {};
}

AovLayer AovFilm::take(Aov aov, const std::vector<uint32_t>& samples) {
  AovLayer taken = layer(aov, samples);
  release(sums_[aov_index(aov)]);
  release(nearest_[aov_index(aov)]);
  if (row_of(aov).kind == AovKind::kCoverage) release(crypto_[level_index(aov)]);
  layout_.set.bits &= ~static_cast<uint32_t>(aov);
  return taken;
}

DeepLayer AovFilm::take_deep(const std::vector<uint32_t>& samples) {
  DeepLayer layer;
  if (!deep_.empty()) layer = deep_.layer(samples);
  deep_ = {};
  return layer;
}

std::vector<AovLayer> AovFilm::finish(const std::vector<uint32_t>& samples,
                                      const std::vector<std::string>& multi_layer_names) && {
  std::vector<AovLayer> out;
  for (const AovRow& row : kAovs) {
    if (!layout_.set.has(row.aov)) continue;
    for_each_multi_layer(multi_layer_names, [&](Aov aov, uint32_t which, const std::string& name) {
      if (aov == row.aov) out.push_back(multi_layer(aov, which, name, samples));
    });
    AovLayer layer = take(row.aov, samples);
    if (!layer.values.empty()) out.push_back(std::move(layer));
  }
  return out;
}

std::vector<uint32_t> crypto_ids(const AovLayer& pairs) {
  std::vector<uint32_t> ids;
  size_t limit = 1u << 20;
  for (size_t i = 0; i + 1 < pairs.values.size(); i += 2) {
    if (pairs.values[i + 1] <= 0) continue;
    const auto id = std::bit_cast<uint32_t>(pairs.values[i]);
    // Neighbouring pixels mostly have the same ids, so removing duplicates from time to time keeps
    // the list short.
    if (ids.empty() || ids.back() != id) ids.push_back(id);
    if (ids.size() < limit) continue;
    sort_unique(ids);
    limit = std::max(limit, 2 * ids.size());
  }
  sort_unique(ids);
  return ids;
}

}  // namespace wavecomb
