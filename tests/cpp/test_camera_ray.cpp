// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/integrate/camera_ray.h"

#include "lane_testing.h"
#include "scene_testing.h"

namespace wavecomb {
namespace {

using lane_testing::for_each_packet;
using lane_testing::same_bits;
using namespace scene_testing;

/// Ray for numbers r of pixel (x, y), box filter of one pixel.
CameraRay<float> ray_at(const Camera& camera, uint32_t width, uint32_t height, float x, float y,
                        const Sample4<float>& r) {
  const FilterTable table(FilterKind::kBox, 1);
  const CameraSetup setup(camera, width, height, table);
  return camera_ray<float>(setup, x, y, r, true);
}
/// The window coordinates that a ray of a camera without a transform goes through.
std::array<double, 2> on_window(const CameraRay<float>& ray) {
  return {-static_cast<double>(ray.d.x) / ray.d.z, -static_cast<double>(ray.d.y) / ray.d.z};
}
void expect_window(const CameraRay<float>& ray, double x, double y) {
  EXPECT_NEAR(on_window(ray)[0], x, 1e-6);
  EXPECT_NEAR(on_window(ray)[1], y, 1e-6);
  EXPECT_NEAR(length(ray.d), 1, 1e-6);
}
constexpr Sample4<float> kCentre{0.5f, 0.5f, 0.5f, 0.5f};

TEST(CameraRay, PinholeAtCornersAndCentre) {
  Camera camera;
  camera.window[0] = -0.4f;
  camera.window[1] = 0.6f;
  camera.window[2] = -0.2f;
  camera.window[3] = 0.3f;
  // 4 x 2 pixels of 0.25 x 0.25; y goes down.
  expect_window(ray_at(camera, 4, 2, 0, 0, kCentre), -0.4 + 0.125, 0.3 - 0.125);
  expect_window(ray_at(camera, 4, 2, 3, 1, kCentre), 0.6 - 0.125, -0.2 + 0.125);
  expect_window(ray_at(camera, 4, 2, 0, 0, {0, 0, 0, 0}), -0.4, 0.3);
  const float last = 0x1.fffffep-1f;
  expect_window(ray_at(camera, 4, 2, 3, 1, {last, last, 0, 0}), 0.6, -0.2);
  expect_window(ray_at(camera, 4, 2, 1, 1, {0, 0, 0, 0}), -0.15, 0.05);
  for (const float x : {0.f, 3.f}) {
    const CameraRay<float> ray = ray_at(camera, 4, 2, x, 0, kCentre);
    EXPECT_EQ(ray.o.x, 0);
    EXPECT_EQ(ray.o.y, 0);
    EXPECT_EQ(ray.o.z, 0);
    EXPECT_NEAR(ray.spread, 0.25 * kConeShare, 1e-6);
    EXPECT_GT(ray.tfar, 1e29f);
  }
}

TEST(CameraRay, WindowIsWidenedToThePicture) {
  Camera camera;  // 1 x 1
  expect_window(ray_at(camera, 200, 100, 0, 0, {0, 0, 0, 0}), -1, 0.5);
  expect_window(ray_at(camera, 100, 200, 0, 0, {0, 0, 0, 0}), -0.5, 1);
  camera.window[0] = 0;  // shifted: stays about its middle
  camera.window[1] = 2;
  expect_window(ray_at(camera, 100, 100, 0, 0, {0, 0, 0, 0}), 0, 1);
  expect_window(ray_at(camera, 100, 100, 99, 99, kCentre), 2 - 0.01, -1 + 0.01);
}

TEST(CameraRay, TransformsToTheWorld) {
  Camera camera = make_camera({1, 2, 3}, {4, 2, 3});
  const CameraRay<float> ray = ray_at(camera, 1, 1, 0, 0, kCentre);
  EXPECT_NEAR(ray.o.x, 1, 1e-6);
  EXPECT_NEAR(ray.o.y, 2, 1e-6);
  EXPECT_NEAR(ray.o.z, 3, 1e-6);
  EXPECT_NEAR(ray.d.x, 1, 1e-6);
  // Left in the picture is -z here, up is +y.
  EXPECT_LT(ray_at(camera, 2, 2, 0, 0, kCentre).d.z, 0);
  EXPECT_GT(ray_at(camera, 2, 2, 0, 0, kCentre).d.y, 0);
  // A scaled camera still gives unit directions.
  camera.to_world = camera.to_world * scale(3, 3, 3);
  EXPECT_NEAR(length(ray_at(camera, 2, 2, 0, 0, kCentre).d), 1, 1e-6);
}

TEST(CameraRay, ThinLensKeepsTheFocalPlaneSharp) {
  Camera camera;
  camera.lens_radius = 0.3f;
  camera.focus_distance = 7;
  const FilterTable table(FilterKind::kBox, 1);
  const CameraSetup setup(camera, 8, 8, table);
  std::mt19937 rng(1);
  std::uniform_real_distribution<float> uniform(0, 1);
  double widest = 0, mean[2] = {0, 0}, square = 0;
  constexpr int kRays = 20000;
  for (int i = 0; i < kRays; ++i) {
    const CameraRay<float> ray =
        camera_ray<float>(setup, 2.f, 5.f, {0.25f, 0.75f, uniform(rng), uniform(rng)}, true);
    EXPECT_EQ(ray.o.z, 0);
    const double r = std::hypot(ray.o.x, ray.o.y);
    widest = std::max(widest, r);
    mean[0] += ray.o.x / kRays;
    mean[1] += ray.o.y / kRays;
    square += r * r / kRays;
    // All rays of a place on the film meet at distance 7: window (-0.5 + 2.25 / 8, 0.5 - 5.75 / 8).
    const double t = -7 / static_cast<double>(ray.d.z);
    EXPECT_NEAR(ray.o.x + t * ray.d.x, 7 * (-0.5 + 2.25 / 8), 5e-6);
    EXPECT_NEAR(ray.o.y + t * ray.d.y, 7 * (0.5 - 5.75 / 8), 5e-6);
  }
  EXPECT_LE(widest, 0.3 + 1e-6);
  EXPECT_GT(widest, 0.299);
  EXPECT_NEAR(mean[0], 0, 0.005);
  EXPECT_NEAR(mean[1], 0, 0.005);
  EXPECT_NEAR(square, 0.5 * 0.09, 0.001);  // uniform over the lens
}

TEST(CameraRay, NearAndFar) {
  Camera camera;
  camera.near_clip = 2;
  camera.far_clip = 10;
  for (const float lens : {0.f, 0.2f}) {
    camera.lens_radius = lens;
    camera.focus_distance = 4;
    for (float x = 0; x < 4; ++x) {
      const CameraRay<float> ray = ray_at(camera, 4, 4, x, 1, {0.3f, 0.9f, 0.2f, 0.6f});
      EXPECT_NEAR(ray.o.z, -2, 1e-6);  // planes, not spheres
      EXPECT_NEAR(ray.o.z + ray.tfar * ray.d.z, -10, 1e-5);
    }
  }
  const FilterTable table(FilterKind::kBox, 1);
  EXPECT_TRUE(CameraSetup(camera, 4, 4, table).has_far);
  EXPECT_FALSE(CameraSetup(Camera{}, 4, 4, table).has_far);
}

TEST(CameraRay, LanesAgree) {
  Camera camera = make_camera({1, 2, 3}, {0, 1, -4}, 0.7f);
  camera.lens_radius = 0.1f;
  camera.focus_distance = 3;
  camera.near_clip = 0.01f;
  camera.far_clip = 100;
  for (const FilterKind kind :
       {FilterKind::kBox, FilterKind::kGaussian, FilterKind::kBlackmanHarris}) {
    const FilterTable table(kind, 3);
    const CameraSetup setup(camera, 640, 480, table);
    constexpr size_t kCount = 4096;
    std::vector<float> columns[6];
    for (auto& c : columns) c = random_texels(kCount, 0, 1, static_cast<uint32_t>(&c - columns));
    for (float& x : columns[0]) x = std::floor(x * 640);
    for (float& y : columns[1]) y = std::floor(y * 480);
    const auto run = [&]<typename F>() {
      std::vector<float> out[8];
      for (auto& o : out) o.resize(kCount);
      for (size_t i = 0; i < kCount; i += kWidth<F>) {
        const auto at = [&](int c) { return load<F>(columns[c].data() + i); };
        const CameraRay<F> r =
            camera_ray<F>(setup, at(0), at(1), {at(2), at(3), at(4), at(5)}, Mask<F>(true));
        const F values[8] = {r.o.x, r.o.y, r.o.z, r.d.x, r.d.y, r.d.z, r.spread, r.tfar};
        for (int c = 0; c < 8; ++c) store(out[c].data() + i, values[c]);
      }
      return std::to_array(out);
    };
    const auto scalar = run.operator()<float>();
    for_each_packet([&]<typename F>() {
      const auto packet = run.template operator()<F>();
      for (size_t c = 0; c < 8; ++c) lane_testing::expect_same(scalar[c], packet[c], "camera ray");
    });
  }
}

}  // namespace
}  // namespace wavecomb
