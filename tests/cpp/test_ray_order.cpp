// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/schedule/ray_order.h"

#include <algorithm>
#include <numeric>

#include "lane_testing.h"
#include "wavecomb/integrate/stages/order_rays.h"
#include "wavecomb/schedule/radix_sort.h"

namespace wavecomb {
namespace {

/// All columns of a queue as numbers that say which row and column they are.
template <typename Queue>
std::vector<float*> float_columns(Queue& q);
template <>
std::vector<float*> float_columns(RayQueue& q) {
  return {q.ox,        q.oy,           q.oz,           q.dx,           q.dy,
          q.dz,        q.throughput_r, q.throughput_g, q.throughput_b, q.pdf,
          q.eta_scale, q.cone_width,   q.cone_spread};
}
template <>
std::vector<float*> float_columns(ShadowQueue& q) {
  return {q.ox, q.oy, q.oz, q.dx, q.dy, q.dz, q.tfar, q.r, q.g, q.b};
}

template <typename Queue>
void expect_rows_stay_whole() {
  constexpr size_t kRows = 37;
  Queue from(kRows), to(kRows);
  from.size = kRows;
  const std::vector<float*> columns = float_columns(from);
  EXPECT_EQ(columns.size() + 2, Queue::kColumns) << "slot and alive are the others";
  for (size_t i = 0; i < kRows; ++i) {
    for (size_t c = 0; c < columns.size(); ++c) columns[c][i] = static_cast<float>(100 * c + i);
    from.slot[i] = static_cast<uint32_t>(1000 + i);
  }
  std::vector<uint32_t> order(kRows);
  std::iota(order.begin(), order.end(), 0u);
  std::shuffle(order.begin(), order.end(), std::mt19937(1));
  permute(from, to, order.data(), kRows);
  EXPECT_EQ(to.size, kRows);
  const std::vector<float*> moved = float_columns(to);
  for (size_t i = 0; i < kRows; ++i) {
    for (size_t c = 0; c < moved.size(); ++c)
      EXPECT_EQ(moved[c][i], static_cast<float>(100 * c + order[i])) << "column " << c;
    EXPECT_EQ(to.slot[i], 1000 + order[i]);
  }
}

TEST(RayOrder, PermuteKeepsRowsWhole) {
  expect_rows_stay_whole<RayQueue>();
  expect_rows_stay_whole<ShadowQueue>();
}

/// Coordinates of a cell of the 1024^3 grid from its Morton code, bit by bit.
std::array<uint32_t, 3> cell_of(uint32_t code) {
  std::array<uint32_t, 3> cell{};
  for (uint32_t bit = 0; bit < 30; ++bit) cell[bit % 3] |= (code >> bit & 1u) << (bit / 3);
  return cell;
}

OrderGrid box() {
  return {{-2.f, 0.f, 10.f}, {1024.f / 4, 1024.f / 8, 1024.f / 1}};
}

/// A queue of rays from points spread over the box and beyond it.
RayQueue random_rays(size_t n) {
  RayQueue q(n);
  q.size = n;
  std::mt19937 rng(3);
  std::uniform_real_distribution<float> unit(-0.1f, 1.1f);
  for (size_t i = 0; i < n; ++i) {
    q.ox[i] = -2.f + 4.f * unit(rng);
    q.oy[i] = 8.f * unit(rng);
    q.oz[i] = 10.f + unit(rng);
    q.dx[i] = unit(rng) - 0.5f;
    q.dy[i] = unit(rng) - 0.5f;
    q.dz[i] = unit(rng) - 0.5f;
  }
  return q;
}

TEST(RayOrder, KeysRiseAlongTheMortonCurve) {
  const OrderGrid grid = box();
  RayQueue q(1000);
  std::mt19937 rng(2);
  std::vector<uint32_t> codes(1000);
  for (uint32_t& code : codes) code = rng() & 0x3fffffffu;
  std::sort(codes.begin(), codes.end());
  q.size = codes.size();
  for (size_t i = 0; i < codes.size(); ++i) {
    // The middle of the cell.
    const auto [x, y, z] = cell_of(codes[i]);
    q.ox[i] = grid.lo[0] + (static_cast<float>(x) + 0.5f) / grid.scale[0];
    q.oy[i] = grid.lo[1] + (static_cast<float>(y) + 0.5f) / grid.scale[1];
    q.oz[i] = grid.lo[2] + (static_cast<float>(z) + 0.5f) / grid.scale[2];
    q.dx[i] = q.dy[i] = q.dz[i] = 1.f;
  }
  std::vector<uint64_t> keys(codes.size());
  ray_keys<float>(q, grid, false, keys.data());
  for (size_t i = 0; i < codes.size(); ++i) EXPECT_EQ(keys[i], codes[i]);
  ray_keys<float>(q, grid, true, keys.data());
  for (size_t i = 0; i < codes.size(); ++i) EXPECT_EQ(keys[i], codes[i] >> 1) << "octant 0";
}

TEST(RayOrder, OctantsComeFirst) {
  const OrderGrid grid = box();
  RayQueue q = random_rays(500);
  std::vector<uint64_t> keys(q.size), places(q.size);
  ray_keys<float>(q, grid, true, keys.data());
  ray_keys<float>(q, grid, false, places.data());
  for (size_t i = 0; i < q.size; ++i) {
    const uint64_t octant = (q.dx[i] < 0 ? 4u : 0u) + (q.dy[i] < 0 ? 2u : 0u) + (q.dz[i] < 0);
    EXPECT_EQ(keys[i], octant << 29 | places[i] >> 1);
  }
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
    RayQueue q = random_rays(n);
    for (const bool by_octant : {false, true}) {
      std::vector<uint64_t> expected(n), keys(n);
      ray_keys<float>(q, grid, by_octant, expected.data());
      lane_testing::for_each_packet([&]<typename F>() {
        keys.assign(n, 0);
        ray_keys<F>(q, grid, by_octant, keys.data());
        EXPECT_EQ(keys, expected) << kWidth<F> << " lanes, " << n;
      });
    }
  }
}

TEST(RayOrder, SortEqualsStableSortOnRealKeys) {
  for (const size_t n : {0u, 1u, 15u, 16u, 17u, 4096u}) {
    RayQueue q = random_rays(n);
    for (size_t i = 1; i < n; i += 3) {  // some share their cell
      q.ox[i] = q.ox[i - 1];
      q.oy[i] = q.oy[i - 1];
      q.oz[i] = q.oz[i - 1];
    }
    for (const bool by_octant : {false, true}) {
      RadixSorter sorter(n);
      ray_keys<float>(q, box(), by_octant, sorter.keys());
      const std::vector<uint64_t> keys(sorter.keys(), sorter.keys() + n);
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

}  // namespace
}  // namespace wavecomb
