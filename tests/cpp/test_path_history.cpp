// SPDX-License-Identifier: Apache-2.0
// Path histories: vertices of finished paths, read as guiding does to learn incident light.
#include <map>
#include <mutex>

#include "wave_testing.h"
#include "wavecomb/core/encoding/fixed_point.h"

namespace wavecomb {
namespace {

using namespace scene_testing;
using namespace wave_testing;

/// Sums of the radiance returned along bounces, L_j = (R_end - R_j) / T_j, by spatial cell and
/// octant of direction, in integers.
class LightField final : public HistoryReader {
 public:
  using Key = std::array<int, 4>;
  struct Sums {
    int64_t light[3] = {}, vertices = 0;
    bool operator==(const Sums&) const = default;
  };

  explicit LightField(uint32_t most) : most_(most) {}
  uint32_t most() const override { return most_; }
  void ended(const PathHistory& history, const float* radiance, const WaveTask& task) override {
    const std::lock_guard lock(mutex_);
    for (uint32_t slot = 0; slot < task.path_count(); ++slot) {
      const Color<float> end = load_row<RadianceRow, float>(radiance, slot, true).sum;
      ASSERT_LE(history.count(slot), most_);
      for (uint32_t i = 0; i < history.count(slot); ++i) add(history.vertex(slot, i), end);
    }
  }
  const std::map<Key, Sums>& sums() const { return sums_; }
  /// Sums over all cells.
  Sums total() const {
    Sums all;
    for (const auto& [key, s] : sums_) {
      for (size_t c = 0; c < 3; ++c) all.light[c] += s.light[c];
      all.vertices += s.vertices;
    }
    return all;
  }
  static constexpr FixedPoint kUnit{-20};

 private:
  void add(const HistoryRow<float>& v, const Color<float>& end) {
    const auto cell = [](float x) { return static_cast<int>(std::floor(2 * x)); };
    const int octant = (v.wi.x < 0 ? 1 : 0) + (v.wi.y < 0 ? 2 : 0) + (v.wi.z < 0 ? 4 : 0);
    Sums& s = sums_[{cell(v.p.x), cell(v.p.y), cell(v.p.z), octant}];
    ++s.vertices;
    const auto share = [](float x, float r, float t) { return t > 0 ? (x - r) / t : 0.f; };
    s.light[0] += kUnit.from(share(end.x, v.radiance.x, v.throughput.x));
    s.light[1] += kUnit.from(share(end.y, v.radiance.y, v.throughput.y));
    s.light[2] += kUnit.from(share(end.z, v.radiance.z, v.throughput.z));
  }

  uint32_t most_;
  std::mutex mutex_;
  std::map<Key, Sums> sums_;
};

Settings small_settings() {
  Settings s;
  s.width = size_for_build(21, 3);
  s.height = size_for_build(17, 3);
  s.spp = 4;
  s.max_depth = 6;
  return s;
}

TEST(PathHistory, IsOneForAllSchedules) {
  for (const ScenePtr& scene : {cornell(), mixed(), presence()}) {
    const auto accel = std::make_shared<const EmbreeAccelerator>(scene, 1u);
    Settings s = small_settings();
    const auto field_of = [&](const WaveCase& c, uint32_t wave_size, uint32_t most) {
      auto field = std::make_unique<LightField>(most);
      WaveRun run(scene, c, accel, field.get());
      run.all(wave_size);
      return field;
    };
    const auto expected = field_of({s}, 64, 4);
    const LightField::Sums total = expected->total();
    EXPECT_GT(total.vertices, s.width * s.height * s.spp);
    EXPECT_GT(total.light[1], 0);
    for (const uint32_t lanes : lane_widths())
      for (const uint32_t wave_size : {60u, 1024u})
        for (const char* policy : {"none", "program", "random-runs"}) {
          s.policy = policy;
          const uint32_t traversal = lanes == 1 ? 1 : std::min(lanes, accel->native_width());
          const auto field = field_of({s, lanes, traversal}, wave_size, 4);
          EXPECT_TRUE(field->sums() == expected->sums())
              << lanes << " lanes, waves of " << wave_size << ", policy " << policy;
        }
    // The first vertices are the same if the history stores fewer.
    EXPECT_LT(field_of({s}, 64, 1)->total().vertices, total.vertices);
  }
}

/// Histories do not change the image, and without a reader none are stored.
TEST(PathHistory, ChangesNoPicture) {
  const ScenePtr scene = mixed();
  const auto accel = std::make_shared<const EmbreeAccelerator>(scene, 1u);
  const Settings s = small_settings();
  for (const uint32_t lanes : {kReferenceLanes, lane_widths().back()}) {
    LightField field(8);
    WaveRun plain(scene, {s, lanes, 1}, accel), keeping(scene, {s, lanes, 1}, accel, &field);
    plain.all(512);
    keeping.all(512);
    expect_same_image(plain.image(), keeping.image(), std::to_string(lanes) + " lanes");
    if (lanes == kReferenceLanes) continue;
    EXPECT_EQ(plain.wave().history.bytes(), 0u);
    EXPECT_EQ(keeping.wave().history.most(), 8u);
    EXPECT_EQ(keeping.wave().bytes() - plain.wave().bytes(), keeping.wave().history.bytes());
  }
}

/// Checks each vertex.
class Furnace final : public HistoryReader {
 public:
  static constexpr uint32_t kMax = 3;
  uint32_t most() const override { return kMax; }
  void ended(const PathHistory& history, const float* radiance, const WaveTask& task) override {
    for (uint32_t slot = 0; slot < task.path_count(); ++slot) {
      const float end = load_row<RadianceRow, float>(radiance, slot, true).sum.y;
      EXPECT_EQ(history.count(slot), kMax) << "walls are closed, and roulette is off";
      for (uint32_t i = 0; i < history.count(slot); ++i) {
        const HistoryRow<float> v = history.vertex(slot, i);
        light[i].push_back(double{(end - v.radiance.y) / v.throughput.y});
        EXPECT_NEAR(v.throughput.y, std::pow(0.5f, static_cast<float>(i + 1)), 1e-5f);
        EXPECT_NEAR(length(v.wi), 1.f, 1e-4f);
        EXPECT_GT(v.pdf, 0.f);
        EXPECT_NEAR(length(v.p), 1.f, 0.02f);
      }
    }
  }
  std::vector<double> light[kMax];
};

/// A point light at the centre of a sphere of reflectance 1/2: the radiance returned along a bounce
/// is
///    L = rho / pi I / R^2 / (1 - rho)
/// at every vertex.
TEST(PathHistory, FindsTheLightThatBouncesMeet) {
  SceneBuilder b;
  const uint32_t wall = b.add_material(make_material(ProgramId::kDiffuse));
  b.add_to_group(0, b.add_mesh(make_mesh(sphere(32, false), wall)));
  Light point = make_light(LightKind::kSphere, {3, 3, 3});
  point.radius = 0;
  b.add_light(point);
  b.set_camera(make_camera({0.3, 0.2, 0.4}, {0, 0, 0}));
  Settings s = small_settings();
  s.width = s.height = 16;
  s.spp = size_for_build(128, 8);
  s.max_depth = 24;
  s.roulette = RouletteKind::kOff;
  Furnace furnace;
  WaveRun run(b.build(), {s, lane_widths().back(), 1}, nullptr, &furnace);
  run.all(1024);
  for (const auto& light : furnace.light) {
    const Mean m = mean_of(light);
    EXPECT_NEAR(m.mean, 3 / kPiD, 4 * m.error + 0.01);
    EXPECT_LT(4 * m.error, kSanitized ? 0.2 : 0.03) << "too noisy to tell";
  }
}

}  // namespace
}  // namespace wavecomb
