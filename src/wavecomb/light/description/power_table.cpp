// SPDX-License-Identifier: Apache-2.0
/// Alias tables for light selection by power.
#include <algorithm>
#include <cmath>

#include "wavecomb/light/description/light_builder.h"
#include "wavecomb/scene/parallel.h"

namespace wavecomb {

namespace {

constexpr size_t kBand = size_t{1} << 16;

/// Fills the alias bins of one group, so that light i gets numbers[i] random numbers. Each bin has
/// 2^shift random numbers, and the sum of `numbers` must fill all bins. Processes bins from the
/// last to the first. A bin that is not full takes its missing random numbers from the last bin
/// with a surplus. If the last bin then has a deficit, it is processed next.
void fill_bins(std::span<const uint32_t> numbers, uint32_t shift, std::span<uint32_t> bins) {
  const uint32_t size = 1u << shift;
  const auto number_of = [&](size_t bin) { return bin < numbers.size() ? numbers[bin] : 0u; };
  for (uint32_t b = 0; b < bins.size(); ++b) bins[b] = b << shift;  // all full
  size_t next = bins.size(), overfull = bins.size();
  uint32_t left = size;  // number of random numbers left in bin `overfull`
  for (;;) {
    while (next > 0 && number_of(next - 1) >= size) --next;
    if (next == 0) return;
    size_t underfull = --next;
    for (uint32_t has = number_of(underfull); has < size;) {
      while (left <= size) left = number_of(--overfull);
      bins[underfull] = (static_cast<uint32_t>(overfull) << shift) | has;
      left -= size - has;
      if (left >= size) break;
      underfull = overfull;
      has = left;
    }
  }
}

/// Distributes random numbers in `counts`: one to each light that emits, and `free` further numbers
/// in proportion to `shares`. Replaces `shares` by their running sums.
void count_numbers(std::span<const double> weights, std::span<double> shares, size_t free,
                   std::span<uint32_t> counts) {
  double running = 0;
  for (double& share : shares) share = running += share;
  const double all = running;
  // Round running sums instead of single shares, so that the total is exact.
  const auto up_to = [&](double part) {
    return static_cast<uint32_t>(
        std::nearbyint(std::min(1.0, part / all) * static_cast<double>(free)));
  };
  parallel_bands(counts.size(), kBand, [&](size_t begin, size_t end) {
    uint32_t before = begin > 0 ? up_to(shares[begin - 1]) : 0;
    for (size_t i = begin; i < end; ++i) {
      const uint32_t to = up_to(shares[i]);
      counts[i] = weights[i] > 0 ? 1 + to - before : 0;
      before = to;
    }
  });
}

}  // namespace

PowerTable build_power_table(std::span<const double> weights, size_t first_triangle,
                             std::vector<uint32_t>& bins, std::vector<uint32_t>& numbers) {
  constexpr uint32_t kNumbers = 1u << 24;
  const size_t n = weights.size();
  const std::span<const double> groups[2] = {weights.first(first_triangle),
                                             weights.subspan(first_triangle)};
  bins.clear();
  numbers.assign(n, 0);
  const auto count_emitting = [](std::span<const double> of) {
    return static_cast<size_t>(std::count_if(of.begin(), of.end(), [](double w) { return w > 0; }));
  };
  const size_t emitting = count_emitting(weights),
               emitting_of[2] = {count_emitting(groups[0]), count_emitting(groups[1])};
  PowerTable table;
  // If no light emits, no random number selects a light, and any valid table suffices.
  if (emitting == 0) {
    table.split = first_triangle > 0 ? kNumbers : 0;
    table.shift[0] = table.shift[1] = 24;
    bins.assign(1, 0);
    return table;
  }

  // One random number in a hundred is distributed evenly, so that weak nearby lights are sampled.
  // In addition, every light that emits gets one of the 2^24 random numbers.
  constexpr double floor_share = 0.01;
  const double largest = *std::max_element(weights.begin(), weights.end());
  std::vector<double> shares(n);
  const std::span<double> shares_of[2] = {std::span(shares).first(first_triangle),
                                          std::span(shares).subspan(first_triangle)};
  parallel_bands(n, kBand, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) shares[i] = weights[i] / largest;
  });
  double sum[2] = {0, 0};
  for (size_t g = 0; g < 2; ++g)
    for (const double share : shares_of[g]) sum[g] += share;
  const double total = sum[0] + sum[1];
  parallel_bands(n, kBand, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i)
      shares[i] = weights[i] > 0 ? (1 - floor_share) * (shares[i] / total) +
                                       floor_share / static_cast<double>(emitting)
                                 : 0;
  });

  // The number of random numbers of each group is a multiple of the bin size, and each group has at
  // least one bin per light. Few, large bins are preferred because they stay in the cache; 1024
  // bins for all random numbers give enough resolution.
  const auto least = [&](size_t g, uint32_t shift) {
    const uint64_t units = (groups[g].size() + (size_t{1} << shift) - 1) >> shift;
    return emitting_of[g] > 0 ? units << shift : 0;
  };
  uint32_t unit = 14;
  while (unit > 0 && least(0, unit) + least(1, unit) > kNumbers) --unit;
  double first_share = 0;
  for (const double share : shares_of[0]) first_share += share;
  const auto wanted = static_cast<uint64_t>(std::nearbyint(first_share * kNumbers)) >> unit << unit;
  table.split = static_cast<uint32_t>(std::clamp<uint64_t>(
      wanted, least(0, unit), emitting_of[1] > 0 ? kNumbers - least(1, unit) : kNumbers));
  if (emitting_of[0] == 0) table.split = 0;
  if (emitting_of[1] == 0) table.split = kNumbers;

  const uint32_t numbers_of[2] = {table.split, kNumbers - table.split};
  for (size_t g = 0; g < 2; ++g) {
    if (g == 1) table.triangle_bins = static_cast<uint32_t>(bins.size());
    if (numbers_of[g] == 0) continue;
    const std::span<uint32_t> counts(numbers.data() + (g == 0 ? 0 : first_triangle),
                                     groups[g].size());
    count_numbers(groups[g], shares_of[g], numbers_of[g] - emitting_of[g], counts);

    uint32_t shift = unit;
    while (numbers_of[g] >> shift < counts.size()) --shift;
    table.shift[g] = shift;
    const size_t first = bins.size();
    bins.resize(first + (numbers_of[g] >> shift));
    fill_bins(counts, shift, std::span(bins).subspan(first));
  }
  return table;
}

}  // namespace wavecomb
