// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/film/cryptomatte.h"

#include <algorithm>
#include <bit>
#include <cstring>

#include "wavecomb/scene/names.h"
#include "wavecomb/scene/parallel.h"
#include "wavecomb/scene/scene.h"

namespace wavecomb {

uint32_t murmur3_32(std::string_view text, uint32_t seed) {
  const auto scramble = [](uint32_t k) { return std::rotl(k * 0xcc9e2d51u, 15) * 0x1b873593u; };
  const auto* bytes = reinterpret_cast<const unsigned char*>(text.data());
  const size_t n = text.size();
  uint32_t h = seed;
  size_t i = 0;
  for (; i + 4 <= n; i += 4) {
    const uint32_t k = uint32_t{bytes[i]} | uint32_t{bytes[i + 1]} << 8 |
                       uint32_t{bytes[i + 2]} << 16 | uint32_t{bytes[i + 3]} << 24;
    h = std::rotl(h ^ scramble(k), 13) * 5u + 0xe6546b64u;
  }
  uint32_t tail = 0;
  for (size_t j = n; j > i; --j) tail = tail << 8 | bytes[j - 1];
  h ^= scramble(tail);
  h ^= static_cast<uint32_t>(n);
  h = (h ^ (h >> 16)) * 0x85ebca6bu;
  h = (h ^ (h >> 13)) * 0xc2b2ae35u;
  return h ^ (h >> 16);
}

uint32_t crypto_id(std::string_view name) {
  const uint32_t hash = murmur3_32(name, 0);
  const uint32_t exponent = hash >> 23 & 0xffu;
  return exponent == 0 || exponent == 0xff ? hash ^ (1u << 23) : hash;
}

CryptoTables::CryptoTables(const Scene& scene, AovSet aovs) {
  const ObjectNames names(scene);
  first_object = names.first_object();
  first_light = names.first_light();
  first_volume = names.first_volume();
  const auto fill = [&](std::vector<uint32_t>& ids, const auto& name) {
    ids.resize(names.count());
    constexpr size_t kChunk = 4096;
    parallel_for((ids.size() + kChunk - 1) / kChunk, [&](size_t chunk) {
      const size_t end = std::min(ids.size(), (chunk + 1) * kChunk);
      for (size_t i = chunk * kChunk; i < end; ++i)
        ids[i] = crypto_id(name(static_cast<uint32_t>(i)));
    });
  };
  if (aovs.has(Aov::kCryptoObject)) fill(object_id, [&](uint32_t i) { return names.object(i); });
  if (aovs.has(Aov::kCryptoAsset)) fill(asset_id, [&](uint32_t i) { return names.asset(i); });
  if (aovs.has(Aov::kCryptoMaterial))
    for (const Material& m : scene.materials()) material_id.push_back(crypto_id(m.name));
}

std::vector<std::pair<std::string, uint32_t>> crypto_manifest(const Scene& scene, Aov level,
                                                              const std::vector<uint32_t>& ids) {
  std::vector<std::pair<std::string, uint32_t>> out;
  const auto add = [&](std::string name) {
    const uint32_t id = crypto_id(name);
    if (std::binary_search(ids.begin(), ids.end(), id)) out.emplace_back(std::move(name), id);
  };
  if (level == Aov::kCryptoMaterial) {
    for (const Material& m : scene.materials()) add(m.name);
  } else {
    const ObjectNames names(scene);
    for (uint32_t i = 0; i < names.count(); ++i)
      add(level == Aov::kCryptoObject ? names.object(i) : names.asset(i));
  }
  std::sort(out.begin(), out.end());
  out.erase(std::unique(out.begin(), out.end()), out.end());
  return out;
}

}  // namespace wavecomb
