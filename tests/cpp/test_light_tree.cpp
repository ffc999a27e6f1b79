// SPDX-License-Identifier: Apache-2.0
/// Tests of light selection by the light tree: probabilities, bounds, and equal results of packets
/// and scalar lanes. test_light_choice.cpp tests the selection frequencies.
#include "wavecomb/light/sampling/tree_choice.h"

#include <chrono>
#include <random>

#include "lane_testing.h"
#include "light_tree_testing.h"
#include "wavecomb/light/sampling/light_sample.inl"
#include "wavecomb/light/tree/light_cluster.h"
#include "wavecomb/light/tree/light_tree.h"

namespace wavecomb {
namespace {

using namespace light_testing;

TEST(LightTree, ProbabilitiesAddUpToOne) {
  for (const size_t n : {1, 2, 3, 17, 400}) {
    for (const size_t infinite : {0, 3}) {
      const Lights lights = random_lights(n, static_cast<uint32_t>(n), infinite);
      const LightView view = by_tree(lights);
      Numbers number(3);
      for (int k = 0; k < 200; ++k) {
        const LightReceiver<float> to = random_receiver(number);
        double sum = 0;
        for (uint32_t i = 0; i < view.count; ++i) sum += double{selection_pdf(view, i, to)};
        // Bounds become tighter towards the leaves, so some random numbers lead to nodes in which
        // no light contributes. In that case, no light is selected.
        double none = 0;
        constexpr int kTries = 400;
        for (int i = 0; i < kTries; ++i) {
          const float u = (static_cast<float>(i) + 0.5f) / kTries;
          const bool found = detail::choose_by_tree<float>(view, to, u, true).light != kNoLight;
          none += found ? 0 : 1.0 / kTries;
        }
        ASSERT_NEAR(sum, 1 - none, none == 0 ? 0.01 : 0.05) << n << ", " << infinite;
      }
    }
  }
  // Spheres emit in all directions.
  std::vector<Light> spheres;
  Numbers number(4);
  for (int i = 0; i < 500; ++i) {
    const Vec3<float> at = number.point(10);
    spheres.push_back(make_light(LightKind::kSphere, translate(at.x, at.y, at.z)));
    spheres.back().radius = number();
  }
  const Lights all(spheres);
  for (int k = 0; k < 100; ++k) {
    double sum = 0;
    const LightReceiver<float> to(number.point(20));
    for (uint32_t i = 0; i < 500; ++i) sum += double{selection_pdf(by_tree(all), i, to)};
    ASSERT_NEAR(sum, 1, 1e-5);
  }
}

/// Every light that contributes at a receiver can be selected. A light contributes if a light
/// sample above the horizon of the receiver is valid.
TEST(LightTree, WhatShinesCanBeChosen) {
  const Lights lights = random_lights(300, 8);
  const LightView power = lights.view(), view = by_tree(lights);
  Numbers number(9);
  int seen = 0;
  for (int k = 0; k < 40000; ++k) {
    const Vec3<float> p = k % 3 == 0 ? number.point(1) : number.point(12), n = number.direction();
    const auto s = sample_light<float>(power, p, number(), number(), number(), true);
    if (!s.valid || !(dot(s.wi, n) > 0)) continue;
    ++seen;
  }
  EXPECT_GT(seen, 4000);
  Numbers again(9);
  for (int k = 0; k < 40000; ++k) {
    const Vec3<float> p = k % 3 == 0 ? again.point(1) : again.point(12), n = again.direction();
    const float u = again(), a = again(), b = again();
    const auto s = sample_light<float>(power, p, u, a, b, true);
    if (!s.valid || !(dot(s.wi, n) > 0)) continue;
    const uint32_t light = detail::light_by_power<float>(power, u, true);
    ASSERT_GT(selection_pdf(view, light, LightReceiver<float>(p)), 0.f) << light;
    ASSERT_GT(selection_pdf(view, light, LightReceiver<float>(p, pack_normal<float>(n))), 0.f)
        << light;
  }
}

/// The light density that MIS uses for bounces equals the density of light samples. Estimates with
/// the light tree agree with estimates with selection by power.
TEST(LightTree, BothHalvesOfMisAgree) {
  const Lights lights = random_lights(200, 14, 2);
  const LightView power = lights.view(), view = by_tree(lights);
  Numbers number(15);
  int finite = 0;
  for (int k = 0; k < 20000; ++k) {
    LightReceiver<float> to = random_receiver(number);
    to.seed = static_cast<uint32_t>(number.rng());
    const float u = number();
    const auto s = sample_light<float>(view, to, u, number(), number(), true);
    const uint32_t light = select_light_index<float>(view, to, u, true);
    if (!s.valid || s.is_delta || light < view.infinite_count) continue;
    ++finite;
    const float pdf = light < view.first_triangle
                          ? light_hit<float>(view, light, to, s.wi, s.distance, true).pdf
                          : triangle_light_pdf<float>(view, light, to, s.wi, s.distance, true);
    ASSERT_NEAR(pdf, s.pdf, 2e-3f * s.pdf) << light;
  }
  EXPECT_GT(finite, 5000);

  double variance[2] = {0, 0};
  for (int k = 0; k < 12; ++k) {
    const Vec3<float> p = number.point(12), n = number.direction();
    LightReceiver<float> to(p, pack_normal<float>(n));
    double mean[2] = {0, 0}, error2[2] = {0, 0};
    constexpr int kSamples = 40000;
    for (int way = 0; way < 2; ++way) {
      double sum = 0, sum2 = 0;
      for (int i = 0; i < kSamples; ++i) {
        to.seed = static_cast<uint32_t>(number.rng());
        const auto s =
            sample_light<float>(way == 0 ? power : view, to, number(), number(), number(), true);
        const double x = s.valid ? double{s.weight.y} * std::max(0.f, dot(s.wi, n)) : 0;
        sum += x;
        sum2 += x * x;
      }
      mean[way] = sum / kSamples;
      error2[way] = (sum2 / kSamples - mean[way] * mean[way]) / kSamples;
    }
    // Where no light arrives, both estimates are 0.
    EXPECT_LE(std::abs(mean[0] - mean[1]), 4.5 * std::sqrt(error2[0] + error2[1])) << k;
    for (int way = 0; way < 2; ++way) variance[way] += error2[way] / (mean[0] * mean[0] + 1e-12);
  }
  EXPECT_LT(variance[1], 0.5 * variance[0]);
}

TEST(LightTree, ConesHoldWhatTheyUnite) {
  Numbers number(10);
  for (int k = 0; k < 2000; ++k) {
    DirectionCone cones[2];
    for (DirectionCone& c : cones) {
      const Vec3<float> d = number.direction();
      const double axis[3] = {double{d.x}, double{d.y}, double{d.z}};
      std::copy_n(axis, 3, c.axis);
      c.angle = double{number()} * (number() < 0.5f ? 0.3 : kPiD);
      c.two_sided = number() < 0.3f;
    }
    if (k % 7 == 0)
      std::transform(cones[0].axis, cones[0].axis + 3, cones[1].axis, std::negate<>());
    const DirectionCone all = unite(cones[0], cones[1]);
    const auto cosine = [](const DirectionCone& c, const Vec3<float>& d) {
      const double x = c.axis[0] * double{d.x} + c.axis[1] * double{d.y} + c.axis[2] * double{d.z};
      return std::acos(std::clamp(c.two_sided ? std::abs(x) : x, -1.0, 1.0));
    };
    for (int i = 0; i < 50; ++i) {
      const Vec3<float> d = number.direction();
      for (const DirectionCone& c : cones)
        if (cosine(c, d) < c.angle) {
          ASSERT_LT(cosine(all, d), all.angle + 1e-5) << k;
        }
    }
  }
}

TEST(LightTree, PacketsGiveTheBitsOfScalars) {
  const Lights lights = random_lights(200, 11, 3);
  const LightView view = by_tree(lights);
  constexpr size_t kN = 1 << 12;
  Numbers number(12);
  std::vector<float> in[5];
  std::vector<uint32_t> ids, normals, seeds;
  for (size_t i = 0; i < kN; ++i) {
    const LightReceiver<float> to = random_receiver(number);
    const float values[] = {to.p.x, to.p.y, to.p.z, number(), number()};
    for (size_t c = 0; c < 5; ++c) in[c].push_back(values[c]);
    ids.push_back(static_cast<uint32_t>(number.rng()) % view.count);
    normals.push_back(to.normal);
    seeds.push_back(static_cast<uint32_t>(number.rng()));
  }
  const auto run = [&]<typename F>(std::vector<uint32_t>& out) {
    using U = UInt<F>;
    out.assign(3 * kN, 0u);
    for (size_t i = 0; i < kN; i += kWidth<F>) {
      LightReceiver<F> to(Vec3<F>(load<F>(&in[0][i]), load<F>(&in[1][i]), load<F>(&in[2][i])),
                          load<U>(&normals[i]));
      to.seed = load<U>(&seeds[i]);
      const Mask<F> active = load<F>(&in[4][i]) < 0.9f;
      const auto choice = detail::choose_by_tree<F>(view, to, load<F>(&in[3][i]), active);
      store(&out[i], choice.light);
      store(&out[kN + i], float_bits<F>(choice.pdf));
      const U id = load<U>(&ids[i]);
      const Mask<F> finite = active & Mask<F>(id >= U(view.infinite_count));
      store(&out[2 * kN + i], float_bits<F>(detail::tree_pdf<F>(view, id, to, finite)));
    }
  };
  std::vector<uint32_t> scalar;
  run.operator()<float>(scalar);
  lane_testing::for_each_packet([&]<typename F>() {
    std::vector<uint32_t> packets;
    run.template operator()<F>(packets);
    EXPECT_EQ(packets, scalar) << kWidth<F>;
  });
}

TEST(LightTree, LightsAtOnePlaceAndBlackOnes) {
  std::vector<Light> same(3000, make_light(LightKind::kSphere));
  for (Light& light : same) light.radius = 0;
  const Lights lights(same);
  const LightView view = by_tree(lights);
  EXPECT_FLOAT_EQ(view.tree.effective_lights, 3000);
  double sum = 0;
  for (uint32_t i = 0; i < view.count; ++i)
    sum += double{selection_pdf(view, i, LightReceiver<float>(Vec3<float>{0, 0, 0}))};
  EXPECT_NEAR(sum, 1, 1e-5);

  Light black = make_light(LightKind::kRect);
  black.color = {0, 0, 0};
  const Lights dark({black, black});
  EXPECT_EQ(dark.view().tree.effective_lights, 0);
  EXPECT_FALSE(chooses_by_tree(LightSelection::kTree, dark.view()));
  const Lights one({black, make_light(LightKind::kRect)});
  EXPECT_TRUE(chooses_by_tree(LightSelection::kTree, one.view()));
  EXPECT_FALSE(chooses_by_tree(LightSelection::kAuto, one.view()));
  EXPECT_FALSE(chooses_by_tree(LightSelection::kPower, view));
  EXPECT_EQ(selection_pdf(by_tree(one), 1, LightReceiver<float>(Vec3<float>{0, 0, -3})), 1.f);
}

/// A weak light nearby is preferred to a strong one far away.
TEST(LightTree, NearLightsAreChosenMostly) {
  Light near = make_light(LightKind::kSphere, translate(0, 0, 1)), far = near;
  near.radius = far.radius = 0.1f;
  far.to_world = translate(0, 0, 100);
  far.color = near.color * 100.f;
  const Lights lights({near, far});
  const LightView view = by_tree(lights);
  EXPECT_GT(selection_pdf(view, 0, LightReceiver<float>(Vec3<float>{0, 0, 0})), 0.98f);
  EXPECT_GT(selection_pdf(view, 1, LightReceiver<float>(Vec3<float>{0, 0, 90})), 0.98f);
}

TEST(LightTree, HundredThousandTrianglesAreQuick) {
  std::vector<EmissiveTriangle> triangles;
  Numbers number(13);
  for (int i = 0; i < 100000; ++i) {
    const Vec3<float> at = number.point(10);
    triangles.push_back(make_triangle(at, at + number.point(0.1f), at + number.point(0.1f)));
  }
  const Lights lights({}, triangles);
  std::vector<double> powers(triangles.size(), 1);
  const auto start = std::chrono::steady_clock::now();
  const LightTree tree = build_light_tree(lights.set, powers);
  const std::chrono::duration<double> seconds = std::chrono::steady_clock::now() - start;
  RecordProperty("build_ms", static_cast<int>(1e3 * seconds.count()));
  EXPECT_LT(seconds.count(), 20);
  ASSERT_EQ(tree.nodes.size(), triangles.size() - 1);
  // The light tree is deep enough for all lights, and reasonably balanced.
  const LightTree again = build_light_tree(lights.set, powers);
  EXPECT_EQ(tree.trails, again.trails);
  EXPECT_LT(*std::max_element(tree.trails.begin(), tree.trails.end()), 1u << 31);
}

}  // namespace
}  // namespace wavecomb
