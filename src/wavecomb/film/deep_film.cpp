// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/film/deep_film.h"

#include <algorithm>
#include <array>
#include <cstring>
#include <limits>
#include <numeric>

#include "wavecomb/core/error.h"
#include "wavecomb/film/storage.h"

namespace wavecomb {
namespace {

static_assert(kMaxDeepSamples <= 255, "counted in a byte");

/// Returns the length of a depth range relative to the depth of its far end.
float spread(float front, float back) {
  return back > 0 ? (back - front) / back : 0.f;
}

/// Adds `from` to `into`.
void merge(DeepBin& into, const DeepBin& from) {
  into.r += from.r;
  into.g += from.g;
  into.b += from.b;
  into.front = std::min(into.front, from.front);
  into.back = std::max(into.back, from.back);
  into.count += from.count;
  into.in_volume += from.in_volume;
}

}  // namespace

DeepFilm::DeepFilm(size_t pixels, const DeepLimits& limits)
    : limits_(limits), used_(pixels), bins_(pixels * limits.most) {}

void DeepFilm::add(size_t pixel, float z, bool in_volume, const float* rgb) {
  const DeepBin sample{rgb[0], rgb[1], rgb[2], z, z, 1, in_volume ? 1u : 0u};
  const uint32_t n = used_[pixel];
  uint32_t at = 0;  // index of the first bin that does not end in front of z
  while (at < n && bin(pixel, at).back < z) ++at;
  const auto spread_with = [&](uint32_t i) {
    if (i >= n) return std::numeric_limits<float>::infinity();
    const DeepBin& b = bin(pixel, i);
    if (b.front <= z && z <= b.back) return 0.f;
    return spread(std::min(b.front, z), std::max(b.back, z));
  };
  const float before = at > 0 ? spread_with(at - 1) : std::numeric_limits<float>::infinity();
  const float here = spread_with(at);
  if (here > limits_.tolerance && before > limits_.tolerance)
    insert(pixel, at, sample);
  else
    merge(bin(pixel, here <= before ? at : at - 1), sample);
}

void DeepFilm::insert(size_t pixel, uint32_t at, const DeepBin& added) {
  const uint32_t n = used_[pixel];
  std::array<DeepBin, kMaxDeepSamples + 1> all;
  for (uint32_t i = 0, to = 0; to <= n; ++to) all[to] = to == at ? added : bin(pixel, i++);
  uint32_t size = n + 1;
  if (size > limits_.most) {
    uint32_t closest = 0;
    for (uint32_t i = 1; i + 1 < size; ++i)
      if (spread(all[i].front, all[i + 1].back) < spread(all[closest].front, all[closest + 1].back))
        closest = i;
    merge(all[closest], all[closest + 1]);
    std::copy(all.begin() + closest + 2, all.begin() + size, all.begin() + closest + 1);
    --size;
  }
  for (uint32_t i = 0; i < size; ++i) bin(pixel, i) = all[i];
  used_[pixel] = static_cast<uint8_t>(size);
}

DeepLayer DeepFilm::layer(const std::vector<uint32_t>& samples) const {
  DeepLayer out;
  size_t all = 0;
  for (const uint8_t n : used_) all += n;
  out.counts.assign(used_.begin(), used_.end());
  out.values.reserve(all * DeepLayer::kChannels);
  for (size_t pixel = 0; pixel < used_.size(); ++pixel) {
    uint32_t left = samples[pixel];  // N r_i, an exact integer
    for (uint32_t i = 0; i < used_[pixel]; ++i) {
      const DeepBin& b = bin(pixel, i);
      const double scale = inverse_count(left);
      const float middle = 0.5f * (b.front + b.back);
      const bool is_thick = b.in_volume > 0;
      for (const double value :
           {b.r * scale, b.g * scale, b.b * scale, b.count * scale,
            double{is_thick ? b.front : middle}, double{is_thick ? b.back : middle}})
        out.values.push_back(static_cast<float>(value));
      left -= b.count;
    }
  }
  return out;
}

std::vector<std::byte> DeepFilm::packed() const {
  const size_t bins = std::accumulate(used_.begin(), used_.end(), size_t{0});
  std::vector<std::byte> out(used_.size() + bins * sizeof(DeepBin));
  if (empty()) return out;
  std::memcpy(out.data(), used_.data(), used_.size());
  std::byte* to = out.data() + used_.size();
  for (size_t pixel = 0; pixel < used_.size(); ++pixel)
    for (uint32_t i = 0; i < used_[pixel]; ++i, to += sizeof(DeepBin))
      std::memcpy(to, &bin(pixel, i), sizeof(DeepBin));
  return out;
}

void DeepFilm::unpack(std::span<const std::byte> bytes) {
  const auto check = [](bool is_symbol) {
    if (!is_symbol) throw Error("the checkpoint has deep samples of a different image; start anew");
  };
  check(bytes.size() >= used_.size());
  std::vector<uint8_t> used(used_.size());
  if (!used.empty()) std::memcpy(used.data(), bytes.data(), used.size());
  check(std::all_of(used.begin(), used.end(), [&](uint8_t n) { return n <= limits_.most; }));
  const size_t bins = std::accumulate(used.begin(), used.end(), size_t{0});
  check(bytes.size() == used.size() + bins * sizeof(DeepBin));
  const std::byte* from = bytes.data() + used.size();
  used_ = std::move(used);
  for (size_t pixel = 0; pixel < used_.size(); ++pixel)
    for (uint32_t i = 0; i < used_[pixel]; ++i, from += sizeof(DeepBin))
      std::memcpy(&bin(pixel, i), from, sizeof(DeepBin));
}

}  // namespace wavecomb
