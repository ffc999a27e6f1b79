// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <map>
#include <vector>

#include "curve_testing.h"
#include "wavecomb/geometry/curve/bvh_nodes.h"

namespace wavecomb {
namespace {

using namespace curve_testing;

constexpr Primitive kStrands[] = {Primitive::kLinearTube, Primitive::kCubicTube,
                                  Primitive::kLinearRibbon, Primitive::kCubicRibbon};

float uniform(std::mt19937& rng) {
  return std::uniform_real_distribution<float>(-1, 1)(rng);
}

struct TestRay {
  float o[3], d[3];
};

/// Makes a ray that passes a control point at a distance of `near` times the radius of the point.
TestRay aimed(const Mesh& mesh, std::mt19937& rng, float near) {
  const size_t point = rng() % mesh.vertex_count();
  const float reach = near * mesh.radii[point], scale = std::exp(2.f * uniform(rng));
  TestRay ray{};
  for (int k = 0; k < 3; ++k) {
    const float to = mesh.positions[3 * point + k] + reach * uniform(rng);
    ray.o[k] = mesh.positions[3 * point + k] + 0.5f * uniform(rng);
    ray.d[k] = scale * (to - ray.o[k]);
  }
  return ray;
}

bool enters(const Bounds& box, const TestRay& ray) {
  const float lo[3] = {box.lo.x, box.lo.y, box.lo.z}, hi[3] = {box.hi.x, box.hi.y, box.hi.z};
  double from = 0, to = 1e30;
  for (int k = 0; k < 3; ++k) {
    const double a = (static_cast<double>(lo[k]) - ray.o[k]) / ray.d[k];
    const double b = (static_cast<double>(hi[k]) - ray.o[k]) / ray.d[k];
    from = std::max(from, std::min(a, b));
    to = std::min(to, std::max(a, b));
  }
  return from <= to;
}

/// Calls look(prim, may_hit, hits) for all segments. `may_hit` says whether the ray enters the
/// bounding box of the curve BVH node that contains the segment.
template <typename Look>
void compare(const Mesh& mesh, const CurveBvhNodes& nodes, const TestRay& ray, float tfar,
             const Look& look) {
  std::vector<uint8_t> may(mesh.primitive_count(), 0);
  for (uint32_t c = 0; c < nodes.count(); ++c) {
    if (!enters(nodes.bounds(c), ray)) continue;
    const uint32_t bits = nodes.may_hit(c, CurveRay(ray.o, ray.d), tfar);
    for (uint32_t k = 0; k < CurveBvhNodes::kMaxSubSegments; ++k) {
      if ((bits >> k & 1u) == 0) continue;
      ASSERT_LT(nodes.sub_segment(c, k).prim, mesh.primitive_count());
      may[nodes.sub_segment(c, k).prim] = 1;
    }
  }
  for (uint32_t prim = 0; prim < mesh.primitive_count(); ++prim) {
    const CurveHits hits =
        intersect_curve(mesh, {prim}, CurveRay(ray.o, ray.d), tfar, CurveQuery::kAll);
    look(prim, may[prim] != 0, hits.begin() != hits.end());
  }
}

TEST(CurveBvhNodes, HoldAllPiecesOfEachSegment) {
  for (const Primitive primitive : kStrands)
    for (const float radius : {0.2f, 0.001f}) {
      const Mesh mesh = make_curves(strands(primitive, 27, 3, 1.f, radius, 5));
      const CurveBvhNodes nodes(mesh);
      std::map<uint32_t, std::pair<uint32_t, Bounds>> found;
      for (uint32_t c = 0; c < nodes.count(); ++c)
        for (uint32_t k = 0; k < CurveBvhNodes::kMaxSubSegments; ++k) {
          const uint32_t prim = nodes.sub_segment(c, k).prim;
          if (prim >= mesh.primitive_count()) continue;
          auto& [count, box] = found[prim];
          ++count;
          box.add(nodes.bounds(c));
        }
      EXPECT_EQ(found.size(), mesh.primitive_count());
      for (const auto& [prim, sub_segments] : found) {
        EXPECT_EQ(sub_segments.first, radius < 0.1f ? 4u : 1u);
        if (sub_segments.first > 1) continue;
        const Bounds& all = sub_segments.second;
        const Bounds one = curve_bounds(mesh, prim);
        EXPECT_TRUE(all.lo.x <= one.lo.x && all.lo.y <= one.lo.y && all.lo.z <= one.lo.z);
        EXPECT_TRUE(all.hi.x >= one.hi.x && all.hi.y >= one.hi.y && all.hi.z >= one.hi.z);
      }
    }
}

TEST(CurveBvhNodes, LetThroughAllThatIsMet) {
  std::mt19937 rng(7);
  for (const Primitive primitive : kStrands)
    for (const float radius : {1e-5f, 1e-3f, 0.1f})
      for (const float away : {0.f, 300.f}) {
        CurveData made = strands(primitive, 30, 2, 1.f, radius, 3);
        for (float& x : made.positions) x += away;
        const Mesh mesh = make_curves(made);
        const CurveBvhNodes nodes(mesh);
        size_t met = 0;
        for (uint32_t i = 0; i < 300; ++i) {
          const TestRay ray = aimed(mesh, rng, i % 2 == 0 ? 1.05f : 0.f);
          const float tfar = i % 3 == 0 ? 0.7f : kInf;
          compare(mesh, nodes, ray, tfar, [&](uint32_t prim, bool may, bool is) {
            met += is;
            EXPECT_TRUE(may || !is) << "segment " << prim << ", radius " << radius << ", " << away;
          });
        }
        EXPECT_GT(met, away == 0.f ? 30u : 0u);
      }
}

TEST(CurveBvhNodes, PiecesHaveTheHitsOfTheirSegment) {
  std::mt19937 rng(11);
  for (const Primitive primitive : kStrands)
    for (const float radius : {1e-4f, 1e-2f, 0.1f}) {
      const Mesh mesh = make_curves(strands(primitive, 20, 2, 1.f, radius, 3));
      const CurveQuery first = CurveQuery::kFirst;
      size_t met = 0;
      for (uint32_t i = 0; i < 400; ++i) {
        const TestRay test = aimed(mesh, rng, i % 2 == 0 ? 1.05f : 0.2f);
        const CurveRay ray(test.o, test.d);
        for (uint32_t prim = 0; prim < mesh.primitive_count(); ++prim) {
          const CurveHits whole = intersect_curve(mesh, {prim}, ray, kInf, first, 0, true);
          CurveHits parts;
          for (uint32_t node = 4; node < 8; ++node) {
            const CurveHits part = intersect_curve(mesh, {prim, node}, ray, kInf, first, 0, true);
            const CurveHits any =
                intersect_curve(mesh, {prim, node}, ray, kInf, CurveQuery::kAny, 0, true);
            EXPECT_EQ(part.empty(), any.empty());
            for (const CurveHit& hit : part) parts.add(hit);
          }
          ASSERT_EQ(whole.empty(), parts.empty());
          if (whole.empty()) continue;
          ++met;
          EXPECT_EQ(whole.begin()->t, parts.begin()->t);
          EXPECT_EQ(whole.begin()->u, parts.begin()->u);
          EXPECT_EQ(whole.begin()->v, parts.begin()->v);
        }
      }
      EXPECT_GT(met, 50u);
    }
}

TEST(CurveBvhNodes, LetThroughLittleElseOfHair) {
  std::mt19937 rng(9);
  const Mesh mesh = make_curves(strands(Primitive::kCubicTube, 200, 2, 1.f, 1e-3f, 3));
  const CurveBvhNodes nodes(mesh);
  size_t may = 0, is = 0, all = 0;
  for (uint32_t i = 0; i < 200; ++i)
    compare(mesh, nodes, aimed(mesh, rng, 0.5f), kInf, [&](uint32_t, bool let, bool met) {
      ++all;
      may += let;
      is += met;
    });
  EXPECT_LT(may, 3 * is);
  EXPECT_LT(may, all / 50);
}

}  // namespace
}  // namespace wavecomb
