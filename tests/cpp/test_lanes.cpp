// SPDX-License-Identifier: Apache-2.0
/// Every operation of core/lanes/lanes.h at every width, compared with scalar loops.
#include "lane_testing.h"

#include <cstring>
#include <numeric>

#include "wavecomb/core/denormals.h"

namespace wavecomb {
namespace {

using namespace lane_testing;

TEST(Lanes, WidthsAndTypes) {
  static_assert(kWidth<float> == 1 && kIsScalar<float>);
  static_assert(kWidth<FloatP<4>> == 4 && !kIsScalar<FloatP<4>>);
  static_assert(std::is_same_v<Lanes<1>, float> && std::is_same_v<Lanes<16>, FloatP<16>>);
  static_assert(std::is_same_v<UInt<float>, uint32_t> && std::is_same_v<Mask<float>, bool>);
  static_assert(sizeof(FloatP<16>) == 64 && sizeof(UInt<FloatP<8>>) == 32);
  static_assert(std::is_same_v<UInt64<float>, uint64_t> && kWidth<UInt64<FloatP<8>>> == 8);
}

TEST(Lanes, MinAndMaxTakeTheSecondWhereEitherIsNan) {
  const auto [a, b] = all_pairs(awkward_floats());
  for_each_lane_type([&, &a = a, &b = b]<typename F>() {
    const auto lo = map<F>(a, b, [](auto x, auto y) { return min(x, y); });
    const auto hi = map<F>(a, b, [](auto x, auto y) { return max(x, y); });
    for (size_t i = 0; i < a.size(); ++i) {
      // Signed zeros compare equal, so the second operand is returned.
      ASSERT_TRUE(same_bits(lo[i], a[i] < b[i] ? a[i] : b[i])) << a[i] << ", " << b[i];
      ASSERT_TRUE(same_bits(hi[i], a[i] > b[i] ? a[i] : b[i])) << a[i] << ", " << b[i];
    }
  });
  EXPECT_EQ(max(kNan, 3.f), 3.f);
  EXPECT_TRUE(std::isnan(max(3.f, kNan)));
}

TEST(Lanes, ClampSendsNanToTheLowerBound) {
  const auto x = padded(awkward_floats(), 0, 0, 1);
  for_each_lane_type([&]<typename F>() {
    const auto y = map<F>(x, [](auto v) { return clamp(v, decltype(v)(-1.f), decltype(v)(2.f)); });
    for (size_t i = 0; i < x.size(); ++i) {
      const float expected = x[i] > -1.f ? (x[i] < 2.f ? x[i] : 2.f) : -1.f;
      ASSERT_TRUE(same_bits(y[i], expected)) << x[i];
    }
  });
}

template <typename F, typename Number>
concept Divides = requires(F x, Number n) { x / n; } || requires(F x, Number n) { x /= n; };

TEST(Lanes, PacketsAreNotDividedByNumbers) {
  static_assert(!Divides<FloatP<4>, float> && !Divides<FloatP<8>, float>);
  static_assert(!Divides<FloatP<16>, float> && !Divides<FloatP<8>, double>);
  static_assert(!Divides<FloatP<16>, int> && !Divides<FloatP<64>, float>);
  static_assert(Divides<FloatP<8>, FloatP<8>> && Divides<float, float>);
  static_assert(Divides<UInt<FloatP<8>>, uint32_t>);
  // A packet division equals scalar division; multiplication by the reciprocal does not.
  const auto x = padded({}, 5000, 0.f, 1.f, 4);
  int reciprocal_differs = 0;
  for (const float number : {3.f, 7.f, 49.f, 90.f, 0.7f}) {
    expect_lanes_agree(x, [=](auto v) { return v / decltype(v)(number); }, "a number");
    for (const float v : x) reciprocal_differs += !same_bits(v / number, v * (1.f / number));
  }
  EXPECT_GT(reciprocal_differs, 1000);
}

TEST(Lanes, ArithmeticRoundsAlike) {
  const auto awkward = all_pairs(awkward_floats());
  auto a = padded(awkward[0], 5000, -1e4f, 1e4f, 2), b = padded(awkward[1], 5000, -3.f, 3.f, 3);
  expect_lanes_agree(a, b, [](auto x, auto y) { return x + y; }, "+");
  expect_lanes_agree(a, b, [](auto x, auto y) { return x - y; }, "-");
  expect_lanes_agree(a, b, [](auto x, auto y) { return x * y; }, "*");
  expect_lanes_agree(a, b, [](auto x, auto y) { return x / y; }, "/");
  expect_lanes_agree(a, b, [](auto x, auto y) { return fma(x, y, x); }, "fma");
  expect_lanes_agree(a, b, [](auto x, auto y) { return fnma(x, y, y); }, "fnma");
  expect_lanes_agree(a, b, [](auto x, auto y) { return copysign(x, y); }, "copysign");
  expect_lanes_agree(a, [](auto x) { return sqrt(x); }, "sqrt");
  expect_lanes_agree(a, [](auto x) { return safe_sqrt(x); }, "safe_sqrt");
  expect_lanes_agree(a, [](auto x) { return abs(x); }, "abs");
  expect_lanes_agree(a, [](auto x) { return floor(x); }, "floor");
  expect_lanes_agree(a, [](auto x) { return sqr(x); }, "sqr");
  for (size_t i = 0; i < a.size(); ++i) {
#if defined(__FMA__) || defined(__ARM_FEATURE_FMA)
    ASSERT_TRUE(same_bits(fma(a[i], b[i], a[i]), std::fma(a[i], b[i], a[i])));
#endif
    ASSERT_TRUE(same_bits(sqrt(a[i]), std::sqrt(a[i])));
    ASSERT_TRUE(same_bits(floor(a[i]), std::floor(a[i])));
    ASSERT_TRUE(same_bits(abs(a[i]), std::fabs(a[i])));
    ASSERT_TRUE(same_bits(copysign(a[i], b[i]), std::copysign(a[i], b[i])));
  }
  EXPECT_EQ(safe_sqrt(-1.f), 0.f);
  EXPECT_EQ(safe_sqrt(kNan), 0.f);
}

TEST(Lanes, FiniteAndBits) {
  const auto x = padded(awkward_floats(), 100, -1e30f, 1e30f);
  for_each_lane_type([&]<typename F>() {
    const auto finite = map<F>(x, [](auto v) {
      using G = decltype(v);
      return select(is_finite(v), G(1.f), G(0.f));
    });
    for (size_t i = 0; i < x.size(); ++i)
      ASSERT_EQ(finite[i], std::isfinite(x[i]) ? 1.f : 0.f) << x[i];
    const auto round_trip =
        map<F>(x, [](auto v) { return bits_float<decltype(v)>(float_bits<decltype(v)>(v)); });
    ASSERT_EQ(0, std::memcmp(x.data(), round_trip.data(), x.size() * 4));
  });
}

TEST(Lanes, ConversionsToIntegersAndBack) {
  const auto x =
      padded({0.f, -0.f, 0.99f, -0.99f, 1.f, -1.f, 2147483520.f, -2147483648.f, 16777215.f}, 1000,
             -1e9f, 1e9f);
  for_each_lane_type([&]<typename F>() {
    for (size_t i = 0; i < x.size(); i += kWidth<F>) {
      const Int<F> n = to_int<F>(load<F>(x.data() + i));
      int32_t out[16];
      store(out, n);
      for (size_t k = 0; k < kWidth<F>; ++k) ASSERT_EQ(out[k], static_cast<int32_t>(x[i + k]));
      float back[16];
      store(back, F(n));
      for (size_t k = 0; k < kWidth<F>; ++k) ASSERT_EQ(back[k], static_cast<float>(out[k]));
    }
  });
}

TEST(Lanes, UnsignedArithmeticWrapsAndShiftsIn0) {
  std::mt19937 rng(5);
  std::vector<uint32_t> a(64), b(64);
  for (auto& v : a) v = static_cast<uint32_t>(rng());
  for (auto& v : b) v = static_cast<uint32_t>(rng());
  for_each_lane_type([&]<typename F>() {
    using U = UInt<F>;
    for (size_t i = 0; i < a.size(); i += kWidth<F>) {
      const U x = load<U>(a.data() + i), y = load<U>(b.data() + i);
      const U shift = y & 31u;
      uint32_t out[8][16];
      store(out[0], U(x + y));
      store(out[1], U(x - y));
      store(out[2], U(x * y));
      store(out[3], U((x & y) ^ (x | y)));
      store(out[4], U(x >> 7));
      store(out[5], U(x << 9));
      store(out[6], U(x >> shift));
      store(out[7], U(select(Mask<F>(x < y), x, y)));
      for (size_t k = 0; k < kWidth<F>; ++k) {
        const uint32_t p = a[i + k], q = b[i + k];
        ASSERT_EQ(out[0][k], p + q);
        ASSERT_EQ(out[1][k], p - q);
        ASSERT_EQ(out[2][k], p * q);
        ASSERT_EQ(out[3][k], p ^ q);
        ASSERT_EQ(out[4][k], p >> 7);
        ASSERT_EQ(out[5][k], p << 9);
        ASSERT_EQ(out[6][k], p >> (q & 31u));
        ASSERT_EQ(out[7][k], p < q ? p : q);  // unsigned comparison
      }
    }
  });
}

TEST(Lanes, Masks) {
  for_each_lane_type([]<typename F>() {
    constexpr uint32_t kAll = (1u << kWidth<F>)-1u;
    for (const uint32_t bits : mask_patterns<F>()) {
      const Mask<F> m = make_mask<F>(bits);
      ASSERT_EQ(lane_bits<F>(m), bits);
      ASSERT_EQ(any(m), bits != 0);
      ASSERT_EQ(all(m), bits == kAll);
      ASSERT_EQ(none(m), bits == 0);
      ASSERT_EQ(count<F>(m), static_cast<uint32_t>(std::popcount(bits)));
      ASSERT_EQ(lane_bits<F>(not_(m)), ~bits & kAll);
      ASSERT_EQ(any(not_(m)), bits != kAll);
      ASSERT_EQ(all(not_(m)), bits == 0);
      const uint32_t other = (bits * 0x9e3779b9u >> 9) & kAll;
      ASSERT_EQ(lane_bits<F>(Mask<F>(m & make_mask<F>(other))), bits & other);
      ASSERT_EQ(lane_bits<F>(Mask<F>(m | make_mask<F>(other))), bits | other);
      ASSERT_EQ(lane_bits<UInt<F>>(Mask<UInt<F>>(m)), bits);
    }
    for (size_t n = 0; n <= kWidth<F> + 3; ++n) {
      ASSERT_EQ(lane_bits<F>(first_lanes<F>(n)), n >= kWidth<F> ? kAll : (1u << n) - 1u);
    }
    ASSERT_TRUE(all(Mask<F>(true)));
    ASSERT_TRUE(none(Mask<F>(false)));
  });
}

TEST(Lanes, SelectLoadStoreLane) {
  float a[16], b[16];
  std::iota(a, a + 16, 1.f);
  std::iota(b, b + 16, 101.f);
  for_each_lane_type([&]<typename F>() {
    for (const uint32_t bits : mask_patterns<F>()) {
      const F x = load<F>(a), y = load<F>(b);
      const F s = select(make_mask<F>(bits), x, y);
      for (size_t k = 0; k < kWidth<F>; ++k) {
        ASSERT_EQ(lane(s, k), (bits >> k & 1u) ? a[k] : b[k]);
        ASSERT_EQ(lane(lane_index<F>(), k), k);
      }
      if (bits != 0) {
        ASSERT_EQ(first_active(x, make_mask<F>(bits)), a[std::countr_zero(bits)]);
      }
    }
    alignas(64) char bytes[80];
    for (size_t offset = 0; offset < 8; ++offset) {
      store(bytes + offset, load<F>(a));
      float out[16];
      std::memcpy(out, bytes + offset, 4 * kWidth<F>);
      ASSERT_EQ(0, std::memcmp(out, a, 4 * kWidth<F>));
      ASSERT_EQ(lane(load<F>(bytes + offset), kWidth<F> - 1), a[kWidth<F> - 1]);
    }
  });
}

TEST(Lanes, GatherReadsActiveLanesOnly) {
  std::vector<float> base(1000);
  std::iota(base.begin(), base.end(), 0.5f);
  std::mt19937 rng(11);
  for_each_lane_type([&]<typename F>() {
    using U = UInt<F>;
    for (const uint32_t bits : mask_patterns<F>()) {
      uint32_t index[16], wild[16];
      for (size_t k = 0; k < 16; ++k) {
        index[k] = static_cast<uint32_t>(rng()) % 1000u;
        wild[k] = (bits >> k & 1u) ? index[k] : 0x7fffff00u;
      }
      const U i = load<U>(wild);
      const Mask<F> m = make_mask<F>(bits);
      const F value = gather<F>(base.data(), i, m);
      const U word = gather<U>(base.data(), i, Mask<U>(m));
      for (size_t k = 0; k < kWidth<F>; ++k) {
        ASSERT_EQ(lane(value, k), (bits >> k & 1u) ? base[index[k]] : 0.f);
        ASSERT_EQ(lane(word, k), (bits >> k & 1u) ? std::bit_cast<uint32_t>(base[index[k]]) : 0u);
      }
    }
  });
}

TEST(Lanes, GatherAtReadsEachLanesOwnArray) {
  std::vector<std::vector<float>> arrays(20);
  for (size_t j = 0; j < arrays.size(); ++j) {
    arrays[j].resize(50);
    std::iota(arrays[j].begin(), arrays[j].end(), static_cast<float>(1000 * j));
  }
  std::mt19937 rng(13);
  for_each_lane_type([&]<typename F>() {
    using U = UInt<F>;
    for (const uint32_t bits : mask_patterns<F>()) {
      uint64_t address[16];
      uint32_t index[16];
      float expected[16];
      for (size_t k = 0; k < 16; ++k) {
        const auto& array = arrays[rng() % arrays.size()];
        index[k] = static_cast<uint32_t>(rng()) % 50u;
        const bool on = (bits >> k & 1u) != 0;
        address[k] = on ? reinterpret_cast<uint64_t>(array.data()) : 0;
        expected[k] = on ? array[index[k]] : 0.f;
      }
      const Mask<F> m = make_mask<F>(bits);
      const F value = gather_at<F>(load<UInt64<F>>(address), load<U>(index), m);
      const U word = gather_at<U>(load<UInt64<U>>(address), load<U>(index), Mask<U>(m));
      for (size_t k = 0; k < kWidth<F>; ++k) {
        ASSERT_EQ(lane(value, k), expected[k]);
        ASSERT_EQ(lane(word, k), std::bit_cast<uint32_t>(expected[k]));
      }
    }
  });
}

TEST(Lanes, ScatterWritesActiveLanesOnly) {
  float values[16];
  std::iota(values, values + 16, 1.f);
  for_each_lane_type([&]<typename F>() {
    using U = UInt<F>;
    for (const uint32_t bits : mask_patterns<F>()) {
      uint32_t index[16];
      for (uint32_t k = 0; k < 16; ++k) index[k] = (k * 37u + bits) % 101u;
      std::vector<float> base(101, -1.f), expected = base;
      std::vector<uint32_t> words(101, 9u), expected_words = words;
      scatter<F>(base.data(), load<F>(values), load<U>(index), make_mask<F>(bits));
      scatter<U>(words.data(), load<U>(index), load<U>(index), Mask<U>(make_mask<F>(bits)));
      for (size_t k = 0; k < kWidth<F>; ++k) {
        if ((bits >> k & 1u) == 0) continue;
        expected[index[k]] = values[k];
        expected_words[index[k]] = index[k];
      }
      ASSERT_EQ(base, expected);
      ASSERT_EQ(words, expected_words);
    }
  });
}

TEST(Lanes, CompressStoreKeepsOrderAndCounts) {
  float values[16];
  uint32_t words[16];
  std::iota(values, values + 16, 1.f);
  std::iota(words, words + 16, 1u);
  for_each_lane_type([&]<typename F>() {
    using U = UInt<F>;
    for (const uint32_t bits : mask_patterns<F>()) {
      std::vector<float> out(kWidth<F> + 8, -7.f), expected;
      std::vector<uint32_t> out_words(kWidth<F> + 8, 77u), expected_words;
      for (size_t k = 0; k < kWidth<F>; ++k) {
        if ((bits >> k & 1u) == 0) continue;
        expected.push_back(values[k]);
        expected_words.push_back(words[k]);
      }
      const Mask<F> m = make_mask<F>(bits);
      ASSERT_EQ(compress_store(out.data(), load<F>(values), m), expected.size());
      ASSERT_EQ(compress_store(out_words.data(), load<U>(words), Mask<U>(m)), expected.size());
      for (size_t k = 0; k < expected.size(); ++k) {
        ASSERT_EQ(out[k], expected[k]);
        ASSERT_EQ(out_words[k], expected_words[k]);
      }
      for (size_t k = kWidth<F>; k < out.size(); ++k) {
        ASSERT_EQ(out[k], -7.f);
        ASSERT_EQ(out_words[k], 77u);
      }
    }
  });
}

TEST(Lanes, Lookup16ReadsATable) {
  std::mt19937 rng(17);
  alignas(64) uint32_t table[16];
  for (uint32_t& x : table) x = static_cast<uint32_t>(rng());
  for_each_lane_type([&]<typename F>() {
    using U = UInt<F>;
    const auto expect = [&](const uint32_t (&index)[16]) {
      const U value = lookup16<U>(table, load<U>(index));
      for (size_t k = 0; k < kWidth<F>; ++k)
        ASSERT_EQ(lane(value, k), table[index[k]]) << kWidth<F> << " lanes, lane " << k;
    };
    uint32_t index[16];
    for (uint32_t shift = 0; shift < 16; ++shift) {
      for (uint32_t k = 0; k < 16; ++k) index[k] = (k + shift) % 16;
      expect(index);
    }
    for (int n = 0; n < 1000; ++n) {
      for (uint32_t& i : index) i = static_cast<uint32_t>(rng()) % 16;
      expect(index);
    }
  });
}

TEST(Lanes, Lookup256ReadsATable) {
  std::mt19937 rng(18);
  alignas(64) float table[256];
  for (float& x : table) x = static_cast<float>(rng());
  for_each_lane_type([&]<typename F>() {
    for (uint32_t shift = 0; shift < 256; ++shift) {
      uint32_t index[16];
      for (uint32_t k = 0; k < 16; ++k) index[k] = (k * 37 + shift) % 256;
      const F value = lookup256<F>(table, load<UInt<F>>(index));
      for (size_t k = 0; k < kWidth<F>; ++k)
        ASSERT_EQ(lane(value, k), table[index[k]]) << kWidth<F> << " lanes, lane " << k;
    }
  });
}

TEST(Lanes, ReverseBits) {
  std::mt19937 rng(19);
  std::vector<uint32_t> x = {0u, 0xffffffffu, 0x0f0f0f0fu, 0x12345678u};
  for (uint32_t bit = 0; bit < 32; ++bit) x.push_back(1u << bit);
  while (x.size() < 4096) x.push_back(static_cast<uint32_t>(rng()));
  for_each_lane_type([&]<typename F>() {
    using U = UInt<F>;
    for (size_t i = 0; i < x.size(); i += kWidth<F>) {
      const U y = reverse_bits<U>(load<U>(x.data() + i));
      for (size_t k = 0; k < kWidth<F>; ++k) {
        uint32_t expected = 0;
        for (uint32_t bit = 0; bit < 32; ++bit) expected |= (x[i + k] >> bit & 1u) << (31 - bit);
        ASSERT_EQ(lane(y, k), expected) << kWidth<F> << " lanes";
      }
    }
  });
}

TEST(Lanes, IsUniformLooksAtActiveLanesOnly) {
  for_each_packet([]<typename F>() {
    using U = UInt<F>;
    uint32_t ids[16];
    for (const uint32_t bits : mask_patterns<F>()) {
      for (uint32_t k = 0; k < 16; ++k) ids[k] = (bits >> k & 1u) ? 5u : k + 100u;
      ASSERT_TRUE(is_uniform<F>(load<U>(ids), make_mask<F>(bits)));
      if (std::popcount(bits) < 2) continue;
      ids[31 - std::countl_zero(bits)] = 6u;
      ASSERT_FALSE(is_uniform<F>(load<U>(ids), make_mask<F>(bits)));
    }
  });
  EXPECT_TRUE(is_uniform<float>(3u, true));
}

TEST(Lanes, DenormalsAreZeroWhileTheyAreOff) {
  volatile float denormal = 1e-40f, small = 2e-38f, half = 0.5f;
  {
    const DenormalsOff off;
    EXPECT_EQ(0.f, denormal * 1e20f) << "as an operand";
    EXPECT_EQ(0.f, small * half) << "as a result";
  }
  EXPECT_GT(denormal * 1e20f, 0.f);
  EXPECT_GT(small * half, 0.f);
}

}  // namespace
}  // namespace wavecomb
