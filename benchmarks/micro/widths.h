// SPDX-License-Identifier: Apache-2.0
/// Helpers for benchmarks of SIMD code: loops over lane widths, and a counter of the time per item.
#pragma once

#include <benchmark/benchmark.h>

#include <string>

#include "wavecomb/core/lanes/lanes.h"

namespace wavecomb::micro {

/// Calls `f.operator()<W>()` for each lane width `W` in the build.
template <typename Function>
void for_each_width(const Function& f) {
#ifdef WAVECOMB_HAS_LANES_1
  f.template operator()<1>();
#endif
#ifdef WAVECOMB_HAS_LANES_4
  f.template operator()<4>();
#endif
#ifdef WAVECOMB_HAS_LANES_8
  f.template operator()<8>();
#endif
#ifdef WAVECOMB_HAS_LANES_16
  f.template operator()<16>();
#endif
}

inline std::string lanes_label(size_t width) {
  return "/lanes:" + std::to_string(width);
}

/// Adds a counter `seconds_per_<item>` to the benchmark's output. Each iteration processes `n`
/// items.
inline void count_items(benchmark::State& state, const char* item, size_t n) {
  using benchmark::Counter;
  state.counters[std::string("seconds_per_") + item] =
      Counter(static_cast<double>(n), Counter::kIsIterationInvariantRate | Counter::kInvert);
}

/// Prevents the compiler from removing the computation of a value.
template <typename F>
void keep(const F& value) {
  if constexpr (kIsScalar<F>) {
    benchmark::DoNotOptimize(value);
  } else {
    const float first = lane(value, 0);
    benchmark::DoNotOptimize(first);
  }
}

}  // namespace wavecomb::micro
