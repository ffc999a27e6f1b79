// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/render/watch.h"

#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <stdexcept>
#include <thread>

namespace wavecomb {
namespace {

using namespace std::chrono_literals;

TEST(Watch, WorkThatIsQuickIsNotLookedAt) {
  int looks = 0;
  bool done = false;
  Watch watch;
  watch.run([&] { done = true; }, [&] { return ++looks, Request::kContinue; }, {});
  EXPECT_TRUE(done);
  EXPECT_EQ(looks, 0);
  EXPECT_FALSE(watch.stopped());
}

TEST(Watch, StopsWork) {
  Watch watch;
  watch.run(
      [&] {
        while (!watch.halted()) std::this_thread::sleep_for(1ms);
        EXPECT_TRUE(watch.stopped());
      },
      [] { return Request::kStop; }, {});
  EXPECT_TRUE(watch.stopped());
}

TEST(Watch, AnotherThreadStopsWorkWithoutWaitingForALook) {
  Watch watch(3600);
  std::thread other([&] {
    std::this_thread::sleep_for(5ms);
    watch.stop();
  });
  watch.run(
      [&] {
        while (!watch.halted()) std::this_thread::sleep_for(1ms);
      },
      [] { return Request::kContinue; }, {});
  other.join();
  EXPECT_TRUE(watch.stopped());
}

TEST(Watch, AStopDuringASnapshotIsNotLost) {
  Watch watch(0.001);
  int snapshots = 0;
  watch.run(
      [&] {
        while (!watch.stopped()) {
          while (!watch.halted()) std::this_thread::sleep_for(100us);
          watch.rest();
        }
      },
      [] { return Request::kSnapshot; },
      [&] {
        if (++snapshots == 2) watch.stop();
      });
  EXPECT_EQ(snapshots, 2);
}

TEST(Watch, SnapshotsAreTakenWhileWorkStandsStill) {
  Watch watch;
  uint64_t steps = 0;
  uint64_t last = 0;
  std::atomic<uint64_t> told = 0;
  int snapshots = 0;
  watch.run(
      [&] {
        while (snapshots < 3) {
          while (!watch.halted()) {
            told = ++steps;
            std::this_thread::sleep_for(100us);
          }
          EXPECT_FALSE(watch.stopped());
          watch.rest();
          EXPECT_FALSE(watch.halted());
        }
      },
      [&] { return told > last ? Request::kSnapshot : Request::kContinue; },
      [&] {
        const uint64_t before = steps;
        std::this_thread::sleep_for(10ms);
        EXPECT_EQ(steps, before);
        EXPECT_GT(steps, last);
        last = steps;
        ++snapshots;
      });
  EXPECT_EQ(snapshots, 3);
}

TEST(Watch, RestReturnsWhereNothingIsWanted) {
  Watch watch;
  watch.run([&] { watch.rest(); }, [] { return Request::kContinue; }, {});
}

TEST(Watch, WhatIsThrownComesOut) {
  const auto until_halted = [](Watch& watch) {
    while (!watch.halted()) std::this_thread::sleep_for(1ms);
    watch.rest();
    while (!watch.stopped()) std::this_thread::sleep_for(1ms);
  };
  Watch work, poll, snapshot;
  EXPECT_THROW(
      work.run([] { throw std::runtime_error("work"); }, [] { return Request::kContinue; }, {}),
      std::runtime_error);
  EXPECT_THROW(poll.run([&] { until_halted(poll); },
                        []() -> Request { throw std::logic_error("look"); }, {}),
               std::logic_error);
  EXPECT_THROW(snapshot.run([&] { until_halted(snapshot); }, [] { return Request::kSnapshot; },
                            [] { throw std::logic_error("snapshot"); }),
               std::logic_error);
}

}  // namespace
}  // namespace wavecomb
