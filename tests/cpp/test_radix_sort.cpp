// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/schedule/radix_sort.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>
#include <random>

#include "wavecomb/schedule/policy.h"

namespace wavecomb {
namespace {

/// Expects sort() to equal std::stable_sort for these keys.
void expect_sorted(const std::vector<uint64_t>& keys, RadixSorter& sorter, const char* what) {
  const size_t n = keys.size();
  std::copy(keys.begin(), keys.end(), sorter.keys());
  std::vector<uint32_t> expected(n), order(n, 0xdeadbeefu);
  std::iota(expected.begin(), expected.end(), 0u);
  std::stable_sort(expected.begin(), expected.end(),
                   [&](uint32_t a, uint32_t b) { return keys[a] < keys[b]; });
  if (sorter.sort(n, order.data())) {
    EXPECT_EQ(order, expected) << what << ", " << n;
  } else {
    EXPECT_TRUE(std::is_sorted(keys.begin(), keys.end())) << what << ", " << n;
    EXPECT_EQ(order, std::vector<uint32_t>(n, 0xdeadbeefu)) << "not written";
  }
}

TEST(RadixSort, EqualsStableSort) {
  std::mt19937_64 rng(1);
  for (const size_t n : {0u, 1u, 2u, 15u, 16u, 17u, 255u, 256u, 257u, 5000u, 65536u}) {
    RadixSorter sorter(n);
    std::vector<uint64_t> keys(n);
    const auto fill = [&](const auto& key) {
      for (size_t i = 0; i < n; ++i) keys[i] = key(i);
    };
    fill([&](size_t) { return rng(); });
    expect_sorted(keys, sorter, "random");
    std::sort(keys.begin(), keys.end());
    expect_sorted(keys, sorter, "sorted");
    std::reverse(keys.begin(), keys.end());
    expect_sorted(keys, sorter, "reversed");
    fill([&](size_t) { return rng() % 3; });
    expect_sorted(keys, sorter, "three keys");
    fill([&](size_t) { return (rng() % 5) << 61; });
    expect_sorted(keys, sorter, "few keys in the highest bits");
    fill([&](size_t) { return ~uint64_t{0}; });
    expect_sorted(keys, sorter, "all equal");
    fill([&](size_t i) { return uint64_t{i % 2} << 63 | (rng() & 0xff00ff00u); });
    expect_sorted(keys, sorter, "some digits equal");
    fill([&](size_t i) { return i == 0 && n > 1 ? 1u : 0u; });
    expect_sorted(keys, sorter, "one out of place");
  }
}

TEST(RadixSort, EachSingleDigit) {
  std::mt19937_64 rng(2);
  RadixSorter sorter(600);
  std::vector<uint64_t> keys(600);
  for (int shift = 0; shift < 64; shift += 8) {
    for (uint64_t& k : keys) k = (rng() & 0xff) << shift | 0x0101010101010101u >> 1;
    expect_sorted(keys, sorter, "one digit");
  }
}

TEST(RadixSort, SortsFewerThanItCanHold) {
  std::mt19937_64 rng(3);
  RadixSorter sorter(1000);
  for (size_t n = 0; n < 1000; n += 37) {
    std::vector<uint64_t> keys(n);
    for (uint64_t& k : keys) k = rng() % 1000;
    expect_sorted(keys, sorter, "again");
  }
}

/// A queue with all columns, for 12 materials with 6 programs and 4 textures.
struct Queue {
  std::vector<uint32_t> program, material, position_key, texture_key;
  std::vector<float> throughput, scratch = std::vector<float>(12);
  std::vector<MaterialTraits> traits;
  CostSnapshot costs;

  explicit Queue(size_t n) {
    std::mt19937 rng(4);
    for (uint32_t m = 0; m < 12; ++m) {
      traits.push_back({m % 6, m % 4 == 0 ? MaterialTraits::kNone : m % 4, m % 4 * 1000});
      costs.material_ns.push_back(10.f + static_cast<float>(m * 7 % 12));
    }
    costs.texture_ns.assign(4, 5.f);
    costs.mean_ns = 15;
    for (size_t i = 0; i < n; ++i) {
      material.push_back(rng() % 12);
      program.push_back(material[i] % 6);
      position_key.push_back(rng() & 0x3fffffffu);
      texture_key.push_back(rng() & 0x1ffffffu);
      throughput.push_back(static_cast<float>(rng() % 1000) / 1000);
    }
  }
  /// The first n records.
  ShadingQueueView view(size_t n) {
    return {{program.data(), n},
            {material.data(), n},
            {throughput.data(), n},
            {position_key.data(), n},
            {texture_key.data(), n},
            traits,
            scratch,
            2};
  }
};

TEST(Policies, GiveStablePermutations) {
  Queue queue(3000);
  RadixSorter sorter(3000);
  for (const std::string& name : policy_names()) {
    if (name == "adaptive") continue;
    const auto policy = make_policy(name);
    EXPECT_EQ(policy->name(), name);
    for (const size_t n : {0u, 1u, 7u, 3000u}) {
      const ShadingQueueView view = queue.view(n);
      EXPECT_EQ(view.size(), n);
      if (!policy->order(view, queue.costs, {sorter.keys(), n})) continue;
      const std::vector<uint64_t> keys(sorter.keys(), sorter.keys() + n);
      // Policies have no state: the same queue gets the same keys.
      ASSERT_TRUE(policy->order(view, queue.costs, {sorter.keys(), n}));
      EXPECT_TRUE(std::equal(keys.begin(), keys.end(), sorter.keys())) << name;
      std::vector<uint32_t> order(n);
      if (!sorter.sort(n, order.data())) continue;
      std::vector<bool> seen(n, false);
      for (size_t i = 0; i < n; ++i) {
        ASSERT_LT(order[i], n);
        EXPECT_FALSE(seen[order[i]]) << name;
        seen[order[i]] = true;
        if (i == 0) continue;
        const uint64_t a = keys[order[i - 1]], b = keys[order[i]];
        EXPECT_TRUE(a < b || (a == b && order[i - 1] < order[i]))
            << name << " is not stable at " << i;
      }
    }
  }
}

TEST(Policies, ProgramPutsEachProgramTogether) {
  const std::vector<uint32_t> program = {3, 0, 3, 1, 0}, material = {9, 8, 7, 6, 5};
  ShadingQueueView view;
  view.program = program;
  view.material = material;
  RadixSorter sorter(5);
  ASSERT_TRUE(make_policy("program")->order(view, {}, {sorter.keys(), 5}));
  std::vector<uint32_t> order(5);
  ASSERT_TRUE(sorter.sort(5, order.data()));
  EXPECT_EQ(order, (std::vector<uint32_t>{1, 4, 3, 0, 2}));
  EXPECT_FALSE(make_policy("none")->order(view, {}, {sorter.keys(), 5}));
}

}  // namespace
}  // namespace wavecomb
