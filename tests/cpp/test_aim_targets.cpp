// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/light_paths/aiming/aim_targets.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>
#include <vector>

namespace wavecomb {
namespace {

/// Adds `count` random positions around (x, 0, 0), each with contribution `contribution`.
void add_places(std::vector<AimSample>& aim_samples, int count, float x, float spread,
                float contribution) {
  std::mt19937 random(static_cast<uint32_t>(aim_samples.size()) + 1);
  std::uniform_real_distribution<float> off(-spread, spread);
  for (int i = 0; i < count; ++i)
    aim_samples.push_back({x + off(random), off(random), off(random), contribution});
}

TEST(AimTargets, AreSmallWhereTheLightComesFrom) {
  std::vector<AimSample> aim_samples;
  add_places(aim_samples, 300, -20, 0.05f, 1);
  add_places(aim_samples, 300, 40, 3, 1);
  add_places(aim_samples, 2000, 0, 90, 0);
  const LightAim aim = aim_targets(aim_samples, 100);
  ASSERT_GE(aim.count, 2u);
  double small = 0, all = aim.even;
  for (uint32_t k = 0; k < aim.count; ++k) {
    all += aim.share[k];
    if (aim.x[k] < 0) {
      small += aim.share[k];
      EXPECT_LT(aim.radius[k], 0.2f);
    } else {
      EXPECT_LT(aim.radius[k], 8);
    }
    EXPECT_NEAR(aim.end[k], all, 1e-6);
  }
  EXPECT_NEAR(all, 1, 1e-6);
  EXPECT_NEAR(small, 0.5 * (1 - aim.even), 1e-5);
  for (const AimSample& l : aim_samples) {
    bool within = l.contribution == 0;
    for (uint32_t k = 0; k < aim.count; ++k)
      within |= std::hypot(l.x - aim.x[k], l.y - aim.y[k], l.z - aim.z[k]) <= aim.radius[k];
    EXPECT_TRUE(within);
  }
}

TEST(AimTargets, DoNotDependOnHowBrightTheLightIs) {
  std::vector<AimSample> aim_samples;
  add_places(aim_samples, 500, 3, 1, 0.3f);
  add_places(aim_samples, 50, 9, 0.2f, 2);
  const LightAim dark = aim_targets(aim_samples, 20);
  for (AimSample& l : aim_samples) l.contribution *= 0x1p20f;
  const LightAim bright = aim_targets(aim_samples, 20);
  ASSERT_EQ(dark.count, bright.count);
  for (uint32_t k = 0; k < dark.count; ++k) {
    EXPECT_EQ(dark.x[k], bright.x[k]);
    EXPECT_EQ(dark.radius[k], bright.radius[k]);
    EXPECT_EQ(dark.share[k], bright.share[k]);
  }
}

TEST(AimTargets, AreNoneWhereNothingWasFound) {
  EXPECT_EQ(aim_targets({}, 1).count, 0u);
  std::vector<AimSample> aim_samples;
  add_places(aim_samples, 100, 0, 1, 0);
  aim_samples.push_back({0, 0, 0, std::numeric_limits<float>::infinity()});
  EXPECT_EQ(aim_targets(aim_samples, 1).count, 0u);
}

TEST(AimTargets, AreOneSphereWhereAllIsOnePlace) {
  const std::vector<AimSample> aim_samples(64, AimSample{1, 2, 3, 1});
  const LightAim aim = aim_targets(aim_samples, 10);
  ASSERT_EQ(aim.count, 1u);
  EXPECT_GT(aim.radius[0], 0);
  EXPECT_FLOAT_EQ(aim.y[0], 2);
}

}  // namespace
}  // namespace wavecomb
