// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/schedule/ray_order.h"

#include <algorithm>
#include <memory>
#include <numeric>
#include <tuple>

#include "lane_testing.h"
#include "wavecomb/schedule/radix_sort.h"
#include "wavecomb/wave/stages/order_rays.h"
#include "wavecomb/wave/stages/shade.h"
#include "wavecomb/wave/stages/trace.h"

namespace wavecomb {
namespace {

/// Decodes a Morton code to a cell of the 1024^3 grid, bit by bit.
std::array<uint32_t, 3> cell_of(uint32_t code) {
  std::array<uint32_t, 3> cell{};
  for (uint32_t bit = 0; bit < 30; ++bit) cell[bit % 3] |= (code >> bit & 1u) << (bit / 3);
  return cell;
}

OrderGrid box() {
  return {{-2.f, 0.f, 10.f}, {1024.f / 4, 1024.f / 8, 1024.f / 1}};
}

/// Origin and direction.
struct Ray {
  float o[3], d[3];
};

/// Rays in random, non-adjacent slots of a pool.
struct PoolRays {
  PathPool pool;
  std::vector<uint32_t> slot;

  explicit PoolRays(const std::vector<Ray>& rays)
      : pool(2 * rays.size() + 1, false), slot(rays.size()) {
    std::vector<uint32_t> slots(2 * rays.size());
    std::iota(slots.begin(), slots.end(), 0u);
    std::shuffle(slots.begin(), slots.end(), std::mt19937(1));
    std::copy_n(slots.begin(), rays.size(), slot.begin());
    for (size_t i = 0; i < rays.size(); ++i) {
      const Ray& r = rays[i];
      store_row<PathRow, float>(pool.paths, slot[i],
                                {{r.o[0], r.o[1], r.o[2]},
                                 {r.d[0], r.d[1], r.d[2]},
                                 {2, 3, 4},
                                 5,
                                 6,
                                 7,
                                 8,
                                 {9, static_cast<uint32_t>(i)},
                                 10},
                                true);
    }
    slot.resize(rays.size() + SoaBlock::kPad);
  }
  template <typename F>
  std::vector<uint64_t> keys(const OrderGrid& grid, bool by_octant) const {
    std::vector<uint64_t> all(slot.size() - SoaBlock::kPad);
    ray_keys<F>(pool.paths, slot.data(), all.size(), grid, by_octant, all.data());
    return all;
  }
};

/// Rays from points inside and outside the box.
std::vector<Ray> random_rays(size_t n) {
  std::vector<Ray> rays(n);
  std::mt19937 rng(3);
  std::uniform_real_distribution<float> unit(-0.1f, 1.1f);
  for (Ray& r : rays) {
    r.o[0] = -2.f + 4.f * unit(rng);
    r.o[1] = 8.f * unit(rng);
    r.o[2] = 10.f + unit(rng);
    for (float& x : r.d) x = unit(rng) - 0.5f;
  }
  return rays;
}

TEST(RayOrder, KeysRiseAlongTheMortonCurve) {
  const OrderGrid grid = box();
  std::mt19937 rng(2);
  std::vector<uint32_t> codes(1000);
  for (uint32_t& code : codes) code = rng() & 0x3fffffffu;
  std::sort(codes.begin(), codes.end());
  std::vector<Ray> rays;
  for (const uint32_t code : codes) {
    Ray r{{0, 0, 0}, {1, 1, 1}};
    const std::array<uint32_t, 3> cell = cell_of(code);
    for (size_t c = 0; c < 3; ++c)
      r.o[c] = grid.lo[c] + (static_cast<float>(cell[c]) + 0.5f) / grid.scale[c];
    rays.push_back(r);
  }
  const PoolRays pool(rays);
  const auto places = pool.keys<float>(grid, false), octant_0 = pool.keys<float>(grid, true);
  for (size_t i = 0; i < codes.size(); ++i) {
    EXPECT_EQ(places[i], codes[i]);
    EXPECT_EQ(octant_0[i], codes[i] >> 1);
  }
}

TEST(RayOrder, OctantsComeFirst) {
  const OrderGrid grid = box();
  const std::vector<Ray> rays = random_rays(500);
  const PoolRays pool(rays);
  const auto keys = pool.keys<float>(grid, true), places = pool.keys<float>(grid, false);
  for (size_t i = 0; i < rays.size(); ++i) {
    const float* d = rays[i].d;
    const uint64_t octant = (d[0] < 0 ? 4u : 0u) + (d[1] < 0 ? 2u : 0u) + (d[2] < 0);
    EXPECT_EQ(keys[i], octant << 29 | places[i] >> 1);
  }
}

TEST(RayOrder, DirectionKeysAreOctantAndLongAxes) {
  const std::vector<float> values = lane_testing::padded(
      {0.f, -0.f, kLong, -kLong, std::nextafter(kLong, 1.f), 1.f, -1.f}, 500, -1.f, 1.f);
  lane_testing::for_each_lane_type([&]<typename F>() {
    for (size_t i = 0; i + 32 + kWidth<F> <= values.size(); i += kWidth<F>) {
      const float *x = &values[i], *y = &values[i + 16], *z = &values[i + 32];
      const UInt<F> key = direction_key<F>(Vec3<F>(load<F>(x), load<F>(y), load<F>(z)));
      for (size_t k = 0; k < kWidth<F>; ++k) {
        uint32_t expected = 0;
        for (const float* axis : {x, y, z}) expected = expected << 1 | std::signbit(axis[k]);
        for (const float* axis : {x, y, z})
          expected = expected << 1 | static_cast<uint32_t>(std::fabs(axis[k]) > kLong);
        ASSERT_EQ(lane(key, k), expected) << x[k] << ", " << y[k] << ", " << z[k];
        ASSERT_LT(expected, kDirectionKeys);
      }
    }
  });
  // The keys of a ray and of a shadow ray fit into a 32-bit word next to the outcome of shading.
  static_assert(kDirectionKeys <=
                1u << (ShadingQueue::kShadowKeyShift - ShadingQueue::kRayKeyShift));
  static_assert(ShadingQueue::kRayKeyShift >= 2 && ShadingQueue::kShadowKeyShift <= 26);
}

TEST(RayOrder, OutsideAndNotFiniteArePutAtTheEdge) {
  using lane_testing::kInf;
  using lane_testing::kNan;
  const OrderGrid grid = box();
  const auto key = [&](float x, float y, float z) {
    return position_key<float>(grid, Vec3<float>(x, y, z));
  };
  EXPECT_EQ(key(-1e30f, -1.f, 9.f), 0u);
  EXPECT_EQ(key(1e30f, 1e3f, 12.f), 0x3fffffffu);
  EXPECT_EQ(key(2.f, 8.f, 11.f), 0x3fffffffu) << "the far corner belongs to the last cell";
  EXPECT_EQ(key(kNan, kNan, kNan), 0u);
  EXPECT_EQ(key(kInf, -kInf, kNan), 0u);
  OrderGrid flat = grid;
  flat.scale[1] = 0.f;  // a scene without height
  EXPECT_EQ(position_key<float>(flat, Vec3<float>(-2.f, 5.f, 10.f)), 0u);
}

TEST(RayOrder, AllWidthsMakeTheSameKeys) {
  const OrderGrid grid = box();
  for (const size_t n : {1u, 3u, 4u, 5u, 15u, 16u, 17u, 300u}) {
    const PoolRays pool(random_rays(n));
    for (const bool by_octant : {false, true}) {
      const std::vector<uint64_t> expected = pool.keys<float>(grid, by_octant);
      lane_testing::for_each_packet([&]<typename F>() {
        EXPECT_EQ(pool.keys<F>(grid, by_octant), expected) << kWidth<F> << " lanes, " << n;
      });
    }
  }
}

TEST(RayOrder, SortEqualsStableSortOnRealKeys) {
  for (const size_t n : {0u, 1u, 15u, 16u, 17u, 4096u}) {
    std::vector<Ray> rays = random_rays(n);
    for (size_t i = 1; i < n; i += 3) std::copy_n(rays[i - 1].o, 3, rays[i].o);  // shared cells
    const PoolRays pool(rays);
    for (const bool by_octant : {false, true}) {
      const std::vector<uint64_t> keys = pool.keys<float>(box(), by_octant);
      RadixSorter sorter(n);
      std::copy(keys.begin(), keys.end(), sorter.keys());
      std::vector<uint32_t> expected(n), order(n);
      std::iota(expected.begin(), expected.end(), 0u);
      order = expected;
      std::stable_sort(expected.begin(), expected.end(),
                       [&](uint32_t a, uint32_t b) { return keys[a] < keys[b]; });
      sorter.sort(n, order.data());
      EXPECT_EQ(order, expected) << n;
    }
  }
}

TEST(RayOrder, SortByDirectionEqualsStableSort) {
  std::mt19937 rng(7);
  for (const size_t n : {0u, 1u, 2u, 15u, 16u, 17u, 63u, 64u, 65u, 5000u})
    for (const uint32_t keys : {1u, 2u, 3u, kDirectionKeys}) {
      std::vector<std::pair<uint32_t, uint32_t>> pairs(n);  // key, slot
      for (size_t i = 0; i < n; ++i)
        pairs[i] = {kDirectionKeys - 1 - static_cast<uint32_t>(rng()) % keys,
                    static_cast<uint32_t>(rng())};
      std::vector<uint32_t> key(n), slot(n), sorted(n + 1, 77u), expected;
      for (size_t i = 0; i < n; ++i) std::tie(key[i], slot[i]) = pairs[i];
      sort_by_direction(key.data(), slot.data(), n, sorted.data());
      std::stable_sort(pairs.begin(), pairs.end(),
                       [](const auto& a, const auto& b) { return a.first < b.first; });
      for (const auto& pair : pairs) expected.push_back(pair.second);
      expected.push_back(77u);
      EXPECT_EQ(sorted, expected) << n << " rays, " << keys << " keys";
    }
}

/// A wave without a scene, sufficient to order and fetch rays.
struct BareWave {
  Settings settings;
  Film film{1, 1, {AovSet{0}}};
  FilterTable filter{FilterKind::kBox, 1.f};
  CameraSetup camera{Camera{}, 1, 1, filter};
  WaveContext context{};
  std::unique_ptr<Wave> wave;

  explicit BareWave(uint32_t capacity) {
    context.settings = &settings;
    context.film = &film;
    context.camera = &camera;
    context.grid = box();
    wave = std::make_unique<Wave>(capacity, context);
  }
};

void store_shadow(const PathPool& pool, uint32_t slot, const Ray& r, float first) {
  float* row = pool.shadows + slot * kRowWords<ShadowRow>;
  std::copy_n(r.o, 3, row);
  std::copy_n(r.d, 3, row + 3);
  std::iota(row + 6, row + 10, first);  // tfar, r, g, b
}

TEST(RayOrder, QueuesAreOrderedStablyAndFetchedFromTheirSlots) {
  constexpr size_t kCapacity = 700;
  for (const size_t n : {0u, 1u, 16u, 17u, 37u, 700u}) {
    const std::vector<Ray> rays = random_rays(n);
    std::vector<uint32_t> slots(kCapacity);
    std::iota(slots.begin(), slots.end(), 0u);
    std::shuffle(slots.begin(), slots.end(), std::mt19937(static_cast<uint32_t>(n)));
    lane_testing::for_each_lane_type([&]<typename F>() {
      for (const RayOrder order : {RayOrder::kSlot, RayOrder::kMorton, RayOrder::kMortonOctant,
                                   RayOrder::kDirection, RayOrder::kAuto}) {
        SCOPED_TRACE(testing::Message()
                     << kWidth<F> << " lanes, " << n << " rays, order " << static_cast<int>(order));
        BareWave bare(kCapacity);
        Wave& wave = *bare.wave;
        std::vector<uint32_t> slot(slots.begin(), slots.begin() + static_cast<std::ptrdiff_t>(n));
        std::vector<size_t> ray_of(kCapacity);
        std::vector<uint32_t> key(n);
        for (size_t i = 0; i < n; ++i) {
          const Ray& r = rays[i];
          const Vec3<float> o(r.o[0], r.o[1], r.o[2]), d(r.d[0], r.d[1], r.d[2]);
          ray_of[slot[i]] = i;
          key[i] = direction_key<float>(d);
          store_row<PathRow, float>(wave.pool.paths, slot[i],
                                    {o, d, {1, 1, 1}, 0, 0, 0, 0, {1, 2}, 0}, true);
          store_shadow(wave.pool, slot[i], r, static_cast<float>(10 * i));
          wave.rays.slot[i] = wave.shadows.slot[i] = slot[i];
          wave.rays.direction[i] = wave.shadows.direction[i] = key[i];
        }
        wave.rays.size = wave.shadows.size = n;

        const auto check = [&](const RayOrderChoice& choice, const auto& queue) {
          RayOrder done = order;
          if (order == RayOrder::kAuto) {
            EXPECT_EQ(choice.chosen, n > kWidth<F>);
            done = static_cast<RayOrder>(choice.arm);
            ASSERT_LT(choice.arm, Wave::kRayOrders);
          }
          if (n <= kWidth<F>) done = RayOrder::kSlot;
          std::vector<uint64_t> keys(n, 0);
          if (done == RayOrder::kDirection)
            std::copy(key.begin(), key.end(), keys.begin());
          else if (done != RayOrder::kSlot)
            keys = PoolRays(rays).keys<float>(box(), done == RayOrder::kMortonOctant);
          std::vector<uint32_t> expected = slot;
          std::stable_sort(expected.begin(), expected.end(), [&](uint32_t a, uint32_t b) {
            return keys[ray_of[a]] < keys[ray_of[b]];
          });
          EXPECT_EQ(std::vector<uint32_t>(queue.slot, queue.slot + n), expected);
          // Each entry of the reordered queue holds the ray of the entry's slot.
          const float* const columns[] = {queue.ox, queue.oy, queue.oz,
                                          queue.dx, queue.dy, queue.dz};
          for (size_t i = 0; i < n; ++i) {
            const Ray& r = rays[ray_of[queue.slot[i]]];
            for (size_t c = 0; c < 3; ++c) {
              ASSERT_EQ(columns[c][i], r.o[c]);
              ASSERT_EQ(columns[3 + c][i], r.d[c]);
            }
          }
        };
        RayOrderChoice choice = order_rays<F>(wave, bare.context, 1, order, wave.ray_chooser,
                                              wave.pool.paths, wave.rays);
        fetch_rays<F>(wave);
        check(choice, wave.rays);
        choice = order_rays<F>(wave, bare.context, 1, order, wave.shadow_chooser, wave.pool.shadows,
                               wave.shadows);
        fetch_shadows<F>(wave);
        check(choice, wave.shadows);
        const ShadowQueue& q = wave.shadows;
        for (size_t i = 0; i < n; ++i) {
          const auto first = static_cast<float>(10 * ray_of[q.slot[i]]);
          const float rest[] = {q.tfar[i], q.r[i], q.g[i], q.b[i]};
          for (size_t c = 0; c < 4; ++c) ASSERT_EQ(rest[c], first + static_cast<float>(c));
        }
      }
    });
  }
}

TEST(RayOrder, PathsThatGoOnAreListedInArrivalOrder) {
  using Q = ShadingQueue;
  std::mt19937 rng(11);
  for (const size_t n : {0u, 1u, 16u, 17u, 300u})
    lane_testing::for_each_lane_type([&]<typename F>() {
      BareWave bare(300);
      Wave& wave = *bare.wave;
      std::vector<std::pair<uint32_t, uint32_t>> rays, shadows;  // slot, direction key
      wave.shading.size = n;
      for (size_t i = 0; i < n; ++i) {
        const auto outcome = static_cast<uint32_t>(rng()) % 4;
        const auto ray_key = static_cast<uint32_t>(rng()) % kDirectionKeys;
        const auto shadow_key = static_cast<uint32_t>(rng()) % kDirectionKeys;
        const auto slot = static_cast<uint32_t>(rng());
        wave.shading.slot[i] = slot;
        wave.shading.outcome[i] =
            outcome | ray_key << Q::kRayKeyShift | shadow_key << Q::kShadowKeyShift;
        if ((outcome & Q::kAlive) != 0) rays.emplace_back(slot, ray_key);
        if ((outcome & Q::kShadowRay) != 0) shadows.emplace_back(slot, shadow_key);
      }
      compact<F>(wave);
      const auto check = [&](const auto& queue, const auto& expected) {
        ASSERT_EQ(queue.size, expected.size()) << kWidth<F> << " lanes, " << n;
        for (size_t i = 0; i < expected.size(); ++i) {
          ASSERT_EQ(queue.slot[i], expected[i].first);
          ASSERT_EQ(queue.direction[i], expected[i].second);
        }
      };
      check(wave.rays, rays);
      check(wave.shadows, shadows);
    });
}

}  // namespace
}  // namespace wavecomb
