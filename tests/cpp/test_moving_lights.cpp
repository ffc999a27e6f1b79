// SPDX-License-Identifier: Apache-2.0
/// Lights that move while the shutter is open.
#include <gtest/gtest.h>

#include <cmath>

#include "lane_testing.h"
#include "light_tree_testing.h"
#include "wavecomb/light/description/motion.h"
#include "wavecomb/light/sampling/light_sample.h"
#include "wavecomb/light/tree/light_cluster.h"

namespace wavecomb {
namespace {

using namespace light_testing;

/// Transform of a light that moves and rotates between the shutter ends, at `time`.
Affine place_at(float time, float size) {
  const auto angle = static_cast<double>(time);
  Affine place = rotate(20 + 8 * angle, -30 + 6 * angle) * scale(size, size, size);
  place.t = {1 + 2 * time, 2 - time, 3 + 0.5f * time};
  return place;
}

/// Makes one light of each kind, at its transform at `time`; with `moves`, it moves over the
/// shutter.
Lights one_of_each(float time, bool moves) {
  Lights lights;
  const uint32_t image = lights.add_texture(4, 2, {1, 0, 0, 0, 1, 0, 0, 0, 1, 3, 3, 3,  //
                                                   2, 1, 0, 0, 2, 1, 1, 0, 2, 0, 0, 0});
  std::vector<Light> all;
  for (const LightKind kind : {LightKind::kRect, LightKind::kDisk, LightKind::kSphere,
                               LightKind::kCylinder, LightKind::kDistant, LightKind::kDome}) {
    const float size = kind == LightKind::kDome ? 1.f : 1.5f;
    Light& light = all.emplace_back(make_light(kind, place_at(moves ? 0.5f : time, size)));
    if (kind == LightKind::kDome || kind == LightKind::kRect) light.texture = image;
    if (kind == LightKind::kDisk) light.shaping.cone_angle = 60;
    light.angle = 30;
    if (!moves) continue;
    for (const float t : {0.f, 0.25f, 0.5f, 0.75f, 1.f}) light.motion.push_back(place_at(t, size));
  }
  lights.build(all);
  return lights;
}

TEST(MovingLights, AreAtEachTimeAsIfTheyStoodThere) {
  const Lights moving = one_of_each(0, true);
  const LightView view = moving.view();
  ASSERT_NE(view.motions, nullptr);
  Numbers number(3);
  for (const float time : {0.f, 0.25f, 0.6f, 1.f}) {
    const Lights still = one_of_each(time, false);
    size_t valid = 0;
    for (int i = 0; i < 4000; ++i) {
      LightReceiver<float> to(number.point(4));
      to.time = time;
      const float pick = number(), u = number(), v = number();
      // Round lights are sampled around an arbitrary axis.
      const auto kind = LightKind{
          static_cast<uint8_t>(view.lights[chosen_light<float>(view, to, pick, true)].kind)};
      if (kind != LightKind::kRect && kind != LightKind::kDisk && kind != LightKind::kDome)
        continue;
      const auto a = sample_light<float>(view, to, pick, u, v, true);
      const auto b = sample_light<float>(still.view(), to, pick, u, v, true);
      ASSERT_EQ(a.valid, b.valid);
      if (!a.valid) continue;
      ++valid;
      ASSERT_NEAR(dot(a.wi, b.wi), 1, 2e-5);
      ASSERT_NEAR(a.pdf / b.pdf, 1, 4e-3);
      ASSERT_NEAR(a.distance / b.distance, 1, 1e-3);
    }
    EXPECT_GT(valid, 400u);
  }
}

TEST(MovingLights, BothHalvesOfMisAgree) {
  const Lights lights = one_of_each(0, true);
  const LightView view = lights.view();
  Numbers number(4);
  for (int i = 0; i < 20000; ++i) {
    LightReceiver<float> to(number.point(4));
    to.time = number();
    const float pick = number();
    const uint32_t light = chosen_light<float>(view, to, pick, true);
    const auto s = sample_light<float>(view, to, pick, number(), number(), true);
    if (!s.valid) continue;
    const float radiance = s.weight.y * s.pdf;
    if (light < view.infinite_count) {
      const auto seen = infinite_light_radiance<float>(
          view, light, {.from = to.p, .dir = s.wi, .is_delta = true, .time = to.time}, true);
      ASSERT_NEAR(seen.y, radiance, 2e-3f * radiance + 1e-4f);
      continue;
    }
    const auto hit = light_hit<float>(view, light, to, s.wi, s.distance, true);
    ASSERT_NEAR(hit.pdf, s.pdf, 4e-3f * s.pdf) << light;
    ASSERT_NEAR(hit.radiance.y, radiance, 4e-3f * radiance + 1e-4f) << light;
  }
}

TEST(MovingLights, BoundsHoldTheWholeWay) {
  const Lights lights = one_of_each(0, true);
  const LightView view = lights.view();
  Numbers number(5);
  for (uint32_t light = view.infinite_count; light < view.count; ++light) {
    const LightMotion& motion = lights.set.motions[light];
    const LightCluster way =
        along_way(motion, lights.set.motion_steps, bound_light(lights.set.records[light], 1.0));
    for (int i = 0; i < 2000; ++i) {
      LightReceiver<float> to(number.point(6));
      to.time = number();
      const float pick = number();
      if (chosen_light<float>(view, to, pick, true) != light) continue;
      const auto there = sample_light<float>(view, to, pick, number(), number(), true);
      if (!there.valid) continue;
      const Vec3<float> p = to.p + there.wi * there.distance;
      const float at[3] = {p.x, p.y, p.z};
      for (int k = 0; k < 3; ++k) {
        ASSERT_GE(at[k], way.lo[k] - 1e-4f);
        ASSERT_LE(at[k], way.hi[k] + 1e-4f);
      }
    }
  }
  LightView tree = view;
  tree.by_tree = true;
  for (int i = 0; i < 5000; ++i) {
    LightReceiver<float> to(number.point(6));
    to.time = number();
    for (uint32_t light = view.infinite_count; light < view.count; ++light)
      ASSERT_GE(detail::tree_pdf<float>(tree, light, to, true), 0.f);
    const float pick = number();
    const uint32_t light = chosen_light<float>(view, to, pick, true);
    const auto s = sample_light<float>(view, to, pick, number(), number(), true);
    if (!s.valid || light < view.infinite_count) continue;
    ASSERT_GT(detail::tree_pdf<float>(tree, light, to, true), 0.f) << light;
  }
}

TEST(MovingLights, PacketsGiveTheBitsOfScalars) {
  const Lights lights = one_of_each(0, true);
  const LightView view = lights.view();
  constexpr size_t kN = 4096;
  Numbers number(6);
  std::vector<float> in[8];
  for (size_t c = 0; c < 8; ++c)
    for (size_t i = 0; i < kN; ++i) in[c].push_back(c < 3 ? number.between(-4, 4) : number());
  const auto run = [&]<typename F>(std::vector<float>& out) {
    out.assign(11 * kN, 0.f);
    for (size_t i = 0; i < kN; i += kWidth<F>) {
      const auto at = [&](size_t c) { return load<F>(&in[c][i]); };
      size_t column = 0;
      const auto put = [&](const F& x) { store(&out[kN * column++ + i], x); };
      LightReceiver<F> to(Vec3<F>(at(0), at(1), at(2)));
      to.time = at(6);
      const Mask<F> active = at(7) < 0.9f;
      const auto s = sample_light<F>(view, to, at(3), at(4), at(5), active);
      for (const F& x : {s.wi.x, s.wi.y, s.distance, s.weight.x, s.pdf}) put(x);
      const UInt<F> light = chosen_light<F>(view, to, at(3), active);
      const auto hit = light_hit<F>(view, light, to, s.wi, s.distance, active);
      for (const F& x : {hit.radiance.x, hit.radiance.z, hit.pdf}) put(x);
      const auto escaped = escaped_radiance<F>(view,
                                               {.from = to.p,
                                                .dir = square_to_sphere<F>(at(4), at(5)),
                                                .bsdf_pdf = at(7),
                                                .is_delta = at(6) < 0.3f,
                                                .time = to.time},
                                               active);
      for (const F& x : {escaped.x, escaped.y, escaped.z}) put(x);
    }
  };
  std::vector<float> scalar;
  run.operator()<float>(scalar);
  lane_testing::for_each_packet([&]<typename F>() {
    std::vector<float> packets;
    run.template operator()<F>(packets);
    lane_testing::expect_same(scalar, packets, "moving lights");
  });
}

TEST(MovingLights, PlacesInDoubleAreThoseOfKernels) {
  const Lights lights = one_of_each(0, true);
  const LightView view = lights.view();
  Numbers number(7);
  for (int i = 0; i < 2000; ++i) {
    const uint32_t light = static_cast<uint32_t>(i) % view.count;
    const float time = number();
    const Vec3<float> p = number.point(5);
    const LightPose<float> pose = light_pose<float>(view, light, time, true);
    const LightPlace place(lights.set.motions[light], lights.set.motion_steps, double{time});
    double at_rest[3];
    place.point_to_rest({double{p.x}, double{p.y}, double{p.z}}, at_rest);
    const Vec3<float> q = pose.point_to_rest(p);
    ASSERT_NEAR(q.x, at_rest[0], 1e-5);
    ASSERT_NEAR(q.y, at_rest[1], 1e-5);
    ASSERT_NEAR(q.z, at_rest[2], 1e-5);
    const Vec3<float> back = pose.point_to_world(q);
    ASSERT_NEAR(length(back - p), 0, 2e-5);
  }
}

}  // namespace
}  // namespace wavecomb
