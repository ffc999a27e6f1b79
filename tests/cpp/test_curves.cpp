// SPDX-License-Identifier: Apache-2.0
#include <functional>

#include "curve_testing.h"
#include "lane_testing.h"
#include "wavecomb/accel/embree_accelerator.h"
#include "wavecomb/core/denormals.h"
#include "wavecomb/geometry/curve/intersect.h"
#include "wavecomb/geometry/hit/surface.h"

namespace wavecomb {
namespace {

using namespace curve_testing;
using V3 = std::array<double, 3>;

double dot(const V3& a, const V3& b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}
V3 sub(const V3& a, const V3& b) {
  return {a[0] - b[0], a[1] - b[1], a[2] - b[2]};
}
V3 along(const V3& p, const V3& d, double t) {
  return {p[0] + t * d[0], p[1] + t * d[1], p[2] + t * d[2]};
}
V3 unit(const V3& a) {
  return along({0, 0, 0}, a, 1 / std::sqrt(dot(a, a)));
}
V3 cross(const V3& a, const V3& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}
V3 widen(const Vec3<float>& v) {
  return {v.x, v.y, v.z};
}

/// Evaluates a curve segment by definition: Bernstein polynomials in double precision.
struct Exact {
  const Mesh& mesh;
  uint32_t prim;

  double weight(int k, double u) const {
    const double w = 1 - u;
    if (!mesh.is_cubic()) return k == 0 ? w : u;
    const double all[4] = {w * w * w, 3 * w * w * u, 3 * w * u * u, u * u * u};
    return all[k];
  }
  uint32_t first() const { return mesh.indices[prim] & kCurveFirstPoint; }
  V3 mix(std::span<const float> values, double u) const {
    V3 sum{};
    for (uint32_t k = 0; k < mesh.segment_points(); ++k)
      for (int c = 0; c < 3; ++c)
        sum[c] += weight(static_cast<int>(k), u) * values[3 * (first() + k) + c];
    return sum;
  }
  V3 point(double u) const { return mix(mesh.positions, u); }
  double radius(double u) const {
    double sum = 0;
    for (uint32_t k = 0; k < mesh.segment_points(); ++k)
      sum += weight(static_cast<int>(k), u) * mesh.radii[first() + k];
    return sum;
  }
  V3 across(double u) const {
    constexpr double h = 1e-5;
    const V3 d = sub(point(std::min(u + h, 1.0)), point(std::max(u - h, 0.0)));
    return unit(cross(d, mix(mesh.normals, u)));
  }
};

/// Returns a local minimum of f on [0, 1], by refining the minimum near sample i of n.
double refine(const std::function<double(double)>& f, int i, int n) {
  double a = std::max(0, i - 1) / static_cast<double>(n);
  double b = std::min(n, i + 1) / static_cast<double>(n);
  for (int step = 0; step < 90; ++step) {
    const double m1 = a + 0.382 * (b - a), m2 = a + 0.618 * (b - a);
    (f(m1) < f(m2) ? b : a) = f(m1) < f(m2) ? m2 : m1;
  }
  return std::min({f(a), f(b), f(0.5 * (a + b))});
}

constexpr double kMissed = 1e30;
constexpr int kSamples = 1200;

/// Returns the smallest t > 0 at which a ray hits the union of the spheres along a curve segment.
/// The search samples the curve parameter u densely. Entry points are minima of t over u, and exit
/// points are maxima.
double brute_tube(const Exact& s, const V3& o, const V3& d) {
  double best = kMissed;
  for (const double side : {-1.0, 1.0}) {
    const auto f = [&](double u) {
      const V3 c = sub(s.point(u), o);
      const double z = dot(c, d), r = s.radius(u), h = r * r - (dot(c, c) - z * z);
      return h >= 0 ? -side * (z + side * std::sqrt(h)) : kMissed;
    };
    std::vector<double> at(kSamples + 1);
    for (int i = 0; i <= kSamples; ++i) at[i] = f(i / static_cast<double>(kSamples));
    for (int i = 0; i <= kSamples; ++i) {
      if (at[i] == kMissed || (i > 0 && at[i] > at[i - 1]) || (i < kSamples && at[i] > at[i + 1]))
        continue;
      // For exit points, f is -z, so the minimum of f is the largest z.
      const double z = -side * refine(f, i, kSamples);
      if (z > 0) best = std::min(best, z);
    }
  }
  return best;
}

/// Returns the smallest t > 0 at which a ray hits a ribbon, found by sign changes between dense
/// samples of the curve parameter u.
double brute_ribbon(const Exact& s, const V3& o, const V3& d) {
  const auto beside = [&](double u) { return dot(cross(sub(s.point(u), o), s.across(u)), d); };
  const auto meet = [&](double u) {
    const V3 c = sub(s.point(u), o), b = s.across(u);
    const V3 flat = along(b, d, -dot(b, d));
    const double side = -dot(c, flat) / dot(flat, flat);
    return std::abs(side) <= s.radius(u) ? dot(c, d) + side * dot(b, d) : kMissed;
  };
  double best = kMissed, before = 0;
  for (int i = 0; i <= kSamples; ++i) {
    const double u = i / static_cast<double>(kSamples), here = beside(u);
    if (i > 0 && (here < 0) != (before < 0)) {
      double a = (i - 1) / static_cast<double>(kSamples), b = u;
      for (int step = 0; step < 50; ++step) {
        const double m = 0.5 * (a + b);
        ((beside(m) < 0) == (before < 0) ? a : b) = m;
      }
      const double t = meet(a);
      if (t > 0) best = std::min(best, t);
    }
    before = here;
  }
  return best;
}

double brute_sphere(const Mesh& mesh, uint32_t prim, const V3& o, const V3& d) {
  const V3 c = sub(
      {mesh.positions[3 * prim], mesh.positions[3 * prim + 1], mesh.positions[3 * prim + 2]}, o);
  const double z = dot(c, d), r = mesh.radii[prim], h = r * r - (dot(c, c) - z * z);
  if (h < 0) return kMissed;
  if (z - std::sqrt(h) > 0) return z - std::sqrt(h);
  return z + std::sqrt(h) > 0 ? z + std::sqrt(h) : kMissed;
}

TEST(Curves, HitsEqualBruteForceInDoublePrecision) {
  const DenormalsOff denormals_off;
  std::mt19937 rng(5);
  std::uniform_real_distribution<double> uniform(-1, 1);
  for (const Primitive primitive : curved_primitives())
    for (const float radius : {0.01f, 0.1f}) {
      SceneBuilder b;
      // Tests curves of one segment each, whose hits do not depend on a neighbouring segment.
      const uint32_t mesh_id = b.add_mesh(make_curves(strands(primitive, 30, 1, 1.f, radius, 3)));
      b.add_to_group(0, mesh_id);
      const auto scene = b.build();
      const Mesh& mesh = scene->meshes()[0];
      size_t hits = 0, differing = 0;
      const uint32_t rays = size_for_build(1500);
      for (uint32_t i = 0; i < rays; ++i) {
        const auto prim = static_cast<uint32_t>(rng() % mesh.primitive_count());
        const Exact exact{mesh, prim};
        const double u = 0.5 + 0.5 * uniform(rng);
        const bool is_sphere = primitive == Primitive::kSphere;
        V3 to = is_sphere ? V3{mesh.positions[3 * prim], mesh.positions[3 * prim + 1],
                               mesh.positions[3 * prim + 2]}
                          : exact.point(u);
        V3 o = i % 5 == 0 ? to : V3{0, 0, 0};
        for (int c = 0; c < 3; ++c) {
          to[c] += 1.2 * radius * uniform(rng);
          o[c] += (i % 5 == 0 ? 0.3 * radius : 2) * uniform(rng);
        }
        const V3 aim = unit(sub(to, o));
        float fo[3], fd[3];
        for (int c = 0; c < 3; ++c) {
          fo[c] = o[c] = static_cast<float>(o[c]);
          fd[c] = static_cast<float>(1.7 * aim[c]);
        }
        const V3 d{fd[0], fd[1], fd[2]};
        const double length = std::sqrt(dot(d, d));
        const double want = (is_sphere          ? brute_sphere(mesh, prim, o, unit(d))
                             : mesh.is_ribbon() ? brute_ribbon(exact, o, unit(d))
                                                : brute_tube(exact, o, unit(d))) /
                            length;
        const CurveHits found =
            intersect_curve(mesh, {prim}, CurveRay(fo, fd), kInf, CurveQuery::kFirst);
        const bool hit = found.begin() != found.end();
        hits += hit;
        if (hit != (want < 1e20)) {
          ++differing;
          continue;
        }
        if (!hit) continue;
        if (std::abs(found.begin()->t - want) > 2e-6 * (want + 1e-2)) {
          ++differing;
          continue;
        }
        // Compare the shading point and its normal with the exact hit.
        const Vec3<float> dir{fd[0], fd[1], fd[2]};
        const Surface<float> s =
            setup_surface<float>(scene->view(), {0, 0, prim, found.begin()->u, found.begin()->v},
                                 dir * (1.f / static_cast<float>(length)), true, true, true);
        const V3 p = along(o, d, want);
        const double off = 4e-7 + s.offset + 2e-6 * (want + 1e-2) * length;  // tolerance of t
        for (int c = 0; c < 3; ++c) EXPECT_NEAR(widen(s.p)[c], p[c], off);
        EXPECT_NEAR(dot(widen(s.ng), widen(s.ng)), 1, 1e-5);
        if (is_sphere) {
          const V3 n = unit(sub(p, {mesh.positions[3 * prim], mesh.positions[3 * prim + 1],
                                    mesh.positions[3 * prim + 2]}));
          EXPECT_GT(dot(n, widen(s.ng)), 1 - 1e-5);
        } else if (mesh.is_ribbon()) {
          const float hu = found.begin()->u;
          EXPECT_NEAR(dot(widen(s.ng), exact.across(hu)), 0, 1e-4);
        } else {
          // The normal of a tube points from its curve to the surface.
          const double hu = std::min(std::max(found.begin()->u, 0.f), 1.f);
          EXPECT_GT(dot(unit(sub(p, exact.point(hu))), widen(s.ng)), 1 - 1e-5);
        }
      }
      EXPECT_GT(hits, rays / 3);
      // For grazing rays, dense sampling and the solver may disagree about whether there is a hit.
      // Ribbons have many grazing rays, so their tolerance is larger.
      EXPECT_LE(differing, rays / (mesh.is_ribbon() ? 150 : 500))
          << static_cast<int>(primitive) << ", radius " << radius;
    }
}

/// Nearest hit of a single ray.
struct SingleRayHit {
  float t, u, v;
  uint32_t prim, geom, inst;
};
SingleRayHit trace_one(const EmbreeAccelerator& accel, const Vec3<float>& o, const Vec3<float>& d) {
  SingleRayHit h{};
  accel.intersect({&o.x, &o.y, &o.z, &d.x, &d.y, &d.z, nullptr, nullptr, 1},
                  {&h.t, &h.u, &h.v, &h.prim, &h.geom, &h.inst}, 1, false, {});
  return h;
}
Vec3<float> narrow(const V3& a) {
  return {static_cast<float>(a[0]), static_cast<float>(a[1]), static_cast<float>(a[2])};
}

TEST(Curves, RaysThatLeaveDoNotHitWhatTheyLeave) {
  const DenormalsOff denormals_off;
  std::mt19937 rng(6);
  std::uniform_real_distribution<double> uniform(-1, 1);
  const auto random = [&] { return V3{uniform(rng), uniform(rng), uniform(rng)}; };
  for (const float away : {0.f, 50.f})
    for (const Primitive primitive : {Primitive::kLinearTube, Primitive::kSphere}) {
      // Linear tubes and spheres are convex. A ray that leaves the shape at any angle must not hit
      // it again, and a ray that enters the shape must hit it.
      SceneBuilder b;
      const uint32_t group = b.add_group("one");
      CurveData data;
      data.primitive = primitive;
      data.point({0, 0, 0}, 0.2f);
      if (primitive == Primitive::kLinearTube) {
        data.point({0.7f, 0.2f, -0.4f}, 0.1f);
        data.segments = {0};
      }
      b.add_to_group(group, b.add_mesh(make_curves(data)));
      b.add_instance(0, group, translate(away, -away, away) * rotate(0, 30) * scale(1, 0.5f, 2));
      const auto scene = b.build();
      const EmbreeAccelerator accel(scene, 1);
      size_t hits = 0;
      for (uint32_t i = 0; i < size_for_build(20000); ++i) {
        const V3 from = along({away, -away, away}, random(), 3);
        const V3 to = along({away + 0.2, -away, away}, random(), 0.6);
        const V3 apart = sub(from, {away, -away, away});
        if (dot(apart, apart) < 2.25) continue;
        const V3 d = unit(sub(to, from));
        const SingleRayHit h = trace_one(accel, narrow(from), narrow(d));
        if (h.inst == kNoHit) continue;
        ++hits;
        const Surface<float> s = setup_surface<float>(scene->view(), {h.inst, 0, h.prim, h.u, h.v},
                                                      narrow(d), false, true, true);
        const V3 n = widen(s.ng);
        EXPECT_LT(dot(d, n), 1e-3);
        const double flat = std::pow(10.0, -6 * std::abs(uniform(rng)));
        const V3 side = unit(cross(n, random()));
        const Vec3<float> out = narrow(unit(along(side, n, flat)));
        EXPECT_EQ(trace_one(accel, spawn_origin<float>(s, out), out).inst, kNoHit) << flat;
        const Vec3<float> in = narrow(unit(along(side, n, -std::max(flat, 0.05))));
        const SingleRayHit back = trace_one(accel, spawn_origin<float>(s, in), in);
        EXPECT_EQ(back.inst, 1u) << "no way out";
      }
      EXPECT_GT(hits, size_for_build(20000) / 10);
    }
}

TEST(Curves, TubesHaveNoSeams) {
  const DenormalsOff denormals_off;
  // Four curve segments form a closed ring. Rays from inside the tube must reach the outer surface
  // without a hit inside, and rays from outside must not pass through the seams between segments.
  SceneBuilder b;
  CurveData ring;
  constexpr float k = 0.5522848f, r = 0.2f;
  const Vec3<float> corner[4] = {{1, 0, 0}, {0, 1, 0}, {-1, 0, 0}, {0, -1, 0}};
  const auto control = [&](int q, float f) {
    const Vec3<float> p = corner[(q + 4) % 4], n = corner[(q + 5) % 4];
    return p + n * f;
  };
  ring.point(control(-1, 0) * k + corner[0], r);  // before the first
  for (int q = 0; q < 4; ++q) {
    ring.point(corner[q], r);
    ring.point(control(q, k), r);
    ring.point(corner[(q + 1) % 4] + corner[q] * k, r);
  }
  ring.point(corner[0], r);
  ring.point(control(0, k), r);
  for (uint32_t q = 0; q < 4; ++q)
    ring.segments.push_back((1 + 3 * q) | kCurveContinuesBefore | kCurveContinuesAfter);
  b.add_to_group(0, b.add_mesh(make_curves(ring)));
  const auto scene = b.build();
  const EmbreeAccelerator accel(scene, 1);
  std::mt19937 rng(8);
  std::uniform_real_distribution<double> uniform(-1, 1);
  for (uint32_t i = 0; i < size_for_build(20000); ++i) {
    const double phi = kPiD * uniform(rng), a = kPiD * uniform(rng);
    const V3 middle{std::cos(phi), std::sin(phi), 0};
    const V3 d = unit({uniform(rng), uniform(rng), uniform(rng)});
    // The ring deviates from a torus with the same radii by at most 1e-3.
    const SingleRayHit h = trace_one(accel, narrow(middle), narrow(d));
    ASSERT_EQ(h.inst, 0u) << "a hole";
    const V3 p = along(middle, d, h.t);
    const double tube = std::hypot(std::hypot(p[0], p[1]) - 1, p[2]);
    EXPECT_NEAR(tube, r, 1e-3) << "a wall inside";
    const V3 seam = widen(corner[i % 4]),
             at{seam[0] * (1 + r * std::cos(a)), seam[1] * (1 + r * std::cos(a)), r * std::sin(a)};
    const V3 out = along(at, unit(sub(at, seam)), 0.5);
    const SingleRayHit seen = trace_one(accel, narrow(out), narrow(unit(sub(at, out))));
    ASSERT_EQ(seen.inst, 0u);
    EXPECT_NEAR(seen.t, 0.5, 1e-3) << "a gap at a seam";
  }
}

TEST(Curves, LanesAgreeWhateverTheirNeighboursAre) {
  const DenormalsOff denormals_off;
  const auto scene = hairy();
  const SceneView view = scene->view();
  constexpr size_t kCount = 1024, kFloats = 16;
  std::vector<uint32_t> inst(kCount), mesh(kCount), prim(kCount);
  std::vector<float> u(kCount), v(kCount);
  std::mt19937 rng(8);
  std::uniform_real_distribution<float> uniform(0, 1);
  for (size_t i = 0; i < kCount; ++i) {
    inst[i] = static_cast<uint32_t>(rng() % (scene->instances().size() + 1));
    const Group& group = scene->groups()[inst[i] == 0 ? 0 : scene->instances()[inst[i] - 1].group];
    mesh[i] = group.meshes[rng() % group.meshes.size()];
    const Mesh& of = scene->meshes()[mesh[i]];
    prim[i] = static_cast<uint32_t>(rng() % of.primitive_count());
    u[i] = of.is_curved() ? 2.f * uniform(rng) - 0.5f : 0.5f * uniform(rng);
    v[i] = 0.5f * uniform(rng);
  }
  const auto run = [&]<typename F>() {
    std::vector<std::vector<float>> out(kFloats, std::vector<float>(kCount));
    for (size_t i = 0; i < kCount; i += kWidth<F>) {
      const Vec3<F> dir{F(0.48f), F(-0.6f), F(0.64f)};
      const Surface<F> s =
          setup_surface<F>(view,
                           {load<UInt<F>>(&inst[i]), load<UInt<F>>(&mesh[i]),
                            load<UInt<F>>(&prim[i]), load<F>(&u[i]), load<F>(&v[i])},
                           dir, true, true, Mask<F>(true));
      const F all[kFloats] = {s.p.x,    s.p.y,    s.p.z,    s.ng.x,         s.ng.y, s.ng.z,
                              s.ns.x,   s.ns.y,   s.ns.z,   s.uv.x,         s.uv.y, s.offset,
                              s.dpdu.x, s.dpdu.y, s.dpdu.z, s.uv_per_length};
      for (size_t c = 0; c < kFloats; ++c) store(out[c].data() + i, all[c]);
    }
    return out;
  };
  const auto scalar = run.operator()<float>();
  lane_testing::for_each_packet([&]<typename F>() {
    const auto packets = run.template operator()<F>();
    for (size_t c = 0; c < kFloats; ++c)
      lane_testing::expect_same(scalar[c], packets[c], "surface of curves");
  });
}

TEST(Curves, BadArraysAreRefusedByName) {
  const auto refused = [](const std::function<void(CurveData&)>& spoil, const char* words) {
    CurveData data = strands(Primitive::kCubicRibbon, 2, 2, 1, 0.1f, 1);
    spoil(data);
    SceneBuilder b;
    try {
      b.add_mesh(make_curves(data, kInheritMaterial, "/World/bad"));
      FAIL() << "not refused: " << words;
    } catch (const Error& error) {
      EXPECT_NE(std::string(error.what()).find("/World/bad"), std::string::npos);
      EXPECT_NE(std::string(error.what()).find(words), std::string::npos) << error.what();
    }
  };
  refused([](CurveData& d) { d.radii.pop_back(); }, "radii");
  refused([](CurveData& d) { d.radii[1] = -1; }, "negative");
  refused([](CurveData& d) { d.radii[1] = kNan; }, "negative or not finite");
  refused([](CurveData& d) { d.positions[4] = kNan; }, "not finite");
  refused([](CurveData& d) { d.normals.pop_back(); }, "normal");
  refused([](CurveData& d) { d.uvs = {1, 2}; }, "texture coordinates");
  refused([](CurveData& d) { d.materials = {0}; }, "materials");
  refused([](CurveData& d) { d.segments.push_back(11); }, "control point 11");
  refused([](CurveData& d) { d.segments.push_back(0 | kCurveContinuesBefore); }, "control point 0");
  refused([](CurveData& d) { d.segments.push_back(10 | kCurveContinuesAfter); },
          "control point 10");
}

TEST(Curves, MemoryAndNumbersAreCounted) {
  SceneBuilder b;
  const CurveData data = strands(Primitive::kCubicTube, 5, 3, 1, 0.1f, 1);
  const CurveData dots = strands(Primitive::kSphere, 4, 2, 1, 0.1f, 2);
  b.add_to_group(0, b.add_mesh(make_curves(data)));
  b.add_to_group(0, b.add_mesh(make_curves(dots)));
  const auto scene = b.build();
  EXPECT_EQ(scene->curve_segments(), 15u);
  EXPECT_EQ(scene->points(), dots.radii.size());
  EXPECT_EQ(scene->unique_triangles(), 0u);
  EXPECT_EQ(scene->bytes().meshes, 16 * (data.radii.size() + dots.radii.size()) + 4 * 15);
  EXPECT_GT(EmbreeAccelerator(scene, 1).bytes(), 15u * 32);
}

}  // namespace
}  // namespace wavecomb
