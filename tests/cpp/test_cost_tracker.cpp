// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/schedule/cost_tracker.h"

#include <gtest/gtest.h>

namespace wavecomb {
namespace {

using Ids = std::vector<uint32_t>;
constexpr uint32_t kNone = MaterialTraits::kNone;

CostSnapshot unknown(size_t materials, size_t textures) {
  CostSnapshot costs;
  costs.material_ns.assign(materials, 0.f);
  costs.texture_ns.assign(textures, 0.f);
  return costs;
}

TEST(CostTracker, ChargesABatchToItsRecordsAlike) {
  CostTracker tracker(3);
  tracker.charge(Ids{0, 0, 1, 0}, 100);
  tracker.charge(Ids{1}, 7);
  EXPECT_DOUBLE_EQ(tracker.ns()[0], 75);
  EXPECT_DOUBLE_EQ(tracker.ns()[1], 32);
  EXPECT_DOUBLE_EQ(tracker.ns()[2], 0);
  EXPECT_EQ(tracker.timed()[0], 3u);
  EXPECT_EQ(tracker.timed()[1], 2u);
  EXPECT_EQ(tracker.timed()[2], 0u);
  EXPECT_EQ(tracker.record_counts()[0], 0u) << "timing does not count";
  tracker.count(Ids{2, 2, 0});
  EXPECT_EQ(tracker.record_counts()[2], 2u);
  EXPECT_EQ(tracker.record_counts()[0], 1u);
}

TEST(CostTracker, TakeMovesMeasurementsAndLeavesCounts) {
  CostTracker sum(2), worker(2);
  sum.charge(Ids{0}, 10);
  worker.charge(Ids{0, 1}, 40);
  worker.count(Ids{0, 1, 1});
  sum.take(worker);
  EXPECT_DOUBLE_EQ(sum.ns()[0], 30);
  EXPECT_DOUBLE_EQ(sum.ns()[1], 20);
  EXPECT_EQ(sum.timed()[0], 2u);
  EXPECT_DOUBLE_EQ(worker.ns()[0], 0);
  EXPECT_EQ(worker.timed()[1], 0u);
  EXPECT_EQ(worker.record_counts()[1], 2u);
  EXPECT_EQ(sum.record_counts()[1], 0u);
  sum.take(worker);
  EXPECT_DOUBLE_EQ(sum.ns()[0], 30) << "nothing is taken twice";
}

TEST(CostTracker, WhatIsBesideIsAShareOfEachTimedRecord) {
  CostTracker sum(2), worker(2);
  worker.count(Ids{0, 0, 0, 0, 1});
  worker.charge(Ids{0, 0}, 40);  // two of four
  worker.charge_untimed(0, 100);
  sum.take(worker);
  EXPECT_DOUBLE_EQ(sum.ns()[0], 40 + 2 * 25);
  worker.count(Ids{0, 0});
  worker.charge(Ids{0}, 10);
  sum.take(worker);
  EXPECT_DOUBLE_EQ(sum.ns()[0], 90 + 10) << "what was beside is taken once";
}

TEST(CostTracker, TimesFewBatches) {
  CostTracker tracker(1);
  int large = 0, small = 0;
  for (int i = 0; i < 3200; ++i) {
    large += tracker.wants(256);
    small += tracker.wants(5);
  }
  EXPECT_EQ(large, 400);
  EXPECT_EQ(small, 100);
}

TEST(MergeCosts, MovingAverage) {
  const std::vector<MaterialTraits> traits(2);
  CostSnapshot costs = unknown(2, 0);
  CostTracker first(2);
  first.charge(Ids{0, 0}, 200);
  merge_costs(first, traits, 0.25f, costs);
  EXPECT_FLOAT_EQ(costs.material_ns[0], 100) << "nothing was known: taken as it is";
  EXPECT_FLOAT_EQ(costs.material_ns[1], 0) << "nothing was measured: left as it was";
  EXPECT_FLOAT_EQ(costs.mean_ns, 100);

  CostTracker second(2);
  second.charge(Ids{0}, 60);
  second.charge(Ids{1, 1, 1}, 30);
  merge_costs(second, traits, 0.25f, costs);
  EXPECT_FLOAT_EQ(costs.material_ns[0], 0.75f * 100 + 0.25f * 60);
  EXPECT_FLOAT_EQ(costs.material_ns[1], 10);
  EXPECT_FLOAT_EQ(costs.mean_ns, 90.f / 4) << "over the records of the pass";

  CostTracker third(2);
  third.charge(Ids{0}, 50);
  merge_costs(third, traits, 1.f, costs);
  EXPECT_FLOAT_EQ(costs.material_ns[0], 50) << "weight 1: the last pass alone";
  third = CostTracker(2);
  third.charge(Ids{0}, 1000);
  merge_costs(third, traits, 0.f, costs);
  EXPECT_FLOAT_EQ(costs.material_ns[0], 50) << "weight 0: what was known";
}

TEST(MergeCosts, TexturesAreMeansOfTheRecordsThatReadThem) {
  const std::vector<MaterialTraits> traits = {
      {0, 0, 10}, {1, 0, 10}, {0, 1, 20}, {0, kNone, 0}, {0, 2, 30}};
  CostSnapshot costs = unknown(5, 3);
  CostTracker tracker(5);
  tracker.charge(Ids{0, 0, 0}, 90);  // 30 each
  tracker.charge(Ids{1}, 70);
  tracker.charge(Ids{2, 2}, 100);  // 50 each
  tracker.charge(Ids{3}, 500);
  merge_costs(tracker, traits, 0.5f, costs);
  EXPECT_FLOAT_EQ(costs.texture_ns[0], 160.f / 4);
  EXPECT_FLOAT_EQ(costs.texture_ns[1], 50);
  EXPECT_FLOAT_EQ(costs.texture_ns[2], 0) << "nobody read it";
  EXPECT_FLOAT_EQ(costs.texture(kNone), 0);
  CostTracker again(5);
  again.charge(Ids{2}, 150);
  merge_costs(again, traits, 0.5f, costs);
  EXPECT_FLOAT_EQ(costs.texture_ns[1], 100);
  EXPECT_FLOAT_EQ(costs.texture_ns[0], 40);
}

TEST(MergeCosts, NothingMeasuredChangesNothing) {
  const std::vector<MaterialTraits> traits(2);
  CostSnapshot costs = unknown(2, 0);
  costs.material_ns = {3, 4};
  costs.mean_ns = 5;
  const CostPrediction p = merge_costs(CostTracker(2), traits, 0.5f, costs);
  EXPECT_EQ(p.materials, 0u);
  EXPECT_EQ(costs.material_ns, (std::vector<float>{3, 4}));
  EXPECT_EQ(costs.mean_ns, 5);
}

TEST(MergeCosts, PredictionByHand) {
  const std::vector<MaterialTraits> traits(4);
  CostSnapshot costs = unknown(4, 0);
  costs.material_ns = {40, 110, 0, 70};
  CostTracker tracker(4);
  tracker.charge(Ids{0, 0, 0}, 150);  // 50 each
  tracker.charge(Ids{1}, 100);
  tracker.charge(Ids{2, 2}, 20);  // 10 each
  const CostPrediction p = merge_costs(tracker, traits, 0.3f, costs);
  EXPECT_EQ(p.materials, 2u);
  // Only materials 0 and 1 can be compared: mean (150 + 100) / 4 = 62.5; residual 3 x 10^2 + 1 x
  // 10^2 = 400; variance 3 x 12.5^2 + 37.5^2 = 1875; error 3 x 10 + 10.
  EXPECT_NEAR(p.r2, 1 - 400. / 1875, 1e-9);
  EXPECT_NEAR(p.mean_error, 40. / 250, 1e-9);
}

TEST(MergeCosts, PerfectAndPoorPredictions) {
  const std::vector<MaterialTraits> traits(2);
  CostTracker tracker(2);
  tracker.charge(Ids{0}, 50);
  tracker.charge(Ids{1}, 100);
  CostSnapshot costs = unknown(2, 0);
  costs.material_ns = {50, 100};
  CostPrediction p = merge_costs(tracker, traits, 0.3f, costs);
  EXPECT_NEAR(p.r2, 1, 1e-9);
  EXPECT_NEAR(p.mean_error, 0, 1e-9);
  costs.material_ns = {75, 75};
  p = merge_costs(tracker, traits, 0.3f, costs);
  EXPECT_NEAR(p.r2, 0, 1e-9);
  EXPECT_NEAR(p.mean_error, 50. / 150, 1e-9);
  costs.material_ns = {100, 50};  // reversed order
  p = merge_costs(tracker, traits, 0.3f, costs);
  EXPECT_NEAR(p.r2, 1 - 5000. / 1250, 1e-9);
  // A single material has no variance.
  CostTracker one(2);
  one.charge(Ids{0}, 50);
  costs.material_ns = {50, 0};
  EXPECT_EQ(merge_costs(one, traits, 0.3f, costs).r2, 1);
  costs.material_ns = {60, 0};
  EXPECT_EQ(merge_costs(one, traits, 0.3f, costs).r2, 0);
}

}  // namespace
}  // namespace wavecomb
