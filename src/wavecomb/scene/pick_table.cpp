// SPDX-License-Identifier: Apache-2.0
/// The table that a light is chosen by power with.
#include <algorithm>
#include <cmath>

#include "wavecomb/scene/light_builder.h"

namespace wavecomb {

namespace {

/// Fills the bins of one group: light i has numbers[i] of the bins' 2^shift each, which they sum
/// to.
void fill_bins(std::span<const uint32_t> numbers, uint32_t shift, std::span<uint32_t> bins) {
  const uint32_t size = 1u << shift;
  std::vector<uint32_t> left(bins.size(), 0), small, large;
  std::copy(numbers.begin(), numbers.end(), left.begin());
  for (uint32_t b = 0; b < bins.size(); ++b) {
    bins[b] = b << shift;  // full
    if (left[b] != size) (left[b] < size ? small : large).push_back(b);
  }
  while (!small.empty()) {  // what one lacks another has
    const uint32_t s = small.back(), l = large.back();
    small.pop_back();
    bins[s] = (l << shift) | left[s];
    left[l] -= size - left[s];
    if (left[l] > size) continue;
    large.pop_back();
    if (left[l] < size) small.push_back(l);
  }
}

}  // namespace

PickTable build_pick_table(std::span<const double> weights, size_t first_triangle,
                           std::vector<uint32_t>& bins, std::vector<uint32_t>& numbers) {
  constexpr uint32_t kNumbers = 1u << 24;
  const size_t n = weights.size();
  const std::span<const double> groups[2] = {weights.first(first_triangle),
                                             weights.subspan(first_triangle)};
  bins.clear();
  numbers.assign(n, 0);
  const auto count_lit = [](std::span<const double> of) {
    return static_cast<size_t>(std::count_if(of.begin(), of.end(), [](double w) { return w > 0; }));
  };
  const size_t lit = count_lit(weights), lit_of[2] = {count_lit(groups[0]), count_lit(groups[1])};
  PickTable table;
  if (lit == 0) {  // number 0 for all; some table
    table.split = first_triangle > 0 ? kNumbers : 0;
    table.shift[0] = table.shift[1] = 24;
    bins.assign(1, 0);
    return table;
  }

  // One number in a hundred goes by heads, so that weak lights near by are found. (Every lit light
  // has one of the 2^24 besides.)
  constexpr double floor_share = 0.01;
  const double largest = *std::max_element(weights.begin(), weights.end());
  double sum[2] = {0, 0};
  for (size_t g = 0; g < 2; ++g)
    for (const double w : groups[g]) sum[g] += w / largest;
  const double total = sum[0] + sum[1];
  std::vector<double> shares(n);
  for (size_t i = 0; i < n; ++i)
    shares[i] = weights[i] > 0 ? (1 - floor_share) * (weights[i] / largest / total) +
                                     floor_share / static_cast<double>(lit)
                               : 0;
  const std::span<const double> shares_of[2] = {std::span(shares).first(first_triangle),
                                                std::span(shares).subspan(first_triangle)};

  // The numbers of a group are a multiple of those of its bins, and there are bins for all its
  // lights. Few and large bins stay in the cache; 1024 for all numbers divide them well enough.
  const auto least = [&](size_t g, uint32_t shift) {
    const uint64_t units = (groups[g].size() + (size_t{1} << shift) - 1) >> shift;
    return lit_of[g] > 0 ? units << shift : 0;
  };
  uint32_t unit = 14;
  while (unit > 0 && least(0, unit) + least(1, unit) > kNumbers) --unit;
  double first_share = 0;
  for (const double share : shares_of[0]) first_share += share;
  const auto wanted = static_cast<uint64_t>(std::nearbyint(first_share * kNumbers)) >> unit << unit;
  table.split = static_cast<uint32_t>(std::clamp<uint64_t>(
      wanted, least(0, unit), lit_of[1] > 0 ? kNumbers - least(1, unit) : kNumbers));
  if (lit_of[0] == 0) table.split = 0;
  if (lit_of[1] == 0) table.split = kNumbers;

  const uint32_t numbers_of[2] = {table.split, kNumbers - table.split};
  for (size_t g = 0; g < 2; ++g) {
    if (g == 1) table.triangle_bins = static_cast<uint32_t>(bins.size());
    if (numbers_of[g] == 0) continue;
    const std::span<uint32_t> counts(numbers.data() + (g == 0 ? 0 : first_triangle),
                                     groups[g].size());
    double all = 0, running = 0;
    for (const double share : shares_of[g]) all += share;
    // One number each, and the others by share: rounding the running sum makes the sum exact.
    const auto free = static_cast<double>(numbers_of[g] - lit_of[g]);
    const auto up_to = [&](double part) {
      return static_cast<uint32_t>(std::nearbyint(std::min(1.0, part / all) * free));
    };
    uint32_t given = 0;
    size_t last = 0;
    for (size_t i = 0; i < counts.size(); ++i) {
      if (!(groups[g][i] > 0)) continue;
      last = i;
      running += shares_of[g][i];
      const uint32_t to = up_to(running);
      counts[i] = 1 + to - given;
      given = to;
    }
    counts[last] += static_cast<uint32_t>(free) - given;

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
