// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/schedule/chooser.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <numeric>
#include <random>

namespace wavecomb {
namespace {

/// Simulates a chooser that selects among several ways of working ("arms") with given run times,
/// and adds up the time spent.
class Game {
 public:
  /// Returns the run time of an arm per packet in a given round, in nanoseconds.
  using RunNs = std::function<double(size_t arm, int round)>;

  Game(size_t arms, RunNs run_ns, std::vector<double> prepare_ns)
      : chooser(arms), arms_(arms), run_ns_(std::move(run_ns)), prepare_ns_(std::move(prepare_ns)) {
    work.assign(arms, {100, 1600});
  }
  size_t play(uint32_t depth = 0) {
    const size_t arm = chooser.choose(depth, work);
    const Work& w = work[arm];
    const double noise = noise_ ? noise_() : 1.0;
    const double run = w.packets * run_ns_(arm, round_), prepare = w.records * prepare_ns_[arm];
    chooser.learn(depth, arm, w, noise * run, noise * prepare);
    spent += run + prepare;
    double least = 1e300;
    for (size_t a = 0; a < arms_; ++a)
      least =
          std::min(least, work[a].packets * run_ns_(a, round_) + work[a].records * prepare_ns_[a]);
    best += least;
    ++round_;
    return arm;
  }
  void noise(std::function<double()> f) { noise_ = std::move(f); }

  Chooser chooser;
  std::vector<Work> work;
  double spent = 0, best = 0;  ///< without noise

 private:
  size_t arms_;
  RunNs run_ns_;
  std::vector<double> prepare_ns_;
  std::function<double()> noise_;
  int round_ = 0;
};

Game::RunNs fixed(std::vector<double> ns) {
  return [ns = std::move(ns)](size_t arm, int) { return ns[arm]; };
}

/// Log-normal noise with occasional spikes, as on a busy machine.
std::function<double()> noisy(uint32_t seed, double spikes = 0) {
  return [rng = std::mt19937(seed), spikes]() mutable {
    const double x = std::exp(std::normal_distribution<double>(0, 0.1)(rng));
    return std::uniform_real_distribution<double>()(rng) < spikes ? 10 * x : x;
  };
}

TEST(Chooser, TriesEachArmThenTakesTheLeast) {
  Game game(3, fixed({300, 100, 200}), {0, 0, 0});
  for (size_t i = 0; i < 6; ++i) EXPECT_EQ(game.play(), i % 3) << "each in turn";
  for (int i = 0; i < 20; ++i) game.play();
  for (const uint64_t used : game.chooser.used())
    EXPECT_GE(used, 2u) << "each, and not by cold caches only";
  for (int i = 0; i < 10; ++i) EXPECT_EQ(game.play(), 1u);
}

TEST(Chooser, WeighsRunningAgainstPreparing) {
  // Sorting costs 10 ns per record. With 1600 records, sorting halves 100 packets of 200 ns: it
  // saves 10 us and costs 16 us. If a packet takes 2000 ns, sorting saves 100 us.
  Game inexpensive(2, fixed({200, 200}), {0, 10});
  inexpensive.work = {{100, 1600}, {50, 1600}};
  Game expensive(2, fixed({2000, 2000}), {0, 10});
  expensive.work = {{100, 1600}, {50, 1600}};
  for (int i = 0; i < 20; ++i) {
    inexpensive.play();
    expensive.play();
  }
  EXPECT_EQ(inexpensive.play(), 0u);
  EXPECT_EQ(expensive.play(), 1u);
  // The next queue arrives already grouped, so sorting saves no packets.
  expensive.work = {{50, 1600}, {50, 1600}};
  EXPECT_EQ(expensive.play(), 0u);
}

TEST(Chooser, LearnsEachDepthForItself) {
  Chooser chooser(2);
  const std::vector<Work> work(2, Work{10, 100});
  const auto play = [&](uint32_t depth) {
    const size_t arm = chooser.choose(depth, work);
    // Arm 0 is faster at even path depths, and arm 1 at odd path depths.
    chooser.learn(depth, arm, work[arm], arm == depth % 2 ? 1000. : 2000., 0);
    return arm;
  };
  for (int i = 0; i < 10; ++i)
    for (uint32_t depth = 0; depth < 6; ++depth) play(depth);
  for (uint32_t depth = 0; depth < 6; ++depth) EXPECT_EQ(play(depth), depth % 2) << depth;
  // All path depths above a limit share one entry.
  for (int i = 0; i < 10; ++i) play(1000 + Chooser::kDepths);
  EXPECT_NO_FATAL_FAILURE(play(0xffffffffu));
}

TEST(Chooser, FindsTheBestArmUnderNoise) {
  for (uint32_t seed = 0; seed < 50; ++seed) {
    const size_t best = seed % 5;
    std::vector<double> ns = {150, 150, 150, 150, 150};
    ns[best] = 100;
    Game game(5, fixed(ns), std::vector<double>(5));
    game.noise(noisy(seed));
    for (int i = 0; i < 2000; ++i) game.play();
    EXPECT_GT(game.chooser.used()[best], 1900u) << seed;
    EXPECT_LT(game.spent / game.best, 1.02) << seed;
  }
}

TEST(Chooser, RegretIsBoundedWhereArmsAreAlike) {
  for (uint32_t seed = 0; seed < 50; ++seed) {
    Game game(5, fixed({100, 102, 104, 106, 108}), std::vector<double>(5));
    game.noise(noisy(seed, 0.01));
    for (int i = 0; i < 2000; ++i) game.play();
    EXPECT_LT(game.spent / game.best, 1.05) << seed;
  }
}

TEST(Chooser, OneSlowMeasurementIsForgiven) {
  // Random spikes in the measured times may make the best arm look slow at first.
  int hits = 0;
  for (uint32_t seed = 0; seed < 200; ++seed) {
    Game game(2, fixed({150, 100}), {0, 0});
    game.noise(noisy(seed, 0.05));
    for (int i = 0; i < 4000; ++i) game.play();
    hits += game.chooser.used()[1] > 3000;
  }
  EXPECT_GE(hits, 198);
}

TEST(Chooser, TriesAgainAtEveryDepth) {
  // In waves of eight depths, exploration must not always use the same depth.
  Chooser chooser(2);
  const std::vector<Work> work(2, Work{10, 100});
  std::vector<int> others(8);
  for (int wave = 0; wave < 1000; ++wave)
    for (uint32_t depth = 0; depth < 8; ++depth) {
      const size_t arm = chooser.choose(depth, work);
      chooser.learn(depth, arm, work[arm], arm == 0 ? 1000. : 1050., 0);
      others[depth] += arm == 1;
    }
  for (uint32_t depth = 0; depth < 8; ++depth) EXPECT_GT(others[depth], 4) << depth;
}

TEST(Chooser, FollowsAChange) {
  // Halfway through the render, run times change: arm 1, which was nearly as good as arm 0, becomes
  // better.
  Game game(2, [](size_t arm, int round) { return arm == 0 || round < 2000 ? 100. : 70.; }, {0, 0});
  game.work[1].packets = 105;
  for (int i = 0; i < 2000; ++i) game.play();
  EXPECT_GT(game.chooser.used()[0], 1900u);
  for (int i = 0; i < 4000; ++i) game.play();
  EXPECT_GT(game.chooser.used()[1], 3000u);
}

TEST(Chooser, EmptyQueuesTeachNothing) {
  Chooser chooser(2);
  chooser.learn(0, 1, {0, 0}, 5, 5);
  chooser.learn(0, 1, {10, 0}, 5, 5);
  EXPECT_EQ(chooser.choose(0, std::vector<Work>(2, Work{1, 1})), 0u) << "still to be tried";
  EXPECT_EQ(std::accumulate(chooser.used().begin(), chooser.used().end(), uint64_t{0}), 2u);
}

}  // namespace
}  // namespace wavecomb
