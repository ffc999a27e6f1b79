// SPDX-License-Identifier: Apache-2.0
/// Tests of the emission of light paths: uniform positions, cosine-weighted directions, total
/// power, and the density that MIS uses when a camera path hits the light.
#include <gtest/gtest.h>

#include <cmath>

#include "chi_square.h"
#include "lane_testing.h"
#include "light_testing.h"
#include "wavecomb/light/emission/emission.h"

namespace wavecomb {
namespace {

using namespace light_testing;
using chi_square::Random;

/// Makes a view whose infinite lights emit paths towards a sphere.
LightView sending(const Lights& lights) {
  LightView view = lights.view();
  view.radius = 3;
  view.reach = 7;
  view.centre[0] = 0.5f;
  view.centre[1] = -1;
  view.centre[2] = 2;
  return view;
}

EmissionNumbers<float> draw(Random& random) {
  EmissionNumbers<float> r{};
  for (float* x : {&r.light, &r.u, &r.v, &r.s, &r.t, &r.aim}) *x = random();
  return r;
}

/// Makes a view aimed at three spheres, one of which contains the lights.
LightView aimed(const Lights& lights) {
  static const LightAim aim = [] {
    LightAim a;
    a.even = 0.25f;
    const std::array<std::array<float, 5>, 3> spheres{
        {{1.5f, -1, 2.5f, 0.2f, 0.3f}, {0.5f, -2, 1, 0.9f, 0.25f}, {1, 1, -2, 2, 0.2f}}};
    float end = a.even;
    for (const auto& [x, y, z, radius, share] : spheres) {
      const uint32_t k = a.count++;
      a.x[k] = x;
      a.y[k] = y;
      a.z[k] = z;
      a.radius[k] = radius;
      a.share[k] = share;
      a.end[k] = end += share;
    }
    return a;
  }();
  LightView view = sending(lights);
  view.aim = &aim;
  return view;
}

struct Kind {
  const char* name;
  Lights lights;
  double power;
};

std::vector<Kind> kinds() {
  std::vector<Kind> out;
  const auto add = [&](const char* name, const Light& light, double power) {
    out.push_back({name, Lights({light}), power});
  };
  const Affine turned = translate(1, 2, -3) * rotate(30, 50);
  add("rect", make_light(LightKind::kRect, turned * scale(2, 3, 1)), kPiD * 6 * 3);
  const Affine shear{{{1, 0.6f, 0}, {0, 1, 0}, {0, 0, 1}}, {0.2f, 0, 0}};
  add("sheared rect", make_light(LightKind::kRect, shear), kPiD * 3);
  add("disk", make_light(LightKind::kDisk, turned * scale(2, 1, 1)), kPiD * kPiD * 0.5 * 3);
  add("sphere", make_light(LightKind::kSphere, turned), kPiD * kPiD * 3);
  Light point = make_light(LightKind::kSphere, turned);
  point.radius = 0;
  add("point", point, 4 * kPiD * 3);
  Light tube = make_light(LightKind::kCylinder, turned);
  tube.length = 2;
  add("cylinder", tube, kPiD * 2 * kPiD * 0.5 * 2 * 3);
  Light sun = make_light(LightKind::kDistant, turned);
  sun.angle = 20;
  const double cone = 2 * kPiD * (1 - std::cos(10 * kPiD / 180));
  add("sun", sun, cone * kPiD * 9 * 3);
  sun.angle = 0;
  add("direction", sun, kPiD * 9 * 3);
  add("dome", make_light(LightKind::kDome, turned), 4 * kPiD * kPiD * 9 * 3);
  out.push_back({"triangle", Lights({}, {make_triangle({0, 0, 0}, {2, 0, 0}, {0, 1, 1})}),
                 2 * kPiD * std::sqrt(2.0) * 3});
  return out;
}

TEST(Emission, CarriesWhatLightsSendOut) {
  Random random(1);
  for (const Kind& kind : kinds()) {
    const LightView view = sending(kind.lights);
    double sum = 0;
    constexpr int kPaths = 2000;
    for (int i = 0; i < kPaths; ++i) {
      const auto e = sample_emission<float>(view, draw(random), true);
      if (e.valid) sum += double{e.flux.y};
    }
    EXPECT_NEAR(sum / kPaths, kind.power, 1e-3 * kind.power) << kind.name;
  }
}

TEST(Emission, OfPicturesIsThatOfTheirTexels) {
  Lights lights;
  std::vector<float> rgb;
  for (int i = 0; i < 8 * 4; ++i)
    for (int c = 0; c < 3; ++c) rgb.push_back(static_cast<float>(i % 5 == 0 ? 9 : i % 3));
  Light rect = make_light(LightKind::kRect, scale(2, 3, 1));
  rect.texture = lights.add_texture(8, 4, rgb);
  Light dome = make_light(LightKind::kDome);
  dome.texture = rect.texture;
  Random random(4);
  for (const Light& light : {rect, dome}) {
    lights.set = {};
    lights.build({light});
    const LightView view = sending(lights);
    // Estimate the same power a second time, with uniform samples over the surface of the light.
    double sum = 0, even = 0;
    constexpr int kPaths = 200000;
    for (int i = 0; i < kPaths; ++i) {
      const auto e = sample_emission<float>(view, draw(random), true);
      if (e.valid) sum += double{e.flux.y};
      const Vec3<float> d = square_to_sphere(random(), random());
      const detail::LightReader<float> reader(view.lights[0], true);
      if (light.kind == LightKind::kRect)
        even += double{detail::rect_radiance<float>(reader, view.materials.textures, random(),
                                                    random(), true)
                           .y} *
                6 * kPiD;
      else
        even += double{detail::hit_dome<float>(view, view.lights[0], d, true).radiance.y} * 4 *
                kPiD * kPiD * 9;
    }
    EXPECT_NEAR(sum / even, 1, 0.02);
  }
}

TEST(Emission, IsAsDenseAsWhoMeetsItIsTold) {
  Random random(2);
  for (const Kind& kind : kinds()) {
    const LightView view = sending(kind.lights);
    for (int i = 0; i < 300; ++i) {
      const auto e = sample_emission<float>(view, draw(random), true);
      ASSERT_TRUE(e.valid) << kind.name;
      const float t = 0.5f + 3 * random();
      const Vec3<float> p = fma(e.d, t, e.o);
      const float met = emission_density<float>(view, e.light, p, -e.d, t, true);
      EXPECT_NEAR(met, e.density, 2e-3f * e.density) << kind.name;
      const auto reach =
          camera_path_density<float>(view, e.light, LightReceiver<float>(p), -e.d, t, true);
      EXPECT_GT(reach.density, 0) << kind.name;
    }
  }
}

/// Test that positions and directions, mapped to the unit square, are uniform.
TEST(Emission, IsEvenOverLightsAndByCosine) {
  Random random(3);
  constexpr int kCells = 16, kPaths = 40000;
  std::vector<std::vector<double>> observed;
  std::vector<std::string> names;
  const auto count = [&](std::vector<double>& cells, double x, double y) {
    const auto cell = [](double a) {
      return static_cast<size_t>(std::clamp(a * kCells, 0.0, kCells - 1.0));
    };
    cells[cell(y) * kCells + cell(x)] += 1;
  };
  const auto turn = [](double y, double x) { return std::atan2(y, x) / (2 * kPiD) + 0.5; };
  for (const Kind& kind : kinds()) {
    const LightView view = sending(kind.lights);
    const LightRecord record = view.first_triangle > 0 ? view.lights[0] : LightRecord{};
    std::vector<double> places(kCells * kCells), ways(kCells * kCells);
    for (int i = 0; i < kPaths; ++i) {
      const auto e = sample_emission<float>(view, draw(random), true);
      const Vec3<float> p{record.p[0], record.p[1], record.p[2]},
          u{record.u[0], record.u[1], record.u[2]}, v{record.v[0], record.v[1], record.v[2]};
      const Vec3<float> h = e.o - p;
      Vec3<float> n{record.n[0], record.n[1], record.n[2]};
      const std::string name = kind.name;
      if (view.first_triangle == 0) {
        const TriangleLight& t = view.triangles[0];
        n = normalize(Vec3<float>(t.m[0], t.m[1], t.m[2]));
        const float side = dot(e.d, n);
        n = n * (side < 0 ? -1.f : 1.f);
        count(places, side < 0 ? 0.25 : 0.75, 0.5);
      } else if (name.ends_with("rect")) {
        const detail::LightReader<float> reader(record, true);
        const Vec2<float> at = detail::rect_uv<float>(reader, e.o);
        count(places, double{at.x}, double{at.y});
      } else if (name == "disk") {
        const double a = dot(h, u) / dot(u, u), b = dot(h, v) / dot(v, v);
        count(places, a * a + b * b, turn(b, a));
      } else if (name == "sphere") {
        n = normalize(h);
        count(places, 0.5 + 0.5 * double{n.z}, turn(double{n.y}, double{n.x}));
      } else if (name == "cylinder") {
        const double along = dot(h, u) / dot(u, u);
        const Frame<float> frame = make_frame(normalize(u));
        n = normalize(Vec3<float>(h - u * static_cast<float>(along)));
        count(places, along, turn(double{dot(n, frame.t)}, double{dot(n, frame.s)}));
      } else if (name == "point") {
        n = {0, 0, 0};
      } else {  // infinite lights
        const Vec3<float> c = e.o - Vec3<float>(view.centre[0], view.centre[1], view.centre[2]);
        EXPECT_NEAR(dot(c, e.d), -view.reach, 1e-3);
        const Frame<float> frame = make_frame(e.d);
        const double a = dot(c, frame.s) / view.radius, b = dot(c, frame.t) / view.radius;
        count(places, a * a + b * b, turn(b, a));
        n = {0, 0, 0};
      }
      if (length_squared(n) > 0) {
        const Frame<float> frame = make_frame(n);
        const double z = dot(e.d, n);
        count(ways, z * z, turn(double{dot(e.d, frame.t)}, double{dot(e.d, frame.s)}));
      } else if (name == "point" || name == "dome") {
        count(ways, 0.5 + 0.5 * double{e.d.z}, turn(double{e.d.y}, double{e.d.x}));
      }
    }
    if (view.first_triangle == 0) {
      EXPECT_NEAR(places[8 * kCells + 4], kPaths / 2, 4 * std::sqrt(kPaths / 4.0));
      places.assign(places.size(), 0);
    }
    for (const auto* cells : {&places, &ways}) {
      double sum = 0;
      for (const double x : *cells) sum += x;
      if (sum == 0) continue;
      observed.push_back(*cells);
      names.push_back(kind.name);
    }
  }
  const std::vector<double> expected(kCells * kCells, double{kPaths} / (kCells * kCells));
  const double level = chi_square::sidak(0.01, observed.size());
  for (size_t i = 0; i < observed.size(); ++i)
    EXPECT_GT(chi_square::p_of_counts(observed[i], expected), level) << names[i];
}

TEST(Emission, LightsThatDoNotShineOnAllAlikeSendNoPaths) {
  Light half = make_light(LightKind::kSphere);
  half.diffuse = 0.5f;
  Light hidden = make_light(LightKind::kRect);
  hidden.visible = false;
  Light linked = make_light(LightKind::kDome);
  linked.light_link = 3;
  Random random(5);
  for (const Light& light : {half, hidden, linked}) {
    const Lights lights({light});
    const LightView view = sending(lights);
    for (int i = 0; i < 20; ++i)
      EXPECT_FALSE(sample_emission<float>(view, draw(random), true).valid);
    EXPECT_EQ(emission_density<float>(view, 0, {1, 2, -3}, {0, 0, 1}, 1, true), 0);
  }
  const Lights lights({make_light(LightKind::kSphere)});
  EXPECT_FALSE(sample_emission<float>(lights.view(), draw(random), true).valid)
      << "of a view that sends none";
}

/// Light paths that are aimed at spheres carry the same total power as other light paths, and the
/// same power through one of the spheres.
TEST(Emission, AimedCarriesTheSame) {
  Random random(11);
  constexpr int kPaths = 60000;
  for (const Kind& kind : kinds()) {
    const auto measure = [&](const LightView& view, double (&mean)[2], double (&error)[2],
                             int& through) {
      const LightAim& aim = *aimed(kind.lights).aim;
      double squares[2] = {};
      for (int i = 0; i < kPaths; ++i) {
        const auto e = sample_emission<float>(view, draw(random), true);
        if (!e.valid) continue;
        const auto meets = [&](const Vec3<float>& centre, float radius) {
          const Vec3<float> way = centre - e.o;
          const float along = dot(way, e.d);
          return along > 0 && length(way - e.d * along) < radius;
        };
        const bool first = meets({aim.x[0], aim.y[0], aim.z[0]}, aim.radius[0]);
        through += first ? 1 : 0;
        // Paths of infinite lights that miss the scene do not contribute to the power.
        const bool counts = e.light >= view.infinite_count ||
                            meets({view.centre[0], view.centre[1], view.centre[2]}, view.radius);
        const double flux[2] = {counts ? double{e.flux.y} : 0, first ? double{e.flux.y} : 0};
        for (size_t k = 0; k < 2; ++k) {
          mean[k] += flux[k] / kPaths;
          squares[k] += flux[k] * flux[k] / kPaths;
        }
      }
      for (size_t k = 0; k < 2; ++k)
        error[k] = std::sqrt(std::max(0.0, squares[k] - mean[k] * mean[k]) / kPaths);
    };
    double mean[2] = {}, error[2] = {}, plain[2] = {}, plain_error[2] = {};
    int through = 0, by_itself = 0;
    measure(aimed(kind.lights), mean, error, through);
    measure(sending(kind.lights), plain, plain_error, by_itself);
    EXPECT_NEAR(mean[0], kind.power, 5 * error[0] + 1e-3 * kind.power) << kind.name;
    EXPECT_NEAR(mean[1], plain[1], 5 * std::hypot(error[1], plain_error[1])) << kind.name;
    EXPECT_GE(through, by_itself) << kind.name;
  }
}

TEST(Emission, AimedIsAsDenseAsWhoMeetsItIsTold) {
  Random random(12);
  for (const Kind& kind : kinds()) {
    const LightView view = aimed(kind.lights);
    int differ = 0;
    constexpr int kPaths = 2000;
    for (int i = 0; i < kPaths; ++i) {
      const auto e = sample_emission<float>(view, draw(random), true);
      if (!e.valid) continue;
      const float t = 0.5f + 3 * random();
      const float met = emission_density<float>(view, e.light, fma(e.d, t, e.o), -e.d, t, true);
      // At the boundary of a sphere, rounding decides whether a path hits it.
      differ += std::abs(met - e.density) > 5e-3f * e.density ? 1 : 0;
    }
    EXPECT_LE(differ, kPaths / 500) << kind.name;
  }
}

TEST(Emission, PacketsAreScalars) {
  for (const Kind& kind : kinds()) {
    const LightView view = aimed(kind.lights);
    lane_testing::for_each_packet([&]<typename F>() {
      Random random(7);
      std::array<EmissionNumbers<float>, 16> r;
      for (auto& one : r) one = draw(random);
      EmissionNumbers<F> lanes;
      const auto column = [&](float EmissionNumbers<float>::* x) {
        alignas(64) float values[16] = {};
        for (size_t i = 0; i < kWidth<F>; ++i) values[i] = r[i].*x;
        return load<F>(values);
      };
      using N = EmissionNumbers<float>;
      lanes = {column(&N::light), column(&N::u), column(&N::v),
               column(&N::s),     column(&N::t), column(&N::aim)};
      const auto packet = sample_emission<F>(view, lanes, Mask<F>(true));
      for (size_t i = 0; i < kWidth<F>; ++i) {
        const auto one = sample_emission<float>(view, r[i], true);
        EXPECT_EQ(lane(packet.o.x, i), one.o.x) << kind.name;
        EXPECT_EQ(lane(packet.d.y, i), one.d.y) << kind.name;
        EXPECT_EQ(lane(packet.density, i), one.density) << kind.name;
        EXPECT_EQ(lane(packet.flux.z, i), one.flux.z) << kind.name;
      }
    });
  }
}

}  // namespace
}  // namespace wavecomb
