// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/film/aov_film.h"

#include <algorithm>
#include <bit>
#include <initializer_list>

namespace wavecomb {
namespace {

double inverse(uint32_t n) {
  return n == 0 ? 0.0 : 1.0 / n;
}

/// Before the names of light groups' layers.
constexpr const char* kLightPrefix = "light_";

/// The layers beyond albedo, normal, depth and light groups.
constexpr Aov kFurther[] = {
    Aov::kPosition,       Aov::kUv,          Aov::kMaterialId, Aov::kInstanceId, Aov::kCryptoObject,
    Aov::kCryptoMaterial, Aov::kCryptoAsset, Aov::kEmission,   Aov::kDirect,     Aov::kIndirect,
    Aov::kCost,           Aov::kGuideAlbedo, Aov::kGuideNormal};

/// The mean of `n` samples out of their sums, rgb.
void put_mean(const double* sums, uint32_t n, float* out) {
  for (size_t c = 0; c < 3; ++c) out[c] = static_cast<float>(sums[c] * inverse(n));
}

/// Ids are counted from 1 in pictures; 0 is nothing.
float id_value(uint32_t id) {
  return id == kNothingHit ? 0.f : static_cast<float>(id) + 1.f;
}

/// A layer whose pixel i is written by `write(i, pointer)`.
template <typename Write>
AovLayer make_layer(std::string name, uint32_t channels, size_t pixels, const Write& write) {
  AovLayer layer{std::move(name), channels, std::vector<float>(pixels * channels)};
  for (size_t i = 0; i < pixels; ++i) write(i, layer.values.data() + i * channels);
  return layer;
}

/// Frees what a vector holds.
template <typename T>
void release(std::vector<T>& values) {
  std::vector<T>().swap(values);
}

void keep_once(std::vector<uint32_t>& ids) {
  std::sort(ids.begin(), ids.end());
  ids.erase(std::unique(ids.begin(), ids.end()), ids.end());
}

}  // namespace

AovFilm::AovFilm(size_t pixels, const AovLayout& layout) : layout_(layout), pixels_(pixels) {
  const AovSet& set = layout.set;
  if (set.first()) first_.resize(pixels);
  if (set.nearest()) nearest_.resize(pixels);
  for (const Aov level : {Aov::kCryptoObject, Aov::kCryptoMaterial, Aov::kCryptoAsset})
    if (set.has(level)) crypto_[level_index(level)].resize(pixels);
  if (set.parts()) parts_.resize(pixels);
  if (set.has(Aov::kLightGroups)) groups_.resize(pixels * 3 * layout.light_groups);
  if (set.has(Aov::kCost)) cost_ns_.resize(pixels);
  if (set.guides()) guides_.resize(pixels);
}

size_t AovFilm::bytes() const {
  const auto of = [](const auto& v) { return v.size() * sizeof(v[0]); };
  size_t n = of(first_) + of(nearest_) + of(parts_) + of(groups_) + of(cost_ns_) + of(guides_);
  for (const auto& level : crypto_) n += of(level);
  return n;
}

std::vector<float> AovFilm::depth() const {
  if (!layout_.set.has(Aov::kDepth)) return {};
  std::vector<float> out(first_.size());
  for (size_t i = 0; i < out.size(); ++i)
    out[i] = first_[i].depth_samples == 0
                 ? std::numeric_limits<float>::infinity()
                 : static_cast<float>(first_[i].depth * inverse(first_[i].depth_samples));
  return out;
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
      out[2 * rank + 1] = static_cast<float>(p.count[k] * inverse(samples[i]));
    }
  });
}

AovLayer AovFilm::layer(Aov aov, const std::vector<uint32_t>& samples) const {
  const auto make = [&](uint32_t channels, const auto& write) {
    return make_layer(aov_name(aov), channels, pixels_, write);
  };
  const auto means = [&](const auto& values, auto sums) {
    return make(3, [&](size_t i, float* v) { put_mean(values[i].*sums, samples[i], v); });
  };
  switch (aov) {
    case Aov::kPosition:
      return make(3, [&](size_t i, float* v) { std::copy_n(nearest_[i].position, 3, v); });
    case Aov::kUv:
      return make(2, [&](size_t i, float* v) { std::copy_n(nearest_[i].uv, 2, v); });
    case Aov::kMaterialId:
      return make(1, [&](size_t i, float* v) { *v = id_value(nearest_[i].material); });
    case Aov::kInstanceId:
      return make(1, [&](size_t i, float* v) { *v = id_value(nearest_[i].instance); });
    case Aov::kCryptoObject:
    case Aov::kCryptoMaterial:
    case Aov::kCryptoAsset:
      return crypto_layer(aov, samples);
    case Aov::kEmission:
      return means(parts_, &Parts::emission);
    case Aov::kDirect:
      return means(parts_, &Parts::direct);
    case Aov::kIndirect:
      return means(parts_, &Parts::indirect);
    case Aov::kCost:
      return make(1, [&](size_t i, float* v) { *v = static_cast<float>(cost_ns_[i]); });
    case Aov::kGuideAlbedo:
      return means(guides_, &Guides::albedo);
    case Aov::kGuideNormal:
      return means(guides_, &Guides::normal);
    default:
      return {};
  }
}

AovLayer AovFilm::group_layer(uint32_t group, const std::string& name,
                              const std::vector<uint32_t>& samples) const {
  return make_layer(kLightPrefix + name, 3, pixels_, [&](size_t i, float* v) {
    put_mean(groups_.data() + 3 * (i * layout_.light_groups + group), samples[i], v);
  });
}

AovLayer AovFilm::layer(const std::string& name, const std::vector<uint32_t>& samples,
                        const std::vector<std::string>& group_names) const {
  if (layout_.set.has(Aov::kLightGroups))
    for (uint32_t g = 0; g < layout_.light_groups; ++g)
      if (name == kLightPrefix + group_names[g]) return group_layer(g, group_names[g], samples);
  for (const Aov aov : kFurther)
    if (name == aov_name(aov) && layout_.set.has(aov)) return layer(aov, samples);
  return {};
}

std::vector<AovLayer> AovFilm::finish(const std::vector<uint32_t>& samples,
                                      const std::vector<std::string>& group_names) && {
  release(first_);
  std::vector<AovLayer> out;
  const auto add = [&](std::initializer_list<Aov> aovs) {
    for (const Aov aov : aovs)
      if (layout_.set.has(aov)) out.push_back(layer(aov, samples));
  };
  add({Aov::kPosition, Aov::kUv, Aov::kMaterialId, Aov::kInstanceId});
  release(nearest_);
  for (const Aov level : {Aov::kCryptoObject, Aov::kCryptoMaterial, Aov::kCryptoAsset}) {
    add({level});
    release(crypto_[level_index(level)]);
  }
  add({Aov::kEmission, Aov::kDirect, Aov::kIndirect});
  release(parts_);
  if (layout_.set.has(Aov::kLightGroups))
    for (uint32_t g = 0; g < layout_.light_groups; ++g)
      out.push_back(group_layer(g, group_names[g], samples));
  release(groups_);
  add({Aov::kCost});
  release(cost_ns_);
  add({Aov::kGuideAlbedo, Aov::kGuideNormal});
  release(guides_);
  return out;
}

std::vector<uint32_t> crypto_ids(const AovLayer& pairs) {
  std::vector<uint32_t> ids;
  size_t limit = 1u << 20;
  for (size_t i = 0; i + 1 < pairs.values.size(); i += 2) {
    if (pairs.values[i + 1] <= 0) continue;
    const auto id = std::bit_cast<uint32_t>(pairs.values[i]);
    // Neighbours have the same ids: now and then is enough to keep the list short.
    if (ids.empty() || ids.back() != id) ids.push_back(id);
    if (ids.size() < limit) continue;
    keep_once(ids);
    limit = std::max(limit, 2 * ids.size());
  }
  keep_once(ids);
  return ids;
}

}  // namespace wavecomb
