// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <map>
#include <numeric>
#include <random>
#include <set>
#include <tuple>

#include "wavecomb/core/error.h"
#include "wavecomb/schedule/policies/policies.h"
#include "wavecomb/schedule/policy.h"
#include "wavecomb/schedule/radix_sort.h"
#include "wavecomb/schedule/shading_queue.h"
#include "wavecomb/wave/stages/shade.h"

namespace wavecomb {
namespace {

using Order = std::vector<uint32_t>;

/// Records with every column that a policy may use, and the material properties that policies read.
struct Records {
  std::vector<uint32_t> program, material, position_key, texture_key;
  std::vector<float> throughput, scratch;
  std::vector<MaterialTraits> traits;
  CostSnapshot costs;
  uint32_t depth = 1;

  size_t size() const { return material.size(); }
  void add(uint32_t m, float t, uint32_t position, uint32_t texture) {
    material.push_back(m);
    program.push_back(traits[m].program);
    throughput.push_back(t);
    position_key.push_back(position);
    texture_key.push_back(texture);
  }
  /// Fill only the columns that the policy declares, as a render does.
  ShadingQueueView view(uint32_t columns) {
    scratch.assign(traits.size(), -1.f);  // stale data
    ShadingQueueView v;
    v.program = program;
    v.material = material;
    if (columns & kThroughputColumn) v.throughput = throughput;
    if (columns & kPositionColumn) v.position_key = position_key;
    if (columns & kTextureColumn) v.texture_key = texture_key;
    v.materials = traits;
    v.scratch = scratch;
    v.depth = depth;
    return v;
  }
};

/// Returns the order in which the policy shades the records.
Order order_of(std::string_view name, Records& records) {
  const auto policy = make_policy(name);
  const size_t n = records.size();
  RadixSorter sorter(n);
  Order order(n);
  std::iota(order.begin(), order.end(), 0u);
  if (policy->order(records.view(policy->columns()), records.costs, {sorter.keys(), n}))
    sorter.sort(n, order.data());
  return order;
}

/// Five materials of two programs.
Records by_hand() {
  Records r;
  r.traits = {{1, MaterialTraits::kNone, 0},
              {0, 0, 4000},
              {0, 1, 1000},
              {1, MaterialTraits::kNone, 0},
              {0, MaterialTraits::kNone, 0}};
  r.costs.material_ns = {50, 80, 20, 10, 20};
  r.costs.texture_ns = {20, 5};
  r.add(0, 1.00f, 3, 0);
  r.add(1, 0.50f, 5, 9);
  r.add(2, 0.25f, 7, 4);
  r.add(3, 1.00f, 0, 0);
  r.add(4, 0.10f, 0, 0);
  r.add(1, 0.50f, 2, 3);
  r.add(2, 0.25f, 8, 4);
  r.add(0, 0.50f, 1, 0);
  return r;
}

TEST(Policies, NoneKeepsArrival) {
  Records r = by_hand();
  EXPECT_EQ(order_of("none", r), (Order{0, 1, 2, 3, 4, 5, 6, 7}));
  std::vector<uint64_t> keys(r.size(), 7);
  EXPECT_FALSE(make_policy("none")->order(r.view(0), r.costs, keys));
  EXPECT_EQ(keys, std::vector<uint64_t>(r.size(), 7)) << "nothing is paid for";
}

TEST(Policies, ProgramGroupsPrograms) {
  Records r = by_hand();
  EXPECT_EQ(order_of("program", r), (Order{1, 2, 4, 5, 6, 0, 3, 7}));
}

TEST(Policies, CodeGroupsProgramsAndMaterialsThatVary) {
  Records r = by_hand();
  // Program 0: constants first, then materials 1 and 2 with textures; program 1: all constants.
  EXPECT_EQ(order_of("code", r), (Order{4, 1, 5, 2, 6, 0, 3, 7}));
  r.traits[3].graph = 7;
  EXPECT_EQ(order_of("code", r), (Order{4, 1, 5, 2, 6, 0, 7, 3}));
  for (MaterialTraits& m : r.traits) m.texture = m.graph = MaterialTraits::kNone;
  EXPECT_EQ(order_of("code", r), order_of("program", r)) << "all are constant";
}

TEST(Policies, MaterialIsTypeThenCost) {
  Records r = by_hand();
  // Program 0: 20 ns (materials 2 and 4, separately), 80 ns; program 1: 10 ns, 50 ns.
  EXPECT_EQ(order_of("material", r), (Order{2, 6, 4, 1, 5, 3, 0, 7}));
  r.costs.material_ns = {5, 1, 2, 10, 3};
  EXPECT_EQ(order_of("material", r), (Order{1, 5, 2, 6, 4, 0, 7, 3}));
}

TEST(Policies, TextureIsTypeThenMemory) {
  Records r = by_hand();
  // Program 0: no texture, 1000 bytes, 4000 bytes; program 1 has none: order of arrival.
  EXPECT_EQ(order_of("texture", r), (Order{4, 2, 6, 1, 5, 0, 3, 7}));
  r.costs.material_ns = {1, 9, 3, 7, 5};
  EXPECT_EQ(order_of("texture", r), (Order{4, 2, 6, 1, 5, 0, 3, 7})) << "costs do not matter";
  r.traits[1].texture_bytes = uint64_t{1} << 60;
  EXPECT_EQ(order_of("texture", r), (Order{4, 2, 6, 1, 5, 0, 3, 7}));
}

TEST(Policies, TextureLocalityIsMaterialThenTexels) {
  Records r = by_hand();
  EXPECT_EQ(order_of("texture-locality", r), (Order{5, 1, 2, 6, 4, 0, 7, 3}));
}

TEST(Policies, CostBenefitIsTypeThenScoreThenPlace) {
  Records r = by_hand();
  // Scores: 1.5 / 50 = 0.03, 1 / (80 + 20) = 0.01, 0.5 / (20 + 5) = 0.02, 1 / 10 = 0.1 and 0.1 / 20
  // = 0.005. Within a material, records are ordered by the Morton code of the hit.
  EXPECT_EQ(order_of("cost-benefit", r), (Order{2, 6, 5, 1, 4, 3, 7, 0}));
  r.costs.texture_ns[1] = 100;  // 0.5 / 120 < 0.005
  EXPECT_EQ(order_of("cost-benefit", r), (Order{5, 1, 4, 2, 6, 3, 7, 0}));
  r.costs.material_ns.assign(5, 0.f);  // unknown costs
  EXPECT_NO_FATAL_FAILURE(order_of("cost-benefit", r));
}

TEST(Policies, RandomRunsAreMaterialsRunsInAnotherOrder) {
  std::mt19937 rng(5);
  Records r;
  for (uint32_t m = 0; m < 40; ++m) {
    r.traits.push_back({m % 4, MaterialTraits::kNone, 0});
    r.costs.material_ns.push_back(static_cast<float>(1 + m));
  }
  for (int i = 0; i < 2000; ++i) r.add(rng() % 40, 1, 0, 0);
  std::set<Order> orders_of_runs;
  for (r.depth = 0; r.depth < 8; ++r.depth) {
    const Order order = order_of("random-runs", r);
    EXPECT_EQ(order, order_of("random-runs", r)) << "pure";
    Order runs, programs;
    for (const uint32_t i : order) {
      if (runs.empty() || runs.back() != r.material[i]) runs.push_back(r.material[i]);
      if (programs.empty() || programs.back() != r.program[i]) programs.push_back(r.program[i]);
    }
    EXPECT_EQ(runs.size(), 40u) << "one run a material";
    EXPECT_EQ(programs.size(), 4u) << "programs stay together";
    orders_of_runs.insert(runs);
  }
  EXPECT_EQ(orders_of_runs.size(), 8u) << "every depth has its own";
}

TEST(Policies, NamesAndUnknownNames) {
  const std::vector<std::string> names = policy_names();
  EXPECT_EQ(names, (std::vector<std::string>{"none", "program", "code", "material", "texture",
                                             "texture-locality", "cost-benefit", "random-runs",
                                             "adaptive"}));
  EXPECT_THROW(make_policy("best"), Error);
  EXPECT_THROW(make_policy(""), Error);
}

TEST(Policies, AscendingBitsAscend) {
  const float values[] = {-3.f, -0.f, 0.f, 1e-40f, 1e-20f, 1.f, 1.0000001f, 50.f, 1e30f};
  for (size_t i = 1; i < std::size(values); ++i)
    EXPECT_EQ(ascending_bits(values[i - 1]) < ascending_bits(values[i]),
              std::max(values[i - 1], 0.f) < values[i])
        << values[i];
}

// ---- comparison with a naive model --------------------------------------------------------------

using Key = std::tuple<uint64_t, uint64_t, uint64_t, uint64_t>;

/// Keys of the table in docs/scheduling.md, written without optimisation.
std::map<std::string, std::vector<Key>> naive_keys(const Records& r) {
  std::vector<float> score(r.traits.size());
  for (size_t i = 0; i < r.size(); ++i) score[r.material[i]] += r.throughput[i];
  for (uint32_t m = 0; m < score.size(); ++m)
    score[m] /= r.costs.material(m) + r.costs.texture(r.traits[m].texture);
  std::map<std::string, std::vector<Key>> keys;
  for (size_t i = 0; i < r.size(); ++i) {
    const uint32_t m = r.material[i];
    const uint64_t p = r.traits[m].program;
    keys["none"].emplace_back(i, 0, 0, 0);
    keys["program"].emplace_back(p, 0, 0, 0);
    keys["material"].emplace_back(p, std::bit_cast<uint32_t>(r.costs.material(m)), m, 0);
    keys["texture"].emplace_back(p, r.traits[m].texture_bytes, 0, 0);
    keys["texture-locality"].emplace_back(p, m, r.texture_key[i], 0);
    keys["cost-benefit"].emplace_back(p, ~std::bit_cast<uint32_t>(score[m]) >> 6, r.position_key[i],
                                      0);
  }
  return keys;
}

Records random_records(size_t n, uint32_t seed) {
  std::mt19937 rng(seed);
  Records r;
  constexpr uint32_t kMaterials = 23;
  r.costs.texture_ns = {5, 50, 15};
  for (uint32_t m = 0; m < kMaterials; ++m) {
    const uint32_t texture = m % 4 == 3 ? MaterialTraits::kNone : m % 4;
    r.traits.push_back(
        {m % 5, texture, texture == MaterialTraits::kNone ? 0 : 1000u * (texture + 1)});
    r.costs.material_ns.push_back(static_cast<float>(20 + rng() % 60));
  }
  for (size_t i = 0; i < n; ++i)
    r.add(rng() % kMaterials, static_cast<float>(rng() % 1000 + 1) / 1000, rng() & 0x3fffffffu,
          rng() & 0x1ffffffu);
  return r;
}

constexpr size_t kFull = 4096;
constexpr size_t kSizes[] = {0, 1, 2, 3, 4, 5, 7, 8, 9, 15, 16, 17, 255, 256, 257, kFull};

TEST(Policies, EqualAStableSortOfTheTable) {
  for (const size_t n : kSizes) {
    for (uint32_t seed = 0; seed < 3; ++seed) {
      Records r = random_records(n, seed);
      for (const auto& [name, keys] : naive_keys(r)) {
        Order expected(n);
        std::iota(expected.begin(), expected.end(), 0u);
        std::stable_sort(expected.begin(), expected.end(),
                         [&](uint32_t a, uint32_t b) { return keys[a] < keys[b]; });
        EXPECT_EQ(order_of(name, r), expected) << name << ", " << n;
      }
    }
  }
}

TEST(Policies, BatchesCoverTheQueueOnce) {
  for (const std::string& name : policy_names()) {
    if (name == "adaptive") continue;
    for (const size_t n : kSizes) {
      for (const bool materialize : {false, true}) {
        Records r = random_records(n, 7);
        ShadingQueue queue(kFull, 1);
        queue.size = n;
        std::copy_n(r.program.data(), n, queue.uints(ShadingQueue::kProgram));
        std::copy_n(r.material.data(), n, queue.uints(ShadingQueue::kMaterial));
        const Order order = order_of(name, r);
        std::copy_n(order.data(), n, queue.sorted_indices);
        queue.ordered = name != "none";
        if (materialize) queue.materialize();

        std::vector<uint32_t> times(n);
        size_t begin = 0, batches = 0;
        while (begin < queue.size) {
          const size_t end = batch_end<float>(queue, begin);
          ASSERT_EQ(batch_end<FloatP<4>>(queue, begin), end);
          ASSERT_EQ(batch_end<FloatP<16>>(queue, begin), end);
          ASSERT_GT(end, begin);
          ASSERT_LE(end, n);
          ASSERT_LE(end - begin, kMaxBatch);
          const auto record = [&](size_t i) { return queue.ordered ? queue.sorted_indices[i] : i; };
          const auto arrival = [&](size_t i) {
            return queue.ordered || queue.moved ? queue.sorted_indices[i] : i;
          };
          const auto program = [&](size_t i) {
            return queue.uints(ShadingQueue::kProgram)[record(i)];
          };
          for (size_t i = begin; i < end; ++i) {
            ASSERT_EQ(program(i), program(begin)) << "one program a batch";
            ASSERT_EQ(program(i), r.program[arrival(i)]) << "the record itself";
            ++times[arrival(i)];
          }
          if (end < n && end - begin < kMaxBatch) {
            EXPECT_NE(program(end), program(begin)) << "a batch is as long as it can be";
          }
          begin = end;
          ++batches;
        }
        EXPECT_EQ(times, std::vector<uint32_t>(n, 1)) << name << ", " << n;
        // Five programs: at most five batches are not full if programs are grouped.
        if (name != "none") {
          EXPECT_LE(batches, n / kMaxBatch + 5) << name << ", " << n;
        }
      }
    }
  }
}

}  // namespace
}  // namespace wavecomb
