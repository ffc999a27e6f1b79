// SPDX-License-Identifier: Apache-2.0
/// Shared helpers for tests of lane kernels: loops over lane widths, and bitwise comparison.
#pragma once

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <limits>
#include <random>
#include <vector>

#include "numbers_testing.h"
#include "wavecomb/core/lanes/lanes.h"
#include "wavecomb/core/vec.h"

namespace wavecomb::lane_testing {

using numbers_testing::kInf;
using numbers_testing::kNan;

/// Calls f.operator()<F>() for each packet type with kernels in this build: the widest type in
/// `make test`, and all widths in `make test-long`.
template <typename Function>
void for_each_packet([[maybe_unused]] const Function& f) {
#ifdef WAVECOMB_HAS_LANES_4
  f.template operator()<FloatP<4>>();
#endif
#ifdef WAVECOMB_HAS_LANES_8
  f.template operator()<FloatP<8>>();
#endif
#ifdef WAVECOMB_HAS_LANES_16
  f.template operator()<FloatP<16>>();
#endif
}
/// Calls f.operator()<F>() for float, then for each packet type.
template <typename Function>
void for_each_lane_type(const Function& f) {
  f.template operator()<float>();
  for_each_packet(f);
}

/// Makes a mask in which lane i is set if bit i of `bits` is set.
template <typename F>
inline Mask<F> make_mask(uint32_t bits) {
  if constexpr (kIsScalar<F>) {
    return (bits & 1u) != 0;
  } else {
    const UInt<F> bit = (UInt<F>(bits) >> lane_index<F>()) & 1u;
    return Mask<F>(bit == UInt<F>(1u));
  }
}

/// Returns bit patterns to test as masks of W lanes: all patterns for up to 8 lanes, a selection
/// for 16.
template <typename F>
inline std::vector<uint32_t> mask_patterns() {
  constexpr uint32_t kAll = (1u << kWidth<F>)-1u;
  std::vector<uint32_t> patterns;
  if constexpr (kWidth<F> <= 8) {
    for (uint32_t b = 0; b <= kAll; ++b) patterns.push_back(b);
  } else {
    patterns = {0u, kAll, 1u, 1u << (kWidth<F> - 1)};
    std::mt19937 rng(7);
    for (int i = 0; i < 500; ++i) patterns.push_back(rng() & kAll);
  }
  return patterns;
}

/// Whether two floats have the same bits, or both are NaN.
inline bool same_bits(float a, float b) {
  return std::bit_cast<uint32_t>(a) == std::bit_cast<uint32_t>(b) || (a != a && b != b);
}

/// Returns floats that are likely to cause errors: zeros, denormals, bounds, infinities, NaN, and
/// values in between.
inline std::vector<float> awkward_floats() {
  std::vector<float> all = {0.f,        0x1p-149f,
                            0x1p-130f,  0x1p-126f,
                            1e-20f,     1e-7f,
                            0.1f,       0x1.fffffep-2f,
                            0.5f,       0x1.fffffep-1f,
                            1.f,        1.5f,
                            2.f,        2.5f,
                            3.f,        100.f,
                            8388607.5f, 16777216.f,
                            1e20f,      0x1.fffffep127f,
                            kInf,       kNan};
  for (size_t i = all.size(); i-- > 0;) all.push_back(-all[i]);
  return all;
}

/// Appends n random floats between lo and hi to `values` and pads the length to a multiple of 16.
inline std::vector<float> padded(std::vector<float> values, size_t n, float lo, float hi,
                                 uint32_t seed = 1) {
  std::mt19937 rng(seed);
  std::uniform_real_distribution<float> uniform(lo, hi);
  for (size_t i = 0; i < n; ++i) values.push_back(uniform(rng));
  while (values.size() % 16 != 0) values.push_back(values.front());
  return values;
}

/// Applies the function `f` to all values of x, in lanes of type F.
template <typename F, typename Function>
std::vector<float> map(const std::vector<float>& x, const Function& f) {
  std::vector<float> y(x.size());
  for (size_t i = 0; i < x.size(); i += kWidth<F>) store(y.data() + i, F(f(load<F>(x.data() + i))));
  return y;
}
template <typename F, typename Function>
std::vector<float> map(const std::vector<float>& x, const std::vector<float>& y,
                       const Function& f) {
  std::vector<float> z(x.size());
  for (size_t i = 0; i < x.size(); i += kWidth<F>) {
    store(z.data() + i, F(f(load<F>(x.data() + i), load<F>(y.data() + i))));
  }
  return z;
}

inline void expect_same(const std::vector<float>& a, const std::vector<float>& b,
                        const char* what) {
  ASSERT_EQ(a.size(), b.size());
  for (size_t i = 0; i < a.size(); ++i) {
    ASSERT_TRUE(same_bits(a[i], b[i]))
        << what << " differs at " << i << ": " << a[i] << " and " << b[i];
  }
}

/// Expects bitwise equal results of f for float and for packets.
template <typename Function>
void expect_lanes_agree(const std::vector<float>& x, const Function& f, const char* what) {
  const auto scalar = map<float>(x, f);
  for_each_packet([&]<typename F>() { expect_same(scalar, map<F>(x, f), what); });
}
template <typename Function>
void expect_lanes_agree(const std::vector<float>& x, const std::vector<float>& y, const Function& f,
                        const char* what) {
  const auto scalar = map<float>(x, y, f);
  for_each_packet([&]<typename F>() { expect_same(scalar, map<F>(x, y, f), what); });
}

/// Returns all pairs of `values` as two columns, padded to a multiple of 16.
inline std::array<std::vector<float>, 2> all_pairs(const std::vector<float>& values) {
  std::array<std::vector<float>, 2> pairs;
  for (const float a : values)
    for (const float b : values) {
      pairs[0].push_back(a);
      pairs[1].push_back(b);
    }
  for (auto& column : pairs)
    while (column.size() % 16 != 0) column.push_back(1.f);
  return pairs;
}

/// Returns the error of y in units in the last place of the float closest to `exact`.
inline double ulps(float y, double exact) {
  const float nearest = static_cast<float>(exact);
  if (y == nearest) return 0;
  if (!std::isfinite(nearest) || !std::isfinite(y))
    return std::isnan(nearest) && std::isnan(y) ? 0 : 1e30;
  const double magnitude = std::max(std::fabs(exact), 0x1p-126);
  const double ulp = std::ldexp(1.0, std::ilogb(magnitude) - 23);
  return std::fabs(static_cast<double>(y) - exact) / ulp;
}

}  // namespace wavecomb::lane_testing
