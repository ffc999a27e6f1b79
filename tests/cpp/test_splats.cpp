// SPDX-License-Identifier: Apache-2.0
// Fixed-point sums, and a light tracer that adds light splats to the film.
#include <random>
#include <thread>

#include "scene_testing.h"
#include "wavecomb/accel/embree_accelerator.h"
#include "wavecomb/core/encoding/fixed_point.h"
#include "wavecomb/core/sampler.h"
#include "wavecomb/core/warp.h"
#include "wavecomb/film/film.h"
#include "wavecomb/path/camera/camera_ray.h"
#include "wavecomb/path/integrator.h"

namespace wavecomb {
namespace {

using namespace scene_testing;

TEST(FixedPoint, RoundsCutsAndForgivesNan) {
  const FixedPoint unit{-4};
  EXPECT_EQ(unit.from(1.f), 16);
  EXPECT_EQ(unit.from(-0.26f), -4);
  EXPECT_EQ(unit.from(0.5f / 16), 0) << "ties go to even";
  EXPECT_EQ(unit.from(1.5f / 16), 2);
  EXPECT_EQ(unit.from(kNan), 0);
  EXPECT_EQ(unit.from(kInf), FixedPoint::kMax);
  EXPECT_EQ(unit.from(-kInf), -FixedPoint::kMax);
  EXPECT_EQ(unit.from(3e38f), FixedPoint::kMax);
  EXPECT_EQ(unit.to_double(24), 1.5);
  EXPECT_EQ(FixedPoint{3}.from(20.f), 2) << "2.5, and ties go to even";
  // The sum of as many maximum values as FixedPoint guarantees does not overflow.
  EXPECT_GE(std::numeric_limits<int64_t>::max() / FixedPoint::kMax, int64_t{1} << 21);
}

TEST(LightSplatList, IsAsLongAsItWasMade) {
  LightSplatList list(2);
  EXPECT_TRUE(list.add({0, 1, 1, 1}));
  EXPECT_TRUE(list.add({1, 1, 1, 1}));
  EXPECT_FALSE(list.add({2, 1, 1, 1}));
  EXPECT_EQ(list.splats().size(), 2u);
  list.clear();
  EXPECT_TRUE(list.add({3, 1, 1, 1}));
}

/// Floating-point sums would depend on the order of addition; fixed-point sums do not.
TEST(LightSplatLayer, OrderAndThreadsDoNotShow) {
  constexpr uint32_t kPixels = 64, kLists = 40;
  std::mt19937 rng(3);
  std::vector<LightSplatList> lists;
  for (uint32_t i = 0; i < kLists; ++i) {
    LightSplatList& list = lists.emplace_back(500);
    for (int k = 0; k < 500; ++k) {
      const auto x = [&] {
        return std::ldexp(static_cast<float>(rng() % 4096), int(rng() % 24) - 24);
      };
      EXPECT_TRUE(list.add({static_cast<uint32_t>(rng() % kPixels), x(), x(), x()}));
    }
  }
  LightSplatLayer in_order(kPixels, {-30}), reversed(kPixels, {-30}), at_once(kPixels, {-30});
  for (uint32_t i = 0; i < kLists; ++i) {
    in_order.add(lists[i], i);
    reversed.add(lists[kLists - 1 - i], kLists - 1 - i);
  }
  std::vector<std::thread> threads;
  for (uint32_t t = 0; t < 4; ++t)
    threads.emplace_back([&, t] {
      for (uint32_t i = t; i < kLists; i += 4) at_once.add(lists[i], i);
    });
  for (std::thread& t : threads) t.join();
  EXPECT_EQ(in_order.sums(), reversed.sums());
  EXPECT_EQ(in_order.sums(), at_once.sums());
  EXPECT_EQ(in_order.mean(7), at_once.mean(7));
  EXPECT_GT(in_order.mean(7)[0], 0);
}

constexpr float kIntensity = 5, kAlbedo = 0.6f;
constexpr std::array<float, 3> kPlace{0.4f, 1.5f, -0.2f};

/// A floor under a point light.
ScenePtr floor_and_point() {
  SceneBuilder b;
  const uint32_t grey = b.add_material(make_material(ProgramId::kDiffuse, Vec3<float>(kAlbedo)));
  b.add_to_group(0, b.add_mesh(make_mesh(ground(3), grey)));
  Light point = make_light(LightKind::kSphere, Vec3<float>(kIntensity),
                           translate(kPlace[0], kPlace[1], kPlace[2]));
  point.radius = 0;
  b.add_light(point);
  b.set_camera(make_camera({0, 2.5, 2}, {0, 0, 0}, 1.2f));
  return b.build();
}

/// Light tracer for tests. Traces one path from the light per sample of a pixel, and connects its
/// hit to the camera: I_j += 4 pi I / N rho / pi cos_theta_p / (r^2 cos^3_alpha A_j) where A_j is
/// the area of pixel j in the camera's window at distance 1, and alpha is the angle between its
/// points and the axis.
class LightTracer final : public Integrator {
 public:
  LightTracer(const EmbreeAccelerator& accel, const CameraSetup& camera, const Camera& description,
              Film& film, uint32_t workers, uint32_t wave_size)
      : accel_(accel), camera_(camera), to_world_(description.to_world), film_(film) {
    for (uint32_t i = 0; i < workers; ++i) lists_.emplace_back(wave_size);
  }

  void run(size_t worker, const WaveTask& task) override {
    LightSplatList& list = lists_[worker];
    list.clear();
    for (uint32_t p = 0; p < task.pixel_count; ++p)
      for (uint32_t s = 0; s < task.samples; ++s) {
        const auto key = make_sample_key<float>(task.pixels[p], task.first_sample + s, 0);
        trace(sample_4d<float>(SamplerKind::kSobol, key, kCameraSet), list);
      }
    film_.splats().add(list, task.path_count());
  }
  WorkerView worker(size_t /*i*/) const override { return {}; }
  uint32_t lanes() const override { return 1; }

 private:
  void trace(const Sample4<float>& r, LightSplatList& list) const {
    const Vec3<float> o{kPlace[0], kPlace[1], kPlace[2]}, d = square_to_sphere(r.x, r.y);
    float t, u, v;
    uint32_t prim, geom, inst;
    accel_.intersect({&o.x, &o.y, &o.z, &d.x, &d.y, &d.z, nullptr, nullptr, 1},
                     {&t, &u, &v, &prim, &geom, &inst}, 1, false, {});
    if (inst == kNoHit) return;
    const Vec3<float> p = fma(d, t, o), eye = to_world_.t, way = p - eye;
    const auto along = [&](float Vec3<float>::* axis) {
      const Vec3<float>* row = to_world_.row;
      return way.x * row[0].*axis + way.y * row[1].*axis + way.z * row[2].*axis;
    };
    const float depth = -along(&Vec3<float>::z);
    const float x = along(&Vec3<float>::x) / depth, y = along(&Vec3<float>::y) / depth;
    const float px = (x - camera_.x0) / camera_.step_x, py = (camera_.y1 - y) / camera_.step_y;
    if (!(depth > 0 && px >= 0 && py >= 0)) return;
    const auto i = static_cast<uint32_t>(px), j = static_cast<uint32_t>(py);
    if (i >= film_.width() || j >= film_.height()) return;
    const float r2 = length_squared(way), distance = std::sqrt(r2);
    const float cos_alpha = depth / distance, cos_p = std::abs(way.y) / distance;
    const float area = camera_.step_x * camera_.step_y;
    const float splat = 4 * kPi * kIntensity * kAlbedo * kInvPi * cos_p /
                        (r2 * cos_alpha * cos_alpha * cos_alpha * area);
    EXPECT_TRUE(list.add({static_cast<uint32_t>(film_.index(i, j)), splat, splat, splat}));
  }

  const EmbreeAccelerator& accel_;
  const CameraSetup& camera_;
  Affine to_world_;
  Film& film_;
  std::vector<LightSplatList> lists_;
};

struct Traced {
  RenderedImage image;
  std::vector<LightSplatLayer::Sum> sums;
};

/// Renders by light tracing, in tasks of `pixels` pixels on `workers` threads.
Traced light_traced(const ScenePtr& scene, const Settings& s, uint32_t workers, uint32_t pixels,
                    bool backwards) {
  const EmbreeAccelerator accel(scene, 1);
  const FilterTable table(s.filter, s.used_filter_width());
  const CameraSetup camera(scene->camera(), s.width, s.height, table);
  Film film(s.width, s.height, {AovSet{0}});
  film.allocate_light_splats({-20});
  std::vector<uint32_t> all;
  for (uint32_t y = 0; y < s.height; ++y)
    for (uint32_t x = 0; x < s.width; ++x) all.push_back(x | y << 16);
  std::vector<WaveTask> tasks;
  for (uint32_t i = 0; i < all.size(); i += pixels)
    for (uint32_t first = 0; first < s.spp; first += s.spp / 2)
      tasks.push_back({all.data() + i, std::min(pixels, static_cast<uint32_t>(all.size()) - i),
                       first, s.spp / 2});
  if (backwards) std::reverse(tasks.begin(), tasks.end());
  LightTracer tracer(accel, camera, scene->camera(), film, workers, pixels * s.spp / 2);
  std::vector<std::thread> threads;
  for (uint32_t w = 0; w < workers; ++w)
    threads.emplace_back([&, w] {
      for (size_t i = w; i < tasks.size(); i += workers) tracer.run(w, tasks[i]);
    });
  for (std::thread& t : threads) t.join();
  Traced out;
  out.sums = film.splats().sums();
  Film::Layers layers = std::move(film).finish({});
  out.image.width = s.width;
  out.image.height = s.height;
  out.image.beauty = std::move(layers.beauty);
  return out;
}

Settings light_settings() {
  Settings s;
  s.width = s.height = 8;
  s.spp = size_for_build(8192, 16);
  s.filter = FilterKind::kBox;
  s.filter_width = 1;
  s.max_depth = 1;
  s.threads = 1;
  return s;
}

TEST(Splats, LightTracingIsOnePictureForAllSchedules) {
  const ScenePtr scene = floor_and_point();
  Settings s = light_settings();
  s.spp = 64;
  const Traced expected = light_traced(scene, s, 1, 64, false);
  EXPECT_GT(mean_of(expected.image).mean, 0);
  for (const uint32_t workers : {1u, 2u, 5u})
    for (const uint32_t pixels : {1u, 7u, 64u})
      for (const bool backwards : {false, true}) {
        const Traced t = light_traced(scene, s, workers, pixels, backwards);
        EXPECT_EQ(t.sums, expected.sums) << workers << " workers, " << pixels << " pixels";
        expect_same_bits(t.image.beauty, expected.image.beauty, "beauty");
      }
}

/// Light tracing and path tracing agree in each of 64 pixels within 4.6 standard errors of a
/// Poisson count, which one run in 3,000 exceeds by chance (Sidak).
TEST(Splats, LightTracingAgreesWithPathTracing) {
  const ScenePtr scene = floor_and_point();
  const Settings s = light_settings();
  const Traced light = light_traced(scene, s, 2, 16, false);
  Settings from_camera = s;
  from_camera.spp = size_for_build(1024, 16);
  const RenderedImage path = WavefrontRenderer(scene).render(from_camera);
  const double paths = 1.0 * s.spp * s.width * s.height;
  for (size_t i = 0; i < path.beauty.size(); i += 3) {
    const double expected = double{path.beauty[i]};
    // Light splats of a pixel are nearly equal, so their number determines the error of the sum.
    const double one = double{4 * kPi * kIntensity * kAlbedo * kInvPi} / (3 * 3 * 0.15 * 0.15);
    const double count = std::max(1.0, expected * paths / one);
    EXPECT_NEAR(light.image.beauty[i], expected,
                4.6 * expected / std::sqrt(count) + 0.003 * expected)
        << "pixel " << i / 3;
  }
  EXPECT_NEAR(mean_of(light.image).mean, mean_of(path).mean, kSanitized ? 0.02 : 0.004);
}

/// Light splats are in the memory blocks that checkpoints save, and count as memory of the film.
TEST(Splats, GoWithTheFilm) {
  Film film(2, 1, {AovSet{0}});
  const size_t plain = film.bytes(), blocks = film.blocks().size();
  film.pixel(0, 0) = {3, 0, 0, 2};
  film.allocate_light_splats({-10});
  EXPECT_EQ(film.bytes() - plain, 2 * sizeof(LightSplatLayer::Sum));
  EXPECT_EQ(film.blocks().size(), blocks + 2);
  LightSplatList list(1);
  ASSERT_TRUE(list.add({0, 1, 2, 4}));
  film.splats().add(list, 4);
  Film copy(2, 1, {AovSet{0}});
  copy.allocate_light_splats({-10});
  auto from = film.blocks();
  auto to = copy.blocks();
  for (size_t i = 0; i < from.size(); ++i) {
    ASSERT_EQ(from[i].name, to[i].name);
    std::copy(from[i].bytes.begin(), from[i].bytes.end(), to[i].bytes.begin());
  }
  EXPECT_EQ(copy.beauty(), (std::vector<float>{1.75f, 0.5f, 1, 0, 0, 0}));
}

}  // namespace
}  // namespace wavecomb
