// SPDX-License-Identifier: Apache-2.0 Cost of loading and storing records at random positions of an
// array with SIMD instructions: by gathering and scattering 32-bit words, and by copying whole
// records and transposing.
#include <algorithm>
#include <array>
#include <random>
#include <string>
#include <vector>

#include "wavecomb/core/rows/rows.h"
#include "widths.h"

namespace wavecomb::micro {
namespace {

// Number of records, which equals the number of rays in a wave. Records of 16 words take 256 KB,
// which fits the second-level cache.
constexpr uint32_t kRecords = 4096;

struct Records {
  std::vector<float> words;
  std::vector<uint32_t> order;
};

Records make_records(size_t words) {
  Records r{std::vector<float>(kRecords * words, 1.f), std::vector<uint32_t>(kRecords)};
  for (uint32_t i = 0; i < kRecords; ++i) r.order[i] = i;
  std::shuffle(r.order.begin(), r.order.end(), std::mt19937(1));
  return r;
}

template <size_t N, size_t W>
void read_records(benchmark::State& state, bool by_row) {
  using F = Lanes<W>;
  using U = UInt<F>;
  const Records r = make_records(N);
  const Mask<F> all(true);
  for (auto _ : state) {
    F sum(0.f);
    for (uint32_t i = 0; i < kRecords; i += W) {
      const U word = load<U>(r.order.data() + i) * uint32_t{N};
      std::array<F, N> v;
      if (by_row)
        v = load_rows<N, F>(r.words.data(), word, all);
      else
        for (uint32_t k = 0; k < N; ++k) v[k] = gather<F>(r.words.data(), word + k, all);
      for (const F& x : v) sum = sum + x;
    }
    keep<F>(sum);
  }
  count_items(state, "record", kRecords);
}

template <size_t N, size_t W>
void write_records(benchmark::State& state, bool by_row) {
  using F = Lanes<W>;
  using U = UInt<F>;
  Records r = make_records(N);
  const Mask<F> all(true);
  for (auto _ : state) {
    for (uint32_t i = 0; i < kRecords; i += W) {
      const U word = load<U>(r.order.data() + i) * uint32_t{N};
      std::array<F, N> v;
      for (uint32_t k = 0; k < N; ++k) v[k] = F(static_cast<float>(i + k));
      if (by_row)
        store_rows<N, F>(r.words.data(), word, v, all);
      else
        for (uint32_t k = 0; k < N; ++k) scatter<F>(r.words.data(), v[k], word + k, all);
    }
    benchmark::ClobberMemory();
  }
  count_items(state, "record", kRecords);
}

template <size_t N>
void add() {
  for_each_width([]<size_t W>() {
    for (const bool by_row : {false, true}) {
      const std::string tail = std::to_string(N) + "_words" + lanes_label(W);
      benchmark::RegisterBenchmark(((by_row ? "load_rows/" : "gather/") + tail).c_str(),
                                   read_records<N, W>, by_row);
      benchmark::RegisterBenchmark(((by_row ? "store_rows/" : "scatter/") + tail).c_str(),
                                   write_records<N, W>, by_row);
    }
  });
}

const bool registered = [] {
  add<4>();
  add<8>();
  add<16>();
  return true;
}();

}  // namespace
}  // namespace wavecomb::micro
