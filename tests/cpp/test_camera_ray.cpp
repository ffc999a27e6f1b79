// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/path/camera/camera_ray.h"

#include <tuple>

#include "lane_testing.h"
#include "scene_testing.h"

namespace wavecomb {
namespace {

using lane_testing::for_each_packet;
using lane_testing::same_bits;
using namespace scene_testing;

/// Returns the ray for sample r of pixel (x, y) with a box filter of one pixel.
CameraRay<float> ray_at(const Camera& camera, uint32_t width, uint32_t height, float x, float y,
                        const Sample4<float>& r) {
  const FilterTable table(FilterKind::kBox, 1);
  const CameraSetup setup(camera, width, height, table);
  return camera_ray<float>(setup, x, y, r, true);
}
/// Returns the window coordinates that a ray passes through, for a camera without a transform.
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
  // The image has 4 x 2 pixels of size 0.25 x 0.25. Pixel y points down.
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
  camera.window[0] = 0;
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
  EXPECT_LT(ray_at(camera, 2, 2, 0, 0, kCentre).d.z, 0);
  EXPECT_GT(ray_at(camera, 2, 2, 0, 0, kCentre).d.y, 0);
  // A scaled camera still has unit directions.
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
    const double t = -7 / static_cast<double>(ray.d.z);
    EXPECT_NEAR(ray.o.x + t * ray.d.x, 7 * (-0.5 + 2.25 / 8), 5e-6);
    EXPECT_NEAR(ray.o.y + t * ray.d.y, 7 * (0.5 - 5.75 / 8), 5e-6);
  }
  EXPECT_LE(widest, 0.3 + 1e-6);
  EXPECT_GT(widest, 0.299);
  EXPECT_NEAR(mean[0], 0, 0.005);
  EXPECT_NEAR(mean[1], 0, 0.005);
  EXPECT_NEAR(square, 0.5 * 0.09, 0.001);
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
      EXPECT_NEAR(ray.o.z, -2, 1e-6);  // a plane, not a sphere
      EXPECT_NEAR(ray.o.z + ray.tfar * ray.d.z, -10, 1e-5);
    }
  }
  const FilterTable table(FilterKind::kBox, 1);
  EXPECT_TRUE(CameraSetup(camera, 4, 4, table).has_far);
  EXPECT_FALSE(CameraSetup(Camera{}, 4, 4, table).has_far);
}

TEST(CameraRay, OrthographicAtCorners) {
  Camera camera;
  camera.projection = Projection::kOrthographic;
  camera.window[0] = -4;  // off-axis window
  camera.window[1] = 6;
  camera.window[2] = -2;
  camera.window[3] = 3;
  camera.near_clip = 1;
  camera.far_clip = 11;
  const float last = 0x1.fffffep-1f;
  const CameraRay<float> first = ray_at(camera, 4, 2, 0, 0, {0, 0, 0, 0});
  const CameraRay<float> end = ray_at(camera, 4, 2, 3, 1, {last, last, 0, 0});
  for (const auto& [ray, x, y] : {std::tuple(first, -4.0, 3.0), std::tuple(end, 6.0, -2.0)}) {
    EXPECT_NEAR(ray.o.x, x, 1e-5);
    EXPECT_NEAR(ray.o.y, y, 1e-5);
    EXPECT_NEAR(ray.o.z, -1, 1e-6);
    EXPECT_EQ(ray.d.x, 0);
    EXPECT_EQ(ray.d.y, 0);
    EXPECT_EQ(ray.d.z, -1);
    EXPECT_NEAR(ray.tfar, 10, 1e-5);
    EXPECT_EQ(ray.spread, 0);  // constant width
    EXPECT_NEAR(ray.width, 2.5 * kConeShare, 1e-6);
  }
  const FilterTable table(FilterKind::kBox, 1);
  EXPECT_FALSE(CameraSetup(camera, 4, 2, table).is_pinhole());
  EXPECT_TRUE(CameraSetup(Camera{}, 4, 2, table).is_pinhole());
}

TEST(CameraRay, CircleOfConfusion) {
  // A thin lens of radius R with focus distance f maps one film point to a disk of radius R |z / f
  // - 1| at distance z. The test covers perspective and orthographic cameras.
  for (const Projection projection : {Projection::kPerspective, Projection::kOrthographic}) {
    Camera camera;
    camera.projection = projection;
    camera.lens_radius = 0.25f;
    camera.focus_distance = 5;
    for (const double z : {2.0, 5.0, 9.0}) {
      const bool parallel = projection == Projection::kOrthographic;
      const double middle = 0.25 * (parallel ? 1 : z);
      double widest = 0;
      for (const float v : {0.f, 0.25f, 0.5f, 0.75f}) {
        const CameraRay<float> ray = ray_at(camera, 2, 1, 1, 0, {0.5f, 0.5f, 0.f, v});
        const double t = -(z + ray.o.z) / ray.d.z;
        const double x = ray.o.x + t * ray.d.x - 2 * middle, y = ray.o.y + t * ray.d.y;
        widest = std::max(widest, std::hypot(x, y));
      }
      EXPECT_NEAR(widest, 0.25 * std::abs(z / 5 - 1), 2e-6) << z;
    }
  }
}

TEST(CameraRay, LatlongSeesAllDirections) {
  Camera camera;
  camera.projection = Projection::kLatlong;
  camera.window[0] = -kPi;
  camera.window[1] = kPi;
  camera.window[2] = -0.5f * kPi;
  camera.window[3] = 0.5f * kPi;
  camera.near_clip = 2;
  camera.far_clip = 5;
  camera.lens_radius = 1;  // latlong cameras ignore the lens
  const FilterTable table(FilterKind::kBox, 1);
  const CameraSetup setup(camera, 8, 5, table);
  const auto at = [&](float x, float y) {
    return ray_through<float>(setup, x, y, 0.3f, 0.6f, 0.f, true);
  };
  const auto expect = [](const CameraRay<float>& ray, double x, double y, double z) {
    EXPECT_NEAR(ray.d.x, x, 1e-6);
    EXPECT_NEAR(ray.d.y, y, 1e-6);
    EXPECT_NEAR(ray.d.z, z, 1e-6);
    EXPECT_NEAR(length(ray.o), 2, 1e-6);  // a sphere, not a plane
    EXPECT_NEAR(ray.tfar, 3, 1e-5);
  };
  expect(at(4, 2.5f), 0, 0, -1);
  expect(at(6, 2.5f), 1, 0, 0);
  expect(at(2, 2.5f), -1, 0, 0);
  expect(at(0, 2.5f), 0, 0, 1);
  expect(at(8, 2.5f), 0, 0, 1);
  expect(at(3, 0), 0, 1, 0);
  expect(at(3, 5), 0, -1, 0);
  const double lon = kPi / 4, lat = kPi / 5;
  expect(at(5, 1.5f), std::sin(lon) * std::cos(lat), std::sin(lat), -std::cos(lon) * std::cos(lat));
  EXPECT_NEAR(camera_depth<float>(setup, Vec3<float>{3, 0, 4}, 0.f, true), 5, 1e-6);
}

TEST(CameraRay, ClippingPlanesCutOff) {
  Camera camera;
  camera.near_clip = 1;
  camera.far_clip = 100;
  camera.clip_planes = {{0, 0, -1, -4}, {0, 0, 1, 20}, {1, 0, 0, 1}};  // z <= -4, z >= -20, x >= -1
  const CameraRay<float> ray = ray_at(camera, 1, 1, 0, 0, kCentre);
  EXPECT_NEAR(ray.o.z, -4, 1e-6);
  EXPECT_NEAR(ray.tfar, 16, 1e-5);
  const CameraRay<float> left = ray_at(camera, 2, 2, 0, 0, kCentre);  // x = z / 4 = -1 at z = -4
  EXPECT_NEAR(left.o.z, -4, 1e-6);
  EXPECT_NEAR(left.tfar, 0, 1e-5);
  camera.clip_planes = {{0, 0, 1, -1}};  // everything is clipped
  EXPECT_LE(ray_at(camera, 1, 1, 0, 0, kCentre).tfar, 0);
  camera.clip_planes = {{0, 1, 0, -1}};
  EXPECT_LE(ray_at(camera, 1, 1, 0, 0, kCentre).tfar, 0);
}

TEST(CameraRay, ConformPolicies) {
  // A window of 4 x 2 in an image of 100 x 100 pixels: expected half_x and half_y.
  const std::tuple<Conform, float, float> cases[] = {{Conform::kExpandAperture, 2.f, 2.f},
                                                     {Conform::kCropAperture, 1.f, 1.f},
                                                     {Conform::kAdjustApertureWidth, 1.f, 1.f},
                                                     {Conform::kAdjustApertureHeight, 2.f, 2.f},
                                                     {Conform::kAdjustPixelAspectRatio, 2.f, 1.f}};
  for (const auto& [conform, half_x, half_y] : cases) {
    Camera camera;
    camera.window[0] = -1;
    camera.window[1] = 3;
    camera.window[2] = -1;
    camera.window[3] = 1;
    camera.conform = conform;
    const FittedWindow fitted = fitted_window(camera, 100, 100);
    EXPECT_EQ(fitted.centre_x, 1);
    EXPECT_EQ(fitted.half_x, half_x);
    EXPECT_EQ(fitted.half_y, half_y);
  }
  Camera camera;
  camera.pixel_aspect = 2;
  EXPECT_EQ(fitted_window(camera, 50, 50).half_x, 1.f);
  camera.conform = Conform::kCropAperture;
  EXPECT_EQ(fitted_window(camera, 50, 50).half_y, 0.25f);
}

using Kind = std::tuple<Projection, FilterKind>;

TEST(CameraRay, LanesAgree) {
  Camera camera = make_camera({1, 2, 3}, {0, 1, -4}, 0.7f);
  camera.lens_radius = 0.1f;
  camera.focus_distance = 3;
  camera.near_clip = 0.01f;
  camera.far_clip = 100;
  for (const auto& [projection, kind] :
       {Kind{Projection::kPerspective, FilterKind::kBox},
        Kind{Projection::kPerspective, FilterKind::kGaussian},
        Kind{Projection::kPerspective, FilterKind::kBlackmanHarris},
        Kind{Projection::kOrthographic, FilterKind::kBox},
        Kind{Projection::kLatlong, FilterKind::kBox}}) {
    camera.projection = projection;
    if (projection != Projection::kPerspective)
      camera.clip_planes = {{0.1f, 0.2f, -1, -1}, {0.3f, 0, 1, 7}};
    const FilterTable table(kind, 3);
    const CameraSetup setup(camera, 640, 480, table);
    constexpr size_t kCount = 4096;
    std::vector<float> columns[6];
    for (auto& c : columns) c = random_texels(kCount, 0, 1, static_cast<uint32_t>(&c - columns));
    for (float& x : columns[0]) x = std::floor(x * 640);
    for (float& y : columns[1]) y = std::floor(y * 480);
    const auto run = [&]<typename F>() {
      std::vector<float> out[9];
      for (auto& o : out) o.resize(kCount);
      for (size_t i = 0; i < kCount; i += kWidth<F>) {
        const auto at = [&](int c) { return load<F>(columns[c].data() + i); };
        const CameraRay<F> r =
            camera_ray<F>(setup, at(0), at(1), {at(2), at(3), at(4), at(5)}, Mask<F>(true));
        const F values[9] = {r.o.x, r.o.y, r.o.z, r.d.x, r.d.y, r.d.z, r.width, r.spread, r.tfar};
        for (int c = 0; c < 9; ++c) store(out[c].data() + i, values[c]);
      }
      return std::to_array(out);
    };
    const auto scalar = run.operator()<float>();
    for_each_packet([&]<typename F>() {
      const auto packet = run.template operator()<F>();
      for (size_t c = 0; c < 9; ++c) lane_testing::expect_same(scalar[c], packet[c], "camera ray");
    });
  }
}

}  // namespace
}  // namespace wavecomb
