// SPDX-License-Identifier: Apache-2.0
/// JointVertex::towards evaluates the BSDF only if a lane needs its density.
#include <gtest/gtest.h>

#include "wavecomb/integrate/steps/join.h"

namespace wavecomb {
namespace {

using F = float;

/// A BSDF that counts its evaluations.
struct CountingBsdf {
  mutable int evaluations = 0;

  Vec3<F> view(const Vec3<F>& wo) const { return wo; }
  BsdfEval<F> eval(const Vec3<F>& /*view*/, const Vec3<F>& /*wi*/) const {
    ++evaluations;
    return {Color<F>(1.f), 0.25f};
  }
};

struct FakePlace {
  struct {
    Vec3<F> ng{0, 0, 1};
  } s;
  CountingBsdf bsdf;
};

/// Evaluations of a vertex with ratio `ratio`, and the ratio towards a light at 60 degrees.
struct Found {
  int evaluations;
  F ratio;
};

Found found(uint32_t depth, F ratio, bool merges, bool wanted) {
  const SceneView scene;
  const ShadeSettings settings{Settings{}};
  const SampleKey<F> key{};
  const MeshHit<F> hit{};
  const UInt<F> geom(0u), material(0u);
  const F t = 1;
  const PathState<F> path{};
  const Mask<F> active(true);
  const Vertex<F> v{scene, settings, key, depth, hit, geom, t, material, path, nullptr, active};
  const FakePlace at;
  const JointVertex<F> joint{ratio, 1.f, 0.f, Mask<F>(merges), 0.f};
  const Vec3<F> wo{0, 0, 1}, wi{std::sqrt(0.75f), 0, 0.5f};
  const F towards = joint.towards<CountingBsdf>(v, at, wo, wi, wi, Mask<F>(wanted));
  return {at.bsdf.evaluations, towards};
}

TEST(JointVertex, EvaluatesTheBsdfOnlyWhereItsDensityCounts) {
  const Found counts = found(1, 2, false, true);
  EXPECT_EQ(counts.evaluations, 1);
  EXPECT_FLOAT_EQ(counts.ratio, 2 * 0.5f * 0.25f);
  const Found first = found(0, 2, false, true);
  EXPECT_EQ(first.evaluations, 0) << "the camera's own vertex has no density back";
  EXPECT_FLOAT_EQ(first.ratio, 2 * 0.5f);
  EXPECT_EQ(found(1, 0, false, true).evaluations, 0) << "no light path reaches the vertex";
  EXPECT_EQ(found(1, 2, true, true).evaluations, 0) << "light paths end here";
  EXPECT_EQ(found(1, 2, false, false).evaluations, 0) << "no lane has a direction";
}

}  // namespace
}  // namespace wavecomb
