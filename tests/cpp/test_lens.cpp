// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/path/camera/lens.h"

#include <gtest/gtest.h>

#include <cmath>

#include "lane_testing.h"
#include "wavecomb/core/error.h"
#include "wavecomb/path/camera/camera_ray.h"

namespace wavecomb {
namespace {

using lane_testing::for_each_packet;
using lane_testing::same_bits;

Camera distorting(float k1, float p1 = 0) {
  Camera camera;
  camera.lens_k1 = k1;
  camera.lens_k2 = 0.03f;
  camera.lens_p1 = p1;
  camera.lens_p2 = -0.002f;
  return camera;
}

/// Returns the image position that the distortion model gives for the point (x, y) at distance 1.
/// Image y points down.
std::array<double, 2> shown(const Camera& c, double x, double y) {
  const double r2 = x * x + y * y;
  const double radial = 1 + r2 * (double{c.lens_k1} + r2 * double{c.lens_k2});
  const double p1 = double{c.lens_p1}, p2 = double{c.lens_p2};
  return {x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x),
          y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y};
}

TEST(Lens, RaysGoWhereTheModelShowsThem) {
  const FilterTable filter(FilterKind::kBox, 1);
  for (const float k1 : {-0.15f, 0.2f})
    for (const uint32_t overscan : {0u, 40u}) {
      const Camera camera = distorting(k1, 0.004f);
      const uint32_t w = 400 + 2 * overscan, h = 300 + 2 * overscan;
      const CameraSetup setup(camera, w, h, filter, overscan);
      for (int i = 0; i < 200; ++i) {
        const float fx = std::fmod(37.37f * static_cast<float>(i), static_cast<float>(w));
        const float fy = std::fmod(23.71f * static_cast<float>(i), static_cast<float>(h));
        const CameraRay<float> ray = ray_through<float>(setup, fx, fy, 0.5f, 0.5f, 0.f, true);
        const double x = double{ray.d.x} / -double{ray.d.z}, y = double{ray.d.y} / double{ray.d.z};
        const auto at = shown(camera, x, y);
        const double px = (at[0] - double{setup.x0}) / double{setup.step_x};
        const double py = (at[1] + double{setup.y1}) / double{setup.step_y};
        EXPECT_NEAR(px, double{fx}, 0.003) << k1;
        EXPECT_NEAR(py, double{fy}, 0.003) << k1;
      }
    }
}

TEST(Lens, WhatFoldsOverIsRefused) {
  const FilterTable filter(FilterKind::kBox, 1);
  Camera camera;
  camera.lens_k1 = -2;
  EXPECT_THROW(CameraSetup(camera, 64, 64, filter), Error);
}

TEST(Lens, AMapMovesPixels) {
  const FilterTable filter(FilterKind::kBox, 1);
  Camera camera;
  // A lens map of 2 x 2 nodes that shrinks the image to its middle half.
  camera.lens_map = {{0.25f, 0.25f, 0.75f, 0.25f}, {0.25f, 0.75f, 0.75f, 0.75f}};
  const CameraSetup setup(camera, 100, 100, filter);
  Camera plain;
  const CameraSetup without(plain, 100, 100, filter);
  const auto a = ray_through<float>(setup, 10.f, 80.f, 0.5f, 0.5f, 0.f, true);
  const auto b = ray_through<float>(without, 30.f, 65.f, 0.5f, 0.5f, 0.f, true);
  EXPECT_NEAR(a.d.x, b.d.x, 1e-6);
  EXPECT_NEAR(a.d.y, b.d.y, 1e-6);
}

TEST(Lens, OverscanIsTheSamePictureWithAnEdge) {
  const FilterTable filter(FilterKind::kBox, 1);
  const Camera camera;
  const CameraSetup plain(camera, 200, 100, filter), wide(camera, 220, 120, filter, 10);
  const auto a = ray_through<float>(plain, 150.f, 30.f, 0.5f, 0.5f, 0.f, true);
  const auto b = ray_through<float>(wide, 160.f, 40.f, 0.5f, 0.5f, 0.f, true);
  EXPECT_NEAR(a.d.x, b.d.x, 1e-6);
  EXPECT_NEAR(a.d.y, b.d.y, 1e-6);
  Camera around;
  around.projection = Projection::kLatlong;
  EXPECT_THROW(CameraSetup(around, 220, 120, filter, 10), Error);
}

/// Points of a polygon are uniform: over its blades, and by distance within a blade.
TEST(Lens, PointsOfAPolygonAreEven) {
  constexpr uint32_t kBlades = 5, kRings = 8, kSide = 200;
  std::vector<double> found(kBlades * kRings), expected(kBlades * kRings);
  const double turn = 0.05, half = M_PI / kBlades;
  for (uint32_t i = 0; i < kSide; ++i)
    for (uint32_t j = 0; j < kSide; ++j) {
      const float u = (static_cast<float>(i) + 0.5f) / kSide;
      const float v = (static_cast<float>(j) + 0.5f) / kSide;
      const Vec2<float> p = square_to_polygon<float>(u, v, kBlades, static_cast<float>(turn));
      double angle = std::atan2(double{p.y}, double{p.x}) - 2 * M_PI * turn;
      angle -= 2 * M_PI * std::floor(angle / (2 * M_PI));
      const auto blade = std::min<size_t>(static_cast<size_t>(angle / (2 * half)), kBlades - 1);
      // Distance from the centre towards the blade's edge; the area grows with its square.
      const double middle = angle - static_cast<double>(2 * blade + 1) * half;
      const double across = std::hypot(double{p.x}, double{p.y}) * std::cos(middle);
      const double share = across * across / (std::cos(half) * std::cos(half));
      ASSERT_LT(share, 1 + 1e-5);
      found[blade * kRings + std::min<size_t>(static_cast<size_t>(share * kRings), kRings - 1)] +=
          1;
    }
  for (const double n : found) EXPECT_NEAR(n / (kSide * kSide), 1. / found.size(), 0.002);
}

TEST(Lens, PacketsEqualScalars) {
  const FilterTable filter(FilterKind::kBox, 1);
  Camera camera = distorting(-0.1f);
  camera.lens_radius = 0.1f;
  camera.focus_distance = 3;
  camera.aperture_blades = 6;
  camera.aperture_rotation = 12;
  camera.lens_squeeze = 2;
  const CameraSetup setup(camera, 64, 48, filter);
  for_each_packet([&]<typename F>() {
    alignas(64) float x[kWidth<F>], y[kWidth<F>], u[kWidth<F>], v[kWidth<F>], out[kWidth<F>];
    for (size_t i = 0; i < kWidth<F>; ++i) {
      const auto k = static_cast<float>(i);
      x[i] = 3.7f * k - 1;
      y[i] = 2.9f * k;
      u[i] = std::fmod(0.618f * k, 1.f);
      v[i] = std::fmod(0.754f * k, 1.f);
    }
    const auto rays = ray_through<F>(setup, load<F>(x), load<F>(y), load<F>(u), load<F>(v), F(0.f),
                                     Mask<F>(true));
    const auto check = [&](const F& of, const auto& scalar) {
      store(out, of);
      for (size_t i = 0; i < kWidth<F>; ++i) {
        const auto one = ray_through<float>(setup, x[i], y[i], u[i], v[i], 0.f, true);
        EXPECT_TRUE(same_bits(out[i], scalar(one)));
      }
    };
    check(rays.d.x, [](const auto& r) { return r.d.x; });
    check(rays.d.y, [](const auto& r) { return r.d.y; });
    check(rays.o.x, [](const auto& r) { return r.o.x; });
    check(rays.o.y, [](const auto& r) { return r.o.y; });
  });
}

TEST(Lens, ARollingShutterGoesDownThePicture) {
  const FilterTable filter(FilterKind::kBox, 1);
  Camera camera;
  camera.rolling_shutter = RollingShutter::kTop;
  camera.rolling_duration = 0.25f;
  const CameraSetup setup(camera, 10, 100, filter);
  EXPECT_NEAR(camera_time<float>(setup, 3, 0, 0), 0.75f * 0.005f, 1e-6);
  EXPECT_NEAR(camera_time<float>(setup, 3, 99, 0.5f), 0.75f * 0.995f + 0.125f, 1e-6);
  camera.rolling_shutter = RollingShutter::kRight;
  const CameraSetup right(camera, 10, 100, filter);
  EXPECT_NEAR(camera_time<float>(right, 9, 4, 0), 0.75f * 0.05f, 1e-6);
}

}  // namespace
}  // namespace wavecomb
