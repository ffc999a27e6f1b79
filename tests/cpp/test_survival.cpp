// SPDX-License-Identifier: Apache-2.0
/// Efficiency-aware Russian roulette: one image for all schedules, an unbiased mean for any
/// estimates, and the moments that paths without roulette predict for paths with it.
#include "chi_square.h"
#include "wave_testing.h"
#include "wavecomb/guiding/field/field.h"
#include "wavecomb/guiding/path_moments.h"

namespace wavecomb {
namespace {

using namespace scene_testing;
using namespace wave_testing;
using chi_square::Random;

/// A guiding field with arbitrary values for directions, costs, moments and image brightness.
class AbsurdField {
 public:
  AbsurdField(const Scene& scene, uint32_t seed) : random_(seed) {
    const Bounds& b = scene.bounds();
    const GuidingGrid grid({b.lo.x, b.lo.y, b.lo.z}, {b.hi.x, b.hi.y, b.hi.z});
    std::vector<TrainingRecord> records;
    const auto between = [&](float lo, float hi) { return lo + (hi - lo) * random_(); };
    for (int i = 0; i < 20000; ++i) {
      TrainingRecord r{};
      r.p[0] = between(b.lo.x, b.hi.x);
      r.p[1] = between(b.lo.y, b.hi.y);
      r.p[2] = between(b.lo.z, b.hi.z);
      r.axis = static_cast<uint8_t>(random_.bits() % kGuidingAxes);
      const Vec3<float> w = octahedral_direction<float>(0.2f * random_(), 0.1f);
      r.wi[0] = w.x, r.wi[1] = w.y, r.wi[2] = w.z;
      r.inverse_distance = random_();
      r.value = random_() * random_() * random_();
      r.pdf = r.bsdf_pdf = 1;
      records.push_back(r);
    }
    field_ = std::make_unique<GuidingField>(grid, records, scene.materials().size(), true, true,
                                            size_t{64} << 20);
    view_ = field_->view();
    const auto absurd = [&] { return std::exp(between(-4.f, 4.f)); };
    for (uint32_t i = 0; i < field_->facts().regions; ++i) survival_.push_back(absurd());
    for (uint32_t i = 0; i < 16 * 16; ++i) tiles_.push_back(absurd());
    view_.survival = survival_.data();
    view_.tiles = tiles_.data();
    view_.tile_rows = 16;
    view_.tiles_of_x = view_.tiles_of_y = 0.3f;
  }
  const GuidingView& view() const { return view_; }

 private:
  Random random_;
  std::unique_ptr<GuidingField> field_;
  std::vector<float> survival_, tiles_;
  GuidingView view_;
};

Settings survival_settings() {
  Settings s;
  s.width = size_for_build(29, 4);
  s.height = size_for_build(23, 4);
  s.spp = 4;
  s.max_depth = 6;
  s.roulette = RouletteKind::kEfficient;
  s.aovs.bits = AovSet::kAll & ~static_cast<uint32_t>(Aov::kCost);
  return s;
}

TEST(Survival, IsOnePictureForAllSchedules) {
  for (const ScenePtr& scene : {cornell(), mixed(), emissive_meshes(), presence()}) {
    const auto accel = std::make_shared<const EmbreeAccelerator>(scene, 1u);
    const AbsurdField absurd(*scene, 7);
    Settings s = survival_settings();
    WaveRun reference(scene, {s, kReferenceLanes, 1}, accel);
    reference.guide(absurd.view());
    reference.all(64);
    const RenderedImage expected = reference.image();
    const Counts& counts = reference.reference_counts();
    for (const uint32_t lanes : lane_widths())
      for (const uint32_t wave_size : {64u, 1000u})
        for (const char* policy : {"none", "random-runs"}) {
          s.policy = policy;
          s.materialize = wave_size == 64 ? Materialize::kOn : Materialize::kOff;
          const uint32_t traversal = lanes == 1 ? 1 : std::min(lanes, accel->native_width());
          WaveRun run(scene, {s, lanes, traversal}, accel);
          run.guide(absurd.view());
          run.all(wave_size);
          expect_same_image(expected, run.image(),
                            std::to_string(lanes) + " lanes, waves of " +
                                std::to_string(wave_size) + ", policy " + policy);
          EXPECT_EQ(run.wave().counts.rays, counts.rays);
          if (testing::Test::HasFailure()) return;
        }
  }
}

/// The mean equals that of plain paths for any estimates of bounces and light.
TEST(Survival, HasTheSameMeanForAbsurdCostsAndFields) {
  for (const ScenePtr& scene : {cornell(), mixed()}) {
    const auto accel = std::make_shared<const EmbreeAccelerator>(scene, 1u);
    Settings s = survival_settings();
    s.aovs = {};
    s.width = s.height = 16;
    s.spp = 16;
    s.filter = FilterKind::kBox;
    std::vector<double> plain, believed;
    const AbsurdField absurd(*scene, 3);
    for (s.seed = 0; s.seed < size_for_build(40, 10); ++s.seed) {
      const auto mean = [&](bool believes) {
        Settings own = s;
        if (!believes) {
          own.roulette = RouletteKind::kOff;
          own.seed += 1000;
        }
        WaveRun run(scene, {own, lane_widths().back(), accel->native_width()}, accel);
        if (believes) run.guide(absurd.view());
        run.all(1024);
        return mean_of(run.image(), 1).mean;
      };
      plain.push_back(mean(false));
      believed.push_back(mean(true));
    }
    const Mean a = mean_of(plain), b = mean_of(believed);
    const double z = (a.mean - b.mean) / std::hypot(a.error, b.error);
    EXPECT_LT(std::abs(z), 3.5) << a.mean << " and " << b.mean;
    EXPECT_LT(std::hypot(a.error, b.error) / a.mean, kSanitized ? 0.5 : 0.03) << "too noisy";
  }
}

/// Compares the formula of roulette at the second vertex with a simulation.
TEST(Survival, PathsWithoutRouletteTellOfItsMoments) {
  for (const double q : {0.25, 0.6, 1.0}) {
    // A bounce halves the throughput and contributes 2; the next bounce multiplies the throughput
    // by a third and contributes x, which is 0 or 6 with equal probability.
    const double ray = 1, vertex = 2;
    double squared = 0, cost = 0, played = 0, played_cost = 0;
    for (const double x : {0.0, 6.0}) {
      const PathStep path[] = {{1, 0.5, 0.5 * (2 + x / 3), 1, vertex},
                               {0.5, 1.0 / 6, x / 6, q, vertex}};
      BounceMoments moments[2];
      compute_path_moments(path, ray, 0, moments);
      squared += moments[0].squared / 2;
      cost += moments[0].cost / 2;
      EXPECT_DOUBLE_EQ(moments[1].cost, ray);
      EXPECT_DOUBLE_EQ(moments[1].squared, x * x / 9);
    }
    Random random(5);
    const int rounds = 400000;
    for (int i = 0; i < rounds; ++i) {
      const bool survives = double{random()} < q;
      const double x = survives && random() < 0.5f ? 6.0 / q : 0.0;
      const double l = 0.5 * (2 + x / 3);
      played += l * l / rounds;
      played_cost += (ray + vertex + (survives ? ray : 0)) / rounds;
    }
    EXPECT_NEAR(squared, played, 0.02 * played) << q;
    EXPECT_NEAR(cost, played_cost, 0.01 * played_cost) << q;
  }
}

/// A path that ends has no further cost; a truncated path has the given cost of its tail.
TEST(Survival, EndsOfPathsHaveTheirCosts) {
  BounceMoments moments[2];
  const PathStep ended[] = {{1, 0.5, 1, 1, 2}, {0.5, 0, 0, 0.5, 2}};
  compute_path_moments(ended, 1, 7, moments);
  EXPECT_DOUBLE_EQ(moments[1].cost, 0);
  EXPECT_DOUBLE_EQ(moments[0].cost, 3);
  const PathStep cut[] = {{1, 0.5, 1, 1, 2}};
  compute_path_moments(cut, 1, 7, moments);
  EXPECT_DOUBLE_EQ(moments[0].cost, 8);
}

}  // namespace
}  // namespace wavecomb
