// SPDX-License-Identifier: Apache-2.0
#include "lane_testing.h"
#include "wavecomb/core/affine.h"
#include "wavecomb/core/frame.h"
#include "wavecomb/core/vec.h"

namespace wavecomb {
namespace {

using namespace lane_testing;
using V = Vec3<float>;

/// Returns unit vectors all over the sphere, starting with axes and directions near the poles.
std::vector<V> directions() {
  std::vector<V> all;
  for (const float s : {-1.f, 1.f}) {
    for (const V& v :
         {V(s, 0, 0), V(0, s, 0), V(0, 0, s), V(0, -0.f, s), V(1e-20f, 0, s), V(1e-4f, -1e-4f, s),
          V(0.6f, 0.8f, 0.f * s), V(0.6f, 0, 0.8f * s), V(0.8f, 0.6f, -1e-30f * s)}) {
      all.push_back(normalize(v));
    }
  }
  std::mt19937 rng(1);
  std::normal_distribution<float> normal;
  while (all.size() < 4096) all.push_back(normalize(V(normal(rng), normal(rng), normal(rng))));
  return all;
}

template <typename F>
Vec3<F> load_vec(const std::vector<V>& v, size_t i) {
  float x[16], y[16], z[16];
  for (size_t k = 0; k < kWidth<F>; ++k) {
    x[k] = v[i + k].x;
    y[k] = v[i + k].y;
    z[k] = v[i + k].z;
  }
  return {load<F>(x), load<F>(y), load<F>(z)};
}
template <typename F>
V lane_vec(const Vec3<F>& v, size_t k) {
  return {lane(v.x, k), lane(v.y, k), lane(v.z, k)};
}
void expect_same(const V& a, const V& b) {
  ASSERT_TRUE(same_bits(a.x, b.x) && same_bits(a.y, b.y) && same_bits(a.z, b.z));
}
void expect_orthonormal(const Frame<float>& f, double tolerance) {
  ASSERT_NEAR(dot(f.s, f.s), 1, tolerance);
  ASSERT_NEAR(dot(f.t, f.t), 1, tolerance);
  ASSERT_NEAR(dot(f.s, f.t), 0, tolerance);
  ASSERT_NEAR(dot(f.s, f.n), 0, tolerance);
  ASSERT_NEAR(dot(f.t, f.n), 0, tolerance);
  ASSERT_NEAR(dot(cross(f.s, f.t), f.n), 1, 2 * tolerance);  // right-handed
}

TEST(Vec, Algebra) {
  const V a(1, 2, 3), b(4, -5, 6);
  EXPECT_EQ(dot(a, b), 12);
  expect_same(cross(a, b), V(27, 6, -13));
  EXPECT_EQ(length(V(2, 3, 6)), 7);
  EXPECT_EQ(length_squared(a), 14);
  expect_same(a + b, V(5, -3, 9));
  expect_same(a - b, V(-3, 7, -3));
  expect_same(a * b, V(4, -10, 18));
  expect_same(a * 2.f, V(2, 4, 6));
  expect_same(2.f * a, V(2, 4, 6));
  expect_same(-a, V(-1, -2, -3));
  expect_same(fma(a, 2.f, b), V(6, -1, 12));
  expect_same(lerp(a, b, 0.5f), V(2.5f, -1.5f, 4.5f));
  expect_same(lerp(a, b, 0.f), a);
  expect_same(min(a, b), V(1, -5, 3));
  expect_same(max(a, b), V(4, 2, 6));
  EXPECT_EQ(max_component(b), 6);
  EXPECT_NEAR(luminance(V(1, 1, 1)), 1, 1e-6);
  EXPECT_TRUE(is_black(V(0, -0.f, 0)));
  EXPECT_FALSE(is_black(V(0, 1e-45f, 0)));
  EXPECT_FALSE(is_black(V(0, kNan, 0)));
  expect_same(select<float>(true, a, b), a);
  V c = a;
  c += b;
  c *= 2.f;
  expect_same(c, V(10, -6, 18));
}

TEST(Vec, NormalizeGivesUnitLength) {
  for (const V& d : directions())
    for (const float scale : {1e-15f, 1.f, 1e15f})
      ASSERT_NEAR(length(normalize(d * scale)), 1, 3e-7);
}

TEST(Vec, GatherVec3) {
  std::vector<float> base(300);
  for (size_t i = 0; i < base.size(); ++i) base[i] = static_cast<float>(i);
  for_each_lane_type([&]<typename F>() {
    const UInt<F> index = lane_index<F>() * 5u + 2u;
    const auto v = gather_vec3<F>(base.data(), index, Mask<F>(true));
    for (uint32_t k = 0; k < kWidth<F>; ++k) {
      const auto i = static_cast<float>(3 * (5 * k + 2));
      expect_same(lane_vec(v, k), V(i, i + 1, i + 2));
    }
  });
}

TEST(Vec, Lanes) {
  const auto d = directions();
  for_each_packet([&]<typename F>() {
    for (size_t i = 0; i + 16 < 512; i += kWidth<F>) {
      const auto a = load_vec<F>(d, i), b = load_vec<F>(d, i + 16);
      const auto c = cross(a, b), n = normalize(Vec3<F>(a + b)), l = lerp(a, b, F(0.3f));
      for (size_t k = 0; k < kWidth<F>; ++k) {
        const V x = d[i + k], y = d[i + 16 + k];
        expect_same(lane_vec(c, k), cross(x, y));
        expect_same(lane_vec(n, k), normalize(x + y));
        expect_same(lane_vec(l, k), lerp(x, y, 0.3f));
        ASSERT_TRUE(same_bits(lane(dot(a, b), k), dot(x, y)));
        ASSERT_TRUE(same_bits(lane(luminance(a), k), luminance(x)));
      }
    }
  });
}

TEST(Frame, OrthonormalAroundAnyNormal) {
  for (const V& n : directions()) {
    const Frame<float> f = make_frame(n);
    expect_same(f.n, n);
    expect_orthonormal(f, 1e-6);
  }
}

TEST(Frame, ToWorldInvertsToLocal) {
  const auto d = directions();
  for (size_t i = 0; i + 1 < d.size(); ++i) {
    const Frame<float> f = make_frame(d[i]);
    const V back = f.to_world(f.to_local(d[i + 1]));
    ASSERT_NEAR(length(back - d[i + 1]), 0, 1e-6);
    ASSERT_NEAR(f.to_local(d[i]).z, 1, 1e-6);
    ASSERT_NEAR(f.to_world(V(0, 0, 1)).x, d[i].x, 1e-6);
  }
}

TEST(Frame, TangentIsKeptWhereItCan) {
  const auto d = directions();
  for (size_t i = 0; i + 1 < d.size(); ++i) {
    const V n = d[i], tangent = d[i + 1] * 3.f;
    const Frame<float> f = make_frame(n, tangent);
    const double sine = length(cross(n, tangent)) / 3;
    if (sine < 1e-3) continue;
    expect_orthonormal(f, 1e-6 / sine);
    ASSERT_GT(dot(f.s, tangent), 0);
    ASSERT_NEAR(dot(f.t, tangent), 0, 1e-5 / sine);
  }
}

TEST(Frame, BadTangentsFallBack) {
  for (const V& n : directions()) {
    for (const V& tangent : {V(0, 0, 0), V(kNan, 0, 0), V(kInf, 1, 0), n, -n, n * 1e10f, n * 1e-15f,
                             V(1e-30f, 0, 0)}) {
      const Frame<float> f = make_frame(n, tangent);
      ASSERT_NEAR(dot(f.s, f.s), 1, 1e-5);
      ASSERT_NEAR(dot(f.s, f.n), 0, 1e-3);
      ASSERT_NEAR(dot(f.t, f.n), 0, 1e-5);
    }
  }
}

TEST(Frame, Lanes) {
  const auto d = directions();
  for_each_packet([&]<typename F>() {
    for (size_t i = 0; i + 32 < d.size(); i += kWidth<F>) {
      const auto n = load_vec<F>(d, i), t = load_vec<F>(d, i + 16);
      const Frame<F> a = make_frame(n), b = make_frame(n, t);
      const auto local = b.to_local(a.t), world = a.to_world(t);
      for (size_t k = 0; k < kWidth<F>; ++k) {
        const Frame<float> x = make_frame(d[i + k]), y = make_frame(d[i + k], d[i + 16 + k]);
        expect_same(lane_vec(a.s, k), x.s);
        expect_same(lane_vec(b.s, k), y.s);
        expect_same(lane_vec(b.t, k), y.t);
        expect_same(lane_vec(local, k), y.to_local(x.t));
        expect_same(lane_vec(world, k), x.to_world(d[i + 16 + k]));
      }
    }
  });
}

TEST(Frame, Trigonometry) {
  EXPECT_EQ(cos_theta(V(0.1f, 0.2f, -0.5f)), -0.5f);
  EXPECT_EQ(abs_cos_theta(V(0.1f, 0.2f, -0.5f)), 0.5f);
  EXPECT_TRUE(same_hemisphere(V(1, 0, 0.1f), V(-1, 0, 0.2f)));
  EXPECT_FALSE(same_hemisphere(V(1, 0, 0.1f), V(1, 0, -0.2f)));
  EXPECT_FALSE(same_hemisphere(V(1, 0, 0), V(1, 0, 1)));
}

TEST(Affine, ComposesAndMaps) {
  const Affine a{{{2, 1, 0}, {0, 3, 1}, {1, 0, 4}}, {5, 6, 7}},
      b{{{0, -1, 0}, {1, 0, 0}, {0, 0, 2}}, {1, 2, 3}};
  const V p(0.5f, -1, 2);
  expect_same((a * b).point(p), a.point(b.point(p)));
  expect_same((a * b).vector(p), a.vector(b.vector(p)));
  expect_same(a.axis(1), V(1, 3, 0));
  EXPECT_EQ(a.determinant(), 2 * 12 - 1 * (0 - 1));
  EXPECT_EQ((a * b).determinant(), a.determinant() * b.determinant());
  EXPECT_TRUE(Affine{}.is_identity());
  EXPECT_FALSE(a.is_identity());
  EXPECT_TRUE((Affine{} * Affine{}).is_identity());
}

}  // namespace
}  // namespace wavecomb
