// SPDX-License-Identifier: Apache-2.0
/// Camera rays are distributed by the pixel filter on the image and uniformly on the lens.
#include <gtest/gtest.h>

#include <cmath>

#include "chi_square.h"
#include "numbers_testing.h"
#include "parts.h"
#include "wavecomb/core/frame.h"
#include "wavecomb/film/film.h"
#include "wavecomb/film/splats/light_splat_filter.h"
#include "wavecomb/light_paths/setup.h"
#include "wavecomb/path/camera/camera_connection.h"
#include "wavecomb/path/camera/camera_ray.h"

namespace wavecomb {
namespace {

using chi_square::Battery;
using chi_square::Draw;
using chi_square::Place;
using chi_square::Random;

using numbers_testing::kPiD;
constexpr uint32_t kImageWidth = 8, kImageHeight = 6;
constexpr float kX = 5, kY = 2;  ///< the pixel

/// Unnormalised filter at x in [-1, 1], as documented at Settings.
double filter_at(FilterKind kind, double x) {
  switch (kind) {
    case FilterKind::kBox:
      return 1;
    case FilterKind::kGaussian:
      return std::exp(-4.5 * x * x) - std::exp(-4.5);
    case FilterKind::kBlackmanHarris:
      return 0.35875 + 0.48829 * std::cos(kPiD * x) + 0.14128 * std::cos(2 * kPiD * x) +
             0.01168 * std::cos(3 * kPiD * x);
  }
  return 0;
}
/// Density of a filter with the given width over pixel offsets.
std::function<double(double)> filter_density(FilterKind kind, double width) {
  constexpr int kSteps = 4000;
  double sum = 0;
  for (int i = 0; i < kSteps; ++i) sum += filter_at(kind, 2 * (i + 0.5) / kSteps - 1);
  const double scale = kSteps / (sum * width);
  return [=](double offset) { return scale * filter_at(kind, 2 * offset / width); };
}

Camera make_camera(Projection projection, float lens) {
  Camera camera;
  camera.projection = projection;
  camera.lens_radius = lens;
  camera.focus_distance = 7;
  if (projection == Projection::kLatlong) {
    camera.window[0] = -1;
    camera.window[1] = 1;
  }
  return camera;
}

/// Point of a camera ray on the image, in pixels relative to the pixel centre, and point on the
/// lens, in units of the lens radius.
struct Passed {
  double x, y, lens_x, lens_y;
};
Passed pass(const CameraSetup& setup, Random& random) {
  const float a = random(), b = random(), c = random(), d = random();
  const CameraRay<float> ray = camera_ray<float>(setup, kX, kY, {a, b, c, d}, true);
  const double o[3] = {ray.o.x, ray.o.y, ray.o.z}, w[3] = {ray.d.x, ray.d.y, ray.d.z};
  double window[2], lens[2] = {o[0], o[1]};
  if (setup.projection == Projection::kLatlong) {
    window[0] = std::atan2(w[0], -w[2]);
    window[1] = std::asin(w[1]);
  } else {
    // All rays through the same image point meet in the focal plane.
    const double f = setup.focus_distance, t = -f / w[2];
    const bool parallel = setup.projection == Projection::kOrthographic;
    for (int i = 0; i < 2; ++i) window[i] = (o[i] + t * w[i]) / (parallel ? 1 : f);
    if (parallel)
      for (int i = 0; i < 2; ++i) lens[i] -= window[i];
  }
  const auto centred = [](double at, double first, double step, double pixel) {
    return (at - first) / step - pixel - 0.5;
  };
  return {centred(window[0], setup.x0, setup.step_x, kX),
          centred(window[1], setup.y1, -double{setup.step_y}, kY),
          setup.lens_radius > 0 ? lens[0] / setup.lens_radius : 0,
          setup.lens_radius > 0 ? lens[1] / setup.lens_radius : 0};
}

struct FilterCase {
  const char* name;
  FilterKind kind;
  float width;
};
const FilterCase kFilters[] = {{"box of 1 pixel", FilterKind::kBox, 1},
                               {"box of 2.5 pixels", FilterKind::kBox, 2.5f},
                               {"gaussian of 3 pixels", FilterKind::kGaussian, 3},
                               {"gaussian of 1.5 pixels", FilterKind::kGaussian, 1.5f},
                               {"Blackman-Harris of 4 pixels", FilterKind::kBlackmanHarris, 4},
                               {"Blackman-Harris of 12 pixels", FilterKind::kBlackmanHarris, 12}};
struct CameraCase {
  const char* name;
  Projection projection;
  float lens;
};
const CameraCase kCameras[] = {{"pinhole", Projection::kPerspective, 0},
                               {"lens", Projection::kPerspective, 0.3f},
                               {"orthographic", Projection::kOrthographic, 0},
                               {"orthographic lens", Projection::kOrthographic, 0.3f},
                               {"latlong", Projection::kLatlong, 0}};

TEST(CameraSamples, FollowThePixelFilter) {
  Battery battery("pixel filters");
  for (const CameraCase& seen : kCameras)
    for (const FilterCase& filter : kFilters) {
      const FilterTable table(filter.kind, filter.width);
      const CameraSetup setup(make_camera(seen.projection, seen.lens), kImageWidth, kImageHeight,
                              table);
      const double half = 0.5 * double{filter.width};
      const auto density = filter_density(filter.kind, double{filter.width});
      battery.run({std::string(filter.name) + ", " + seen.name,
                   {{-half, half, -half, half}},
                   [&](const Place& p) { return density(p.x) * density(p.y); },
                   [&](Random& random, bool) {
                     const Passed at = pass(setup, random);
                     return Draw::at({0, at.x, at.y});
                   }});
    }
  battery.judge();
}

TEST(CameraSamples, FillTheLensEvenly) {
  // Tests two pairs of independent uniform values: the squared distance from the lens centre with
  // the azimuth, and the squared distance with the position on the image.
  Battery battery("lens");
  const FilterTable table(FilterKind::kGaussian, 3);
  const auto density = filter_density(FilterKind::kGaussian, 3);
  for (const Projection projection : {Projection::kPerspective, Projection::kOrthographic})
    for (const float radius : {0.001f, 0.3f, 5.f}) {
      const CameraSetup setup(make_camera(projection, radius), kImageWidth, kImageHeight, table);
      const std::string name =
          (projection == Projection::kPerspective ? "lens of " : "orthographic lens of ") +
          std::to_string(radius);
      battery.run({name,
                   {{}},
                   [](const Place&) { return 1.0; },
                   [&](Random& random, bool) {
                     const Passed at = pass(setup, random);
                     const double r2 = at.lens_x * at.lens_x + at.lens_y * at.lens_y;
                     const double turn = std::atan2(at.lens_y, at.lens_x) / (2 * kPiD) + 0.5;
                     return Draw::at({0, r2, turn});
                   }});
      battery.run({name + " beside the picture",
                   {{0, 1, -1.5, 1.5}},
                   [&](const Place& p) { return density(p.y); },
                   [&](Random& random, bool) {
                     const Passed at = pass(setup, random);
                     const double r2 = at.lens_x * at.lens_x + at.lens_y * at.lens_y;
                     return Draw::at({0, r2, projection == Projection::kPerspective ? at.x : at.y});
                   }});
    }
  battery.judge();
}

// Connections of light paths project a point to the film position of the camera ray through the
// point. The density of the connection equals the density of camera rays, which is the image area,
// in pixels, per area perpendicular to the ray.
TEST(CameraConnections, AreTheWayBack) {
  const FilterTable table(FilterKind::kGaussian, 3);
  Random random(17);
  for (const CameraCase& seen : kCameras) {
    Camera made = make_camera(seen.projection, seen.lens);
    // The camera transform rotates, mirrors, and scales each axis differently.
    made.to_world.row[0] = {0.6f, -1.1f, 0.3f};
    made.to_world.row[1] = {0.9f, 0.8f, -0.2f};
    made.to_world.row[2] = {0.1f, 0.4f, 1.3f};
    made.to_world.t = {2, -1, 0.5f};
    const CameraSetup setup(made, kImageWidth, kImageHeight, table);
    for (int i = 0; i < 200; ++i) {
      const float u = random(), v = random(), x = kImageWidth * random(),
                  y = kImageHeight * random();
      const float t = 1.f + 8.f * random();
      const CameraRay<float> ray = ray_through<float>(setup, x, y, u, v, 0.f, true);
      const Vec3<float> p = fma(ray.d, t, ray.o);
      const auto at = [&](const Vec3<float>& point) {
        return connect_to_camera<float>(setup, point, u, v, 0.f, true);
      };
      const CameraConnection<float> c = at(p);
      ASSERT_TRUE(c.valid) << seen.name;
      ASSERT_NEAR(c.x, x, 2e-4f) << seen.name;
      ASSERT_NEAR(c.y, y, 2e-4f) << seen.name;
      const float inverse = inverse_camera_density<float>(setup, 0.f, p, ray.d, true);
      if (seen.lens == 0) {
        ASSERT_NEAR(inverse * c.density, 1.f, 1e-4f) << seen.name;
      }
      const Frame<float> across = make_frame(ray.d);
      const float step = 2e-3f * t;
      const auto moved = [&](const Vec3<float>& way) {
        const CameraConnection<float> a = at(fma(way, -step, p)), b = at(fma(way, step, p));
        return std::array<double, 2>{(double{b.x} - double{a.x}) / (2 * double{step}),
                                     (double{b.y} - double{a.y}) / (2 * double{step})};
      };
      const auto s = moved(across.s), r = moved(across.t);
      const double area = std::abs(s[0] * r[1] - s[1] * r[0]);
      // Near a pole of a latlong image the columns converge.
      const double latitude = setup.y1 - y * setup.step_y;
      if (seen.projection != Projection::kLatlong || std::abs(latitude) < 1.3) {
        ASSERT_NEAR(area / double{c.density}, 1, 0.01) << seen.name;
      }
    }
  }
}

// A latlong image continues at its opposite edge, and beyond a pole with an offset of half a turn.
// Light near an image edge contributes as much as light in the middle of the image.
TEST(CameraConnections, GoRoundAPictureOfAllDirections) {
  constexpr uint32_t kAcross = 24, kDown = 12;
  const FilterTable table(FilterKind::kGaussian, 4);
  Camera made = make_camera(Projection::kLatlong, 0);
  made.window[0] = -static_cast<float>(kPiD);
  made.window[1] = static_cast<float>(kPiD);
  made.window[2] = -0.5f * static_cast<float>(kPiD);
  made.window[3] = 0.5f * static_cast<float>(kPiD);
  const CameraSetup setup(made, kAcross, kDown, table);
  const Region all{0, 0, kAcross, kDown};
  const LightSplatFilter filter = make_light_splat_filter(setup, table, all);
  const Film film(all, {}, false);
  Random random(5);
  for (int i = 0; i < 300; ++i) {
    // Tests points near the edges of the image. Camera samples of pixels at an edge may lie beyond
    // the edge.
    const float x = 4 * random() - 2 + (i % 2 ? kAcross : 0);
    const float y = i % 3 == 0 ? 4 * random() - 2 + (i % 2 ? kDown : 0) : kDown * random();
    const CameraRay<float> ray = ray_through<float>(setup, x, y, 0.f, 0.f, 0.f, true);
    const CameraConnection<float> c =
        connect_to_camera<float>(setup, ray.o + ray.d, 0.f, 0.f, 0.f, true);
    ASSERT_TRUE(c.valid);
    ASSERT_TRUE(filter.reaches<float>(c.x, c.y));
    double sum = 0;
    std::vector<double> weight(kAcross * kDown);
    filter.spread(film, {c.x, c.y, 0}, [&](size_t pixel, float w) {
      weight[pixel] += double{w};
      sum += double{w};
    });
    EXPECT_NEAR(sum, 1, 0.02) << x << " " << y;
    for (uint32_t row = 0; row < kDown; ++row)
      for (uint32_t column = 0; column < kAcross; ++column) {
        const float own = table.density(x - (static_cast<float>(column) + 0.5f)) *
                          table.density(y - (static_cast<float>(row) + 0.5f));
        EXPECT_GE(weight[film.index(column, row)], double{own} - 2e-3) << x << " " << y;
      }
  }
  // A latlong image of only 180 degrees does not wrap around, so directions behind the camera are
  // outside the image.
  made.window[0] = -0.5f * static_cast<float>(kPiD);
  made.window[1] = 0.5f * static_cast<float>(kPiD);
  const CameraSetup front(made, kAcross, kDown, table);
  const LightSplatFilter half = make_light_splat_filter(front, table, all);
  const auto behind = connect_to_camera<float>(front, front.to_world.t + Vec3<float>{0.1f, 0, 1},
                                               0.f, 0.f, 0.f, true);
  EXPECT_FALSE(half.reaches<float>(behind.x, behind.y));
}

// In one-pixel mode, a splat has the same expected weight in each pixel as in filtered mode,
// whatever the region.
TEST(CameraConnections, OnePixelHasTheWeightsOfTheFilterOnAverage) {
  constexpr uint32_t kSide = 8;
  const FilterTable table(FilterKind::kBlackmanHarris, 3);
  const Region all{0, 0, kSide, kSide}, part{3, 2, 6, 8};
  const LightSplatFilter spread(table, all), one(table, all, {}, true),
      one_of_part(table, part, {}, true);
  const Film film(all, {}, false);
  Random random(9);
  for (int i = 0; i < 20; ++i) {
    const float x = 8 * random(), y = 8 * random();
    std::vector<double> expected(kSide * kSide), mean(kSide * kSide);
    spread.spread(film, {x, y, 0}, [&](size_t pixel, float w) { expected[pixel] += double{w}; });
    constexpr int kDraws = 20000;
    for (int n = 0; n < kDraws; ++n) {
      const LightSplatPoint at{x, y, random.bits()};
      size_t chosen = kSide * kSide, chosen_in_part = kSide * kSide;
      one.spread(film, at, [&](size_t pixel, float w) {
        EXPECT_EQ(chosen, size_t{kSide} * kSide) << "one pixel at most";
        chosen = pixel;
        mean[pixel] += double{w} / kDraws;
      });
      one_of_part.spread(film, at, [&](size_t pixel, float) { chosen_in_part = pixel; });
      const auto column = static_cast<uint32_t>(chosen % kSide);
      const auto row = static_cast<uint32_t>(chosen / kSide);
      if (chosen < size_t{kSide} * kSide && part.contains(column, row))
        EXPECT_EQ(chosen_in_part, chosen);
      else
        EXPECT_EQ(chosen_in_part, size_t{kSide} * kSide);
    }
    // Six standard deviations of 20 x 64 binomial means.
    for (size_t pixel = 0; pixel < mean.size(); ++pixel)
      EXPECT_NEAR(mean[pixel], expected[pixel],
                  6 * std::sqrt(std::max(expected[pixel], 1e-4) / kDraws))
          << x << " " << y;
  }
}

}  // namespace
}  // namespace wavecomb
