// SPDX-License-Identifier: Apache-2.0 Cost of ordering a queue of hits: sorting the keys, and
// either moving the queued hits into sorted order or reading them through sorted indices. The
// reported times are per queued hit.

#include <algorithm>
#include <numeric>
#include <random>
#include <vector>

#include "wavecomb/core/rows/rows.h"
#include "wavecomb/schedule/radix_sort.h"
#include "wavecomb/schedule/shading_queue.h"
#include "widths.h"

namespace wavecomb::micro {
namespace {

/// Returns sorting keys as the scheduling policy "material" computes them: the shading program is
/// in the top byte, and the material in the bytes below.
std::vector<uint64_t> material_keys(size_t n, uint32_t materials) {
  std::mt19937 random(1);
  std::vector<uint64_t> keys(n);
  for (uint64_t& key : keys) {
    const uint64_t m = random() % materials;
    key = ((m % 6) << 56) | (m << 24);
  }
  return keys;
}

/// Random 64-bit keys, which need the maximum number of sort passes.
std::vector<uint64_t> random_keys(size_t n) {
  std::mt19937_64 random(1);
  std::vector<uint64_t> keys(n);
  for (uint64_t& key : keys) key = random();
  return keys;
}

void sort_keys(benchmark::State& state, const std::vector<uint64_t>& keys) {
  const size_t n = keys.size();
  RadixSorter sorter(n);
  std::vector<uint32_t> order(n);
  for (auto _ : state) {
    std::copy(keys.begin(), keys.end(), sorter.keys());
    benchmark::DoNotOptimize(sorter.sort(n, order.data()));
  }
  count_items(state, "record", n);
}

void radix_sort_material(benchmark::State& state) {
  sort_keys(state, material_keys(static_cast<size_t>(state.range(0)), 24));
}
BENCHMARK(radix_sort_material)->RangeMultiplier(16)->Range(256, 1 << 20);

void radix_sort_random(benchmark::State& state) {
  sort_keys(state, random_keys(static_cast<size_t>(state.range(0))));
}
BENCHMARK(radix_sort_random)->RangeMultiplier(16)->Range(256, 1 << 20);

void std_stable_sort(benchmark::State& state) {
  const auto n = static_cast<size_t>(state.range(0));
  const std::vector<uint64_t> keys = material_keys(n, 24);
  std::vector<uint32_t> order(n);
  for (auto _ : state) {
    std::iota(order.begin(), order.end(), 0u);
    std::stable_sort(order.begin(), order.end(),
                     [&](uint32_t a, uint32_t b) { return keys[a] < keys[b]; });
    benchmark::DoNotOptimize(order.data());
  }
  count_items(state, "record", n);
}
BENCHMARK(std_stable_sort)->RangeMultiplier(16)->Range(256, 1 << 20);

/// Fills a queue with `n` hits of random materials and sorts it by material.
void fill(ShadingQueue& queue, size_t n) {
  const std::vector<uint64_t> keys = material_keys(n, 24);
  RadixSorter sorter(n);
  std::copy(keys.begin(), keys.end(), sorter.keys());
  queue.size = n;
  queue.ordered = sorter.sort(n, queue.sorted_indices);
}

constexpr size_t kWords = 8;  ///< 32-bit words per queued hit, as in a wave

/// Reads the data and ids of every queued hit once with SIMD loads, like a very inexpensive shader.
float read_all(const ShadingQueue& queue) {
  constexpr size_t kLanes = WAVECOMB_MAX_LANES;
  using F = Lanes<kLanes>;
  using U = UInt<F>;
  using Q = ShadingQueue;
  const Mask<F> all(true);
  F sum(0.f);
  for (size_t i = 0; i + kLanes <= queue.size; i += kLanes) {
    const U at = queue.ordered ? load<U>(queue.sorted_indices + i)
                               : lane_index<F>() + static_cast<uint32_t>(i);
    for (const F& word : load_rows<kWords, F>(queue.row(0), at * uint32_t{kWords}, all))
      sum = sum + word;
    for (uint32_t c = 0; c < Q::kColumns; ++c) {
      const uint32_t* column = queue.uints(static_cast<Q::Column>(c));
      const U id = queue.ordered ? gather<U>(column, at, Mask<U>(all)) : load<U>(column + i);
      sum = sum + F(Int<F>(id));
    }
  }
  return lane(sum, 0);
}

void read_in_arrival_order(benchmark::State& state) {
  const auto n = static_cast<size_t>(state.range(0));
  ShadingQueue queue(n, kWords);
  queue.size = n;
  for (auto _ : state) benchmark::DoNotOptimize(read_all(queue));
  count_items(state, "record", n);
}
BENCHMARK(read_in_arrival_order)->RangeMultiplier(16)->Range(256, 1 << 20);

void gather_by_index(benchmark::State& state) {
  const auto n = static_cast<size_t>(state.range(0));
  ShadingQueue queue(n, kWords);
  fill(queue, n);
  for (auto _ : state) benchmark::DoNotOptimize(read_all(queue));
  count_items(state, "record", n);
}
BENCHMARK(gather_by_index)->RangeMultiplier(16)->Range(256, 1 << 20);

void materialize_then_read(benchmark::State& state) {
  const auto n = static_cast<size_t>(state.range(0));
  ShadingQueue queue(n, kWords);
  fill(queue, n);
  for (auto _ : state) {
    queue.ordered = true;
    queue.materialize();
    benchmark::DoNotOptimize(read_all(queue));
  }
  count_items(state, "record", n);
}
BENCHMARK(materialize_then_read)->RangeMultiplier(16)->Range(256, 1 << 20);

}  // namespace
}  // namespace wavecomb::micro
