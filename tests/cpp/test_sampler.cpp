// SPDX-License-Identifier: Apache-2.0
/// The sampler: digital nets, stratification, independence, agreement with textbook Sobol
/// sequences, and lanes.
#include "wavecomb/core/sampler.h"

#include <set>

#include "chi_square.h"
#include "lane_testing.h"

namespace wavecomb {
namespace {

using namespace lane_testing;

Sample4<float> draw(SamplerKind kind, uint32_t pixel, uint32_t sample, uint32_t set,
                    uint32_t seed = 0) {
  return sample_4d<float>(kind, make_sample_key<float>(pixel, sample, seed), set);
}
Sample4<float> sobol(uint32_t pixel, uint32_t sample, uint32_t set, uint32_t seed = 0) {
  return draw(SamplerKind::kSobol, pixel, sample, set, seed);
}

/// Column k of the generator matrix of one dimension; bit 31 is the first binary digit. Recurrence
/// of Bratley and Fox (TOMS 659) for a primitive polynomial of degree s with inner coefficients a.
std::vector<uint32_t> sobol_columns(uint32_t s, uint32_t a, std::vector<uint32_t> m, uint32_t n) {
  for (uint32_t k = static_cast<uint32_t>(m.size()); k < n; ++k) {
    uint32_t value = m[k - s] ^ (m[k - s] << s);
    for (uint32_t i = 1; i < s; ++i)
      if (a >> (s - 1 - i) & 1u) value ^= m[k - i] << i;
    m.push_back(value);
  }
  for (uint32_t k = 0; k < n; ++k) m[k] <<= 31 - k;
  return m;
}
uint32_t reverse(uint32_t x) {
  uint32_t y = 0;
  for (int i = 0; i < 32; ++i) y |= (x >> i & 1u) << (31 - i);
  return y;
}

TEST(Sobol, DirectionNumbersAreThoseOfJoeAndKuo) {
  // Parameters of new-joe-kuo-6: dimension 2 has s 1, m 1; dimension 3 has s 2, a 1, m 1 3;
  // dimension 4 has s 3, a 1, m 1 3 1.
  const auto c1 = sobol_columns(1, 0, {1}, 20), c2 = sobol_columns(2, 1, {1, 3}, 20),
             c3 = sobol_columns(3, 1, {1, 3, 1}, 20);
  for (uint32_t k = 0; k < 20; ++k) {
    EXPECT_EQ(reverse(c2[k]), detail::kSobol2[k]) << k;
    EXPECT_EQ(reverse(c3[k]), detail::kSobol3[k]) << k;
    // Pascal's matrix by the same shifts as in the sampler.
    uint32_t d1 = 1u << k;
    d1 ^= d1 >> 16;
    d1 ^= (d1 & 0xff00ff00u) >> 8;
    d1 ^= (d1 & 0xf0f0f0f0u) >> 4;
    d1 ^= (d1 & 0xccccccccu) >> 2;
    d1 ^= (d1 & 0xaaaaaaaau) >> 1;
    EXPECT_EQ(reverse(c1[k]), d1) << k;
  }
}

TEST(Sobol, NibbleTablesMultiplyByTheMatrix) {
  std::mt19937 rng(23);
  uint32_t random[detail::kIndexBits];
  for (uint32_t& column : random) column = static_cast<uint32_t>(rng());
  const auto expect_product = [&](const uint32_t (&columns)[detail::kIndexBits]) {
    const detail::NibbleTables tables(columns);
    std::vector<uint32_t> index = {0u, 0xfffffu};
    for (uint32_t bit = 0; bit < 20; ++bit) index.push_back(1u << bit);
    while (index.size() < 4096) index.push_back(static_cast<uint32_t>(rng()) & 0xfffffu);
    for_each_lane_type([&]<typename F>() {
      using U = UInt<F>;
      for (size_t i = 0; i < index.size(); i += kWidth<F>) {
        const U product = tables.product<U>(load<U>(&index[i]));
        for (size_t k = 0; k < kWidth<F>; ++k) {
          uint32_t expected = 0;
          for (uint32_t bit = 0; bit < 20; ++bit)
            if (index[i + k] >> bit & 1u) expected ^= columns[bit];
          ASSERT_EQ(lane(product, k), expected) << kWidth<F> << " lanes, " << index[i + k];
        }
      }
    });
  };
  expect_product(random);
  expect_product(detail::kSobol2);
  expect_product(detail::kSobol3);
}

/// Whether bit b of f(x) depends only on bits 0 to b of x, and flips with bit b.
TEST(Sobol, LaineKarrasIsAnOwenScramble) {
  std::mt19937 rng(1);
  for (int n = 0; n < 2000; ++n) {
    const auto x = static_cast<uint32_t>(rng()), seed = static_cast<uint32_t>(rng());
    const uint32_t y = detail::laine_karras(x, seed);
    for (uint32_t b = 0; b < 32; ++b) {
      const uint32_t changed = y ^ detail::laine_karras(x ^ 1u << b, seed);
      ASSERT_EQ(changed & ((1u << b) - 1u), 0u);
      ASSERT_TRUE(changed >> b & 1u);
    }
  }
}

/// Expects the net property of 2^m points: each elementary interval of area 2^-m holds one point.
void expect_net(const std::vector<std::pair<float, float>>& points) {
  const auto m = static_cast<uint32_t>(std::countr_zero(points.size()));
  for (uint32_t a = 0; a <= m; ++a) {
    std::vector<int> count(points.size(), 0);
    for (const auto& [x, y] : points) {
      const auto i = static_cast<uint32_t>(x * static_cast<float>(1u << a));
      const auto j = static_cast<uint32_t>(y * static_cast<float>(1u << (m - a)));
      ++count[(size_t{i} << (m - a)) + j];
    }
    for (const int c : count) ASSERT_EQ(c, 1) << "2^" << a << " x 2^" << m - a;
  }
}

TEST(Sobol, EveryAlignedBlockIsANetInTheFirstTwoDimensions) {
  for (const uint32_t pixel : {0u, 1u, 12345u})
    for (const uint32_t set : {kCameraSet, vertex_set(VertexSet::kLight, 0),
                               vertex_set(VertexSet::kBsdf, 0), vertex_set(VertexSet::kLight, 7)})
      for (uint32_t m = 0; m <= 10; ++m)
        for (uint32_t block = 0; block < 5; ++block) {
          std::vector<std::pair<float, float>> points;
          for (uint32_t i = 0; i < 1u << m; ++i) {
            const auto s = sobol(pixel, (block << m) + i, set);
            points.emplace_back(s.x, s.y);
          }
          expect_net(points);
        }
}

TEST(Sobol, EveryDimensionIsStratifiedSingly) {
  for (const uint32_t pixel : {3u, 999u})
    for (const uint32_t m : {0u, 1u, 5u, 9u, 14u})
      for (uint32_t block = 0; block < 3; ++block) {
        const uint32_t n = 1u << m;
        std::vector<int> count[4];
        for (auto& c : count) c.assign(n, 0);
        for (uint32_t i = 0; i < n; ++i) {
          const auto s = sobol(pixel, block * n + i, 4);
          const float v[4] = {s.x, s.y, s.z, s.w};
          for (size_t d = 0; d < 4; ++d)
            ++count[d][static_cast<size_t>(v[d] * static_cast<float>(n))];
        }
        for (const auto& c : count)
          for (const int k : c) ASSERT_EQ(k, 1);
      }
}

TEST(Sobol, EqualsNaiveOwenScrambledSobol) {
  // Reference sampler: shuffles the index, applies textbook generator matrices, and scrambles digit
  // by digit, flipping each bit by the hash of the bits above.
  const std::vector<uint32_t> columns[4] = {
      sobol_columns(0, 0, std::vector<uint32_t>(20, 1), 20), sobol_columns(1, 0, {1}, 20),
      sobol_columns(2, 1, {1, 3}, 20), sobol_columns(3, 1, {1, 3, 1}, 20)};
  const auto owen = [](uint32_t x, uint32_t seed) {
    uint32_t result = 0;
    for (uint32_t b = 0; b < 32; ++b) {
      const uint32_t above = b == 0 ? 0 : x >> (32 - b) << (32 - b);
      // Bit 31 - b of the scrambled prefix, with a 0 at this position, decides whether to flip.
      const uint32_t flip = reverse(detail::laine_karras(reverse(above), seed)) >> (31 - b) & 1u;
      result |= ((x >> (31 - b) & 1u) ^ flip) << (31 - b);
    }
    return result;
  };
  std::mt19937 rng(5);
  for (int n = 0; n < 3000; ++n) {
    const auto pixel = static_cast<uint32_t>(rng()), sample = static_cast<uint32_t>(rng()) >> 12,
               seed = static_cast<uint32_t>(rng());
    const uint32_t set = static_cast<uint32_t>(rng()) % 40u;
    const uint32_t set_seed = hash_u32(hash_u32(pixel, seed), set);
    const uint32_t index = owen(sample, set_seed) & 0xfffffu;
    const auto s = sobol(pixel, sample, set, seed);
    const float v[4] = {s.x, s.y, s.z, s.w};
    for (uint32_t d = 0; d < 4; ++d) {
      uint32_t x = 0;
      for (uint32_t k = 0; k < 20; ++k)
        if (index >> k & 1u) x ^= columns[d][k];
      ASSERT_EQ(v[d], static_cast<float>(owen(x, hash_u32(set_seed ^ (d + 1))) >> 8) * 0x1p-24f)
          << d;
    }
  }
}

double correlation(const std::vector<double>& a, const std::vector<double>& b) {
  double sum = 0;
  for (size_t i = 0; i < a.size(); ++i) sum += (a[i] - 0.5) * (b[i] - 0.5);
  return 12 * sum / static_cast<double>(a.size());
}

TEST(Sampler, SetsDimensionsPixelsAndSeedsDoNotCorrelate) {
  constexpr uint32_t kN = 1 << 12;
  for (const SamplerKind kind : {SamplerKind::kSobol, SamplerKind::kIndependent}) {
    std::vector<std::vector<double>> columns;
    for (const uint32_t pixel : {10u, 11u})
      for (const uint32_t seed : {0u, 1u})
        for (uint32_t set = 0; set < 6; ++set) {
          const size_t first = columns.size();
          columns.resize(first + 4);
          for (uint32_t i = 0; i < kN; ++i) {
            const auto s = draw(kind, pixel, i, set, seed);
            const float v[4] = {s.x, s.y, s.z, s.w};
            for (size_t d = 0; d < 4; ++d) columns[first + d].push_back(static_cast<double>(v[d]));
          }
        }
    // For independent columns, sigma = 1 / sqrt(n) = 0.0156; there are 96 x 95 / 2 pairs.
    for (size_t a = 0; a < columns.size(); ++a)
      for (size_t b = a + 1; b < columns.size(); ++b) {
        ASSERT_LT(std::fabs(correlation(columns[a], columns[b])), 0.08) << a << ", " << b;
      }
  }
}

TEST(Sampler, PlanesAcrossSetsAreFilledEvenly) {
  // Counts in 8 x 8 cells, one dimension of a set against a dimension of another. Within a pixel,
  // scrambled samples come in correlated pairs. A single pixel's chi-square therefore varies widely
  // around a mean of about 56 (up to 160 even with a perfect Owen scramble in place of the hash);
  // over pixels it must average about 63.
  constexpr uint32_t kN = 4096, kPixels = 40;
  for (const SamplerKind kind : {SamplerKind::kSobol, SamplerKind::kIndependent}) {
    for (const auto& [first, second] : {std::pair{0u, 1u}, {1u, 2u}, {2u, 3u}, {0u, 9u}}) {
      double sum[4][4] = {};
      for (uint32_t pixel = 0; pixel < kPixels; ++pixel) {
        std::vector<int> count(16 * 64, 0);
        for (uint32_t i = 0; i < kN; ++i) {
          const auto s = draw(kind, pixel, i, first), t = draw(kind, pixel, i, second);
          const float x[4] = {s.x, s.y, s.z, s.w}, y[4] = {t.x, t.y, t.z, t.w};
          for (size_t a = 0; a < 4; ++a)
            for (size_t b = 0; b < 4; ++b) {
              ++count[(a * 4 + b) * 64 + static_cast<size_t>(x[a] * 8) * 8 +
                      static_cast<size_t>(y[b] * 8)];
            }
        }
        for (size_t i = 0; i < count.size(); ++i) {
          sum[i / 256][i / 64 % 4] +=
              (count[i] - kN / 64.0) * (count[i] - kN / 64.0) / (kN / 64.0) / kPixels;
        }
      }
      for (const auto& row : sum)
        for (const double mean : row) EXPECT_LT(mean, 85);
    }
  }
}

TEST(Sampler, PixelsAverageToUniform) {
  // First samples of many pixels are uniform in each dimension.
  for (const SamplerKind kind : {SamplerKind::kSobol, SamplerKind::kIndependent}) {
    std::vector<int> count[4];
    for (auto& c : count) c.assign(100, 0);
    constexpr uint32_t kN = 100000;
    for (uint32_t pixel = 0; pixel < kN; ++pixel) {
      const auto s = draw(kind, pixel, 0, kCameraSet);
      const float v[4] = {s.x, s.y, s.z, s.w};
      for (size_t d = 0; d < 4; ++d) {
        ASSERT_TRUE(v[d] >= 0 && v[d] < 1);
        ++count[d][static_cast<size_t>(v[d] * 100)];
      }
    }
    for (const auto& c : count) {
      double statistic = 0;
      for (const int k : c) statistic += (k - kN / 100.0) * (k - kN / 100.0) / (kN / 100.0);
      EXPECT_GT(chi_square::chi_square_p(statistic, 99), 0.001);
    }
  }
}

TEST(Sobol, ConvergesFasterThanRandom) {
  // Mean square error of the integral of x y over pixels is far below that of independent samples.
  const auto error = [](SamplerKind kind, uint32_t n) {
    double sum = 0;
    for (uint32_t pixel = 0; pixel < 200; ++pixel) {
      double mean = 0;
      for (uint32_t i = 0; i < n; ++i) {
        const auto s = draw(kind, pixel, i, 1);
        mean += static_cast<double>(s.x) * s.y / n;
      }
      sum += (mean - 0.25) * (mean - 0.25) / 200;
    }
    return sum;
  };
  EXPECT_LT(error(SamplerKind::kSobol, 256), 0.02 * error(SamplerKind::kIndependent, 256));
  EXPECT_LT(error(SamplerKind::kSobol, 1024),
            error(SamplerKind::kSobol, 256) / 20);  // n^-3 instead of n^-1
}

TEST(Sampler, SetsOfAPathAreDistinct) {
  std::set<uint32_t> sets = {kCameraSet, kTimeSet};
  for (uint32_t depth = 0; depth < 4200; ++depth)
    for (const VertexSet name :
         {VertexSet::kLight, VertexSet::kBsdf, VertexSet::kFlight, VertexSet::kShadow})
      EXPECT_TRUE(sets.insert(vertex_set(name, depth)).second);
  EXPECT_LT(vertex_set(VertexSet::kBsdf, kSetDepths - 1), vertex_set(VertexSet::kFlight, 0));
}

/// Sample sets of light and BSDF have not changed since more sets were added.
TEST(Sampler, SetsOfLightAndBsdfStandWhereTheyStood) {
  for (const uint32_t depth : {0u, 1u, 2u, 7u, 4096u}) {
    EXPECT_EQ(vertex_set(VertexSet::kLight, depth), 1 + 2 * depth);
    EXPECT_EQ(vertex_set(VertexSet::kBsdf, depth), 2 + 2 * depth);
  }
}

/// Two sample sets of a vertex are independent: the sums of products are 0 within 4.5 standard
/// errors of 1 / (12 sqrt n).
TEST(Sampler, SetsOfAVertexAreIndependent) {
  constexpr uint32_t n = 1u << 14;
  const VertexSet names[] = {VertexSet::kLight, VertexSet::kBsdf, VertexSet::kFlight,
                             VertexSet::kShadow};
  for (const SamplerKind kind : {SamplerKind::kSobol, SamplerKind::kIndependent})
    for (size_t i = 0; i < 4; ++i)
      for (size_t j = 0; j < i; ++j) {
        double sum[4] = {};
        for (uint32_t sample = 0; sample < n; ++sample) {
          const auto a = draw(kind, 5, sample, vertex_set(names[i], 3));
          const auto b = draw(kind, 5, sample, vertex_set(names[j], 3));
          const float pairs[4][2] = {{a.x, b.x}, {a.y, b.y}, {a.z, b.z}, {a.w, b.w}};
          for (size_t d = 0; d < 4; ++d)
            sum[d] += (double{pairs[d][0]} - 0.5) * (double{pairs[d][1]} - 0.5);
        }
        for (const double s : sum)
          EXPECT_LT(std::abs(s / n), 4.5 / (12 * std::sqrt(double{n}))) << i << ", " << j;
      }
}

TEST(Sampler, LanesAndOrderChangeNothing) {
  std::mt19937 rng(9);
  std::vector<uint32_t> pixel(512), sample(512);
  for (size_t i = 0; i < 512; ++i) {
    pixel[i] = static_cast<uint32_t>(rng());
    sample[i] = static_cast<uint32_t>(rng()) >> 12;
  }
  for (const SamplerKind kind : {SamplerKind::kSobol, SamplerKind::kIndependent}) {
    for_each_lane_type([&]<typename F>() {
      using U = UInt<F>;
      for (size_t i = 512; i > 0;) {  // backwards
        i -= kWidth<F>;
        const auto s =
            sample_4d<F>(kind, make_sample_key<F>(load<U>(&pixel[i]), load<U>(&sample[i]), 7), 3);
        for (size_t k = 0; k < kWidth<F>; ++k) {
          const auto x = draw(kind, pixel[i + k], sample[i + k], 3, 7);
          ASSERT_EQ(lane(s.x, k), x.x);
          ASSERT_EQ(lane(s.y, k), x.y);
          ASSERT_EQ(lane(s.z, k), x.z);
          ASSERT_EQ(lane(s.w, k), x.w);
        }
      }
    });
  }
}

}  // namespace
}  // namespace wavecomb
