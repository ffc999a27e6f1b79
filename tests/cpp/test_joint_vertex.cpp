// SPDX-License-Identifier: Apache-2.0
// JointVertex evaluates the BSDF in reverse only where the result depends on it.
#include <gtest/gtest.h>

#include "wavecomb/core/settings.h"
#include "wavecomb/light_paths/join.h"

namespace wavecomb {
namespace {

/// A BSDF that counts its evaluations.
struct CountingBsdf {
  struct View {};
  static inline int evaluations = 0;
  View view(const Vec3<float>& /*wo*/) const { return {}; }
  BsdfEval<float> eval(const View& /*view*/, const Vec3<float>& /*wi*/) const {
    ++evaluations;
    return {.f_cos = Color<float>(1.f), .pdf = 0.25f};
  }
};

struct CountingInteraction {
  struct {
    Vec3<float> ng{0, 0, 1};
  } s;
  CountingBsdf bsdf;
};

struct JointCase {
  const char* name;
  uint32_t depth;
  bool wanted, merges;
  float ratio;
  int evaluations;
  float result;
};

TEST(JointVertex, EvaluatesTheBsdfOnlyWhereItCounts) {
  const JointCase cases[] = {
      {"a bounce", 1, true, false, 2.f, 1, 0.5f},
      {"the first vertex, whose previous direction has no density", 0, true, false, 2.f, 0, 2.f},
      {"an invalid light sample", 1, false, false, 2.f, 0, 2.f},
      {"a vertex that merges light paths", 1, true, true, 2.f, 0, 2.f},
      {"a vertex that light paths cannot reach", 1, true, false, 0.f, 0, 0.f},
  };
  const SceneView scene{};
  const ShadeSettings settings{Settings{}};
  const SampleKey<float> key{};
  const MeshHit<float> hit{};
  const uint32_t id = 0;
  const float t = 1;
  const PathState<float> path{};
  const bool active = true;
  for (const JointCase& c : cases) {
    const Vertex<float> v{.scene = scene,
                          .settings = settings,
                          .key = key,
                          .depth = c.depth,
                          .hit = hit,
                          .geom = id,
                          .t = t,
                          .material = id,
                          .path = path,
                          .aovs = nullptr,
                          .active = active};
    const JointVertex<float> joint{.ratio = c.ratio,
                                   .inverse_cos = 1.f,
                                   .connection_ratio = 0.f,
                                   .merges = c.merges,
                                   .radius2 = 0.f,
                                   .connects = false};
    const Vec3<float> up{0, 0, 1};
    CountingBsdf::evaluations = 0;
    const float r = joint.towards<CountingBsdf>(v, CountingInteraction{}, up, up, up, c.wanted);
    EXPECT_EQ(CountingBsdf::evaluations, c.evaluations) << c.name;
    EXPECT_FLOAT_EQ(r, c.result) << c.name;
  }
}

}  // namespace
}  // namespace wavecomb
