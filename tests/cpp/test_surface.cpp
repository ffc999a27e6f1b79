// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/geometry/hit/surface.h"

#include <numeric>

#include "lane_testing.h"
#include "scene_testing.h"
#include "wavecomb/accel/embree_accelerator.h"
#include "wavecomb/core/denormals.h"

namespace wavecomb {
namespace {

using lane_testing::for_each_lane_type;
using lane_testing::for_each_packet;
using namespace scene_testing;

using V3 = std::array<double, 3>;
V3 operator+(const V3& a, const V3& b) {
  return {a[0] + b[0], a[1] + b[1], a[2] + b[2]};
}
V3 operator-(const V3& a, const V3& b) {
  return {a[0] - b[0], a[1] - b[1], a[2] - b[2]};
}
V3 operator*(double s, const V3& a) {
  return {s * a[0], s * a[1], s * a[2]};
}
double dot3(const V3& a, const V3& b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}
V3 cross3(const V3& a, const V3& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}
V3 unit(const V3& a) {
  return 1 / std::sqrt(dot3(a, a)) * a;
}
V3 wide(const Vec3<float>& v) {
  return {v.x, v.y, v.z};
}
Vec3<float> narrow(const V3& v) {
  return {static_cast<float>(v[0]), static_cast<float>(v[1]), static_cast<float>(v[2])};
}
V3 map_vector(const Affine& m, const V3& v) {
  return {dot3(wide(m.row[0]), v), dot3(wide(m.row[1]), v), dot3(wide(m.row[2]), v)};
}
V3 map_point(const Affine& m, const V3& p) {
  return map_vector(m, p) + wide(m.t);
}
/// Transforms n by the cofactor matrix and the sign of the determinant.
V3 map_normal(const Affine& m, const V3& n) {
  const V3 r0 = wide(m.row[0]), r1 = wide(m.row[1]), r2 = wide(m.row[2]);
  const double sign = dot3(r0, cross3(r1, r2)) < 0 ? -1 : 1;
  return sign * V3{dot3(cross3(r1, r2), n), dot3(cross3(r2, r0), n), dot3(cross3(r0, r1), n)};
}

std::vector<Affine> all_transforms() {
  return {Affine{},
          translate(1, -2, 3) * rotate(1, 40),
          translate(-1.5f, 0, 0) * scale(-1, 1, 1),
          translate(0, -150, 50) * rotate(0, 70) * scale(2, 0.03f, 10),
          rotate(2, 25) * scale(0.5f, -1.5f, -3),
          Affine{{{1, 0.7f, 0}, {0, 1, -0.4f}, {0.2f, 0, 0.8f}}, {1, -1, 1}},
          translate(3e4f, 1e4f, -2e4f) * scale(-0.3f, -0.3f, -0.3f)};
}

/// Random triangles with random normals and texture coordinates, per vertex or per corner.
MeshData attributed_soup(Attribute normals_at, Attribute uvs_at, uint32_t seed) {
  MeshData m = soup(40, seed);
  std::mt19937 rng(seed + 100);
  std::uniform_real_distribution<float> uniform(-1, 1);
  if (normals_at != Attribute::kNone) {
    // Makes vertex normals around the face's normal, of various lengths.
    for (size_t f = 0; f < 40; ++f) {
      const auto p = [&](size_t k) {
        const float* q = &m.positions[9 * f + 3 * k];
        return V3{q[0], q[1], q[2]};
      };
      const V3 n = unit(cross3(p(1) - p(0), p(2) - p(0)));
      for (size_t k = 0; k < 3; ++k)
        for (size_t c = 0; c < 3; ++c)
          m.normals.push_back(static_cast<float>(1.5 * n[c]) + 0.4f * uniform(rng));
    }
    m.normals_at = normals_at;
  }
  if (uvs_at != Attribute::kNone) {
    for (int i = 0; i < 240; ++i) m.uvs.push_back(3 * uniform(rng));
    m.uvs_at = uvs_at;
  }
  return m;
}

TEST(Surface, EqualsDoublePrecision) {
  std::mt19937 rng(5);
  std::uniform_real_distribution<float> uniform(0, 1);
  for (const Attribute normals_at : {Attribute::kNone, Attribute::kVertex, Attribute::kCorner})
    for (const Attribute uvs_at : {Attribute::kNone, Attribute::kVertex, Attribute::kCorner})
      for (const Affine& m : all_transforms()) {
        SceneBuilder b;
        const uint32_t group = b.add_group("group");
        b.add_to_group(group, b.add_mesh(make_mesh(attributed_soup(normals_at, uvs_at, 3))));
        b.add_instance(0, group, m);
        const auto scene = b.build();
        const Mesh& mesh = scene->meshes()[0];
        for (uint32_t f = 0; f < 40; ++f) {
          float b1 = uniform(rng), b2 = uniform(rng);
          if (b1 + b2 > 1) {
            b1 = 1 - b1;
            b2 = 1 - b2;
          }
          const double w[3] = {1.0 - b1 - b2, b1, b2};
          V3 p{}, n{}, corner[3];
          double uv[3][2] = {{0, 0}, {1, 0}, {0, 1}};
          for (size_t k = 0; k < 3; ++k) {
            const float* q = &mesh.positions[3 * mesh.indices[3 * f + k]];
            corner[k] = map_point(m, {q[0], q[1], q[2]});
            p = p + w[k] * corner[k];
            if (normals_at != Attribute::kNone) {
              const float* a = &mesh.normals[3 * (3 * f + k)];
              n = n + w[k] * V3{a[0], a[1], a[2]};
            }
            if (uvs_at != Attribute::kNone)
              for (size_t c = 0; c < 2; ++c) uv[k][c] = mesh.uvs[2 * (3 * f + k) + c];
          }
          const V3 e1 = corner[1] - corner[0], e2 = corner[2] - corner[0];
          const V3 area = cross3(e1, e2);
          const double mirror = m.determinant() < 0 ? -1 : 1;
          const V3 ng = mirror * unit(area);
          V3 ns = normals_at == Attribute::kNone ? ng : unit(map_normal(m, n));
          if (dot3(ns, ng) < 0) ns = -1.0 * ns;
          const double d1[2] = {uv[1][0] - uv[0][0], uv[1][1] - uv[0][1]};
          const double d2[2] = {uv[2][0] - uv[0][0], uv[2][1] - uv[0][1]};
          const double det = d1[0] * d2[1] - d1[1] * d2[0];
          const V3 dpdu = 1 / det * (d2[1] * e1 - d1[1] * e2);

          const Vec3<float> dir = narrow(-1.0 * unit(ns + ng));
          const Surface<float> s =
              setup_surface<float>(scene->view(), {1, 0, f, b1, b2}, dir, true, true, true);
          const V3 off = wide(s.p) - p;
          EXPECT_LT(std::abs(dot3(off, ng)), s.offset);
          EXPECT_LT(std::sqrt(dot3(off, off)), 2 * s.offset);
          const auto expect_near = [&](const Vec3<float>& got, const V3& want, double tolerance,
                                       const char* what) {
            const V3 d = wide(got) - want;
            EXPECT_LT(std::sqrt(dot3(d, d)), tolerance) << what << " of face " << f;
          };
          expect_near(s.ng, ng, 3e-5, "ng");
          expect_near(s.ns, ns, 3e-5, "ns");
          expect_near(narrow(unit(wide(s.dpdu))), unit(dpdu), 1e-3, "dpdu");
          for (size_t c = 0; c < 2; ++c) {
            const double want = w[0] * uv[0][c] + w[1] * uv[1][c] + w[2] * uv[2][c];
            EXPECT_NEAR(c == 0 ? s.uv.x : s.uv.y, want, 2e-6);
          }
          const double uv_per_length = std::sqrt(std::abs(det) / std::sqrt(dot3(area, area)));
          EXPECT_NEAR(s.uv_per_length / uv_per_length, 1, 1e-3);
        }
      }
}

TEST(Surface, NormalsOfMirroredInstancesLookOutwards) {
  for (const Affine& m : all_transforms()) {
    SceneBuilder b;
    const uint32_t group = b.add_group("group");
    b.add_to_group(group, b.add_mesh(make_mesh(sphere(6, true))));
    b.add_instance(0, group, m);
    const auto scene = b.build();
    for (uint32_t f = 0; f < scene->meshes()[0].triangle_count(); ++f) {
      const Surface<float> s = setup_surface<float>(scene->view(), {1, 0, f, 0.3f, 0.3f},
                                                    {0, 0, -1}, false, false, true);
      const V3 outwards = wide(s.p) - wide(m.t);
      EXPECT_GT(dot3(wide(s.ng), outwards), 0);
    }
  }
}

TEST(Surface, ShadingNormalsAreSeen) {
  // However the vertex normals are tilted, the shading normal always faces the viewer.
  SceneBuilder b;
  MeshData m = quad({0, 0, 0}, {1, 0, 0}, {0, 1, 0});
  m.normals = {0.99f, 0, 0.1f, -0.99f, 0, 0.1f, 0, 0.99f, 0.05f, 0, -1, 0.01f};
  m.normals_at = Attribute::kVertex;
  b.add_to_group(0, b.add_mesh(make_mesh(m)));
  const auto scene = b.build();
  std::mt19937 rng(1);
  std::uniform_real_distribution<float> uniform(-1, 1);
  for (int i = 0; i < 5000; ++i) {
    const V3 d = unit({uniform(rng), uniform(rng), 0.5 * uniform(rng)});
    const float b1 = 0.5f * std::abs(uniform(rng)), b2 = 0.5f * std::abs(uniform(rng));
    const Surface<float> s = setup_surface<float>(
        scene->view(), {0, 0, static_cast<uint32_t>(i % 2), b1, b2}, narrow(d), false, true, true);
    const double towards = dot3(d, wide(s.ng)) < 0 ? 1 : -1;
    EXPECT_GT(-dot3(d, wide(s.ns)) * towards, 0);
    EXPECT_NEAR(dot3(wide(s.ns), wide(s.ns)), 1, 1e-5);
  }
}

TEST(Surface, DegenerateTrianglesStayFinite) {
  SceneBuilder b;
  MeshData m;
  m.vertex(1, 2, 3);
  m.vertex(1, 2, 3);
  m.vertex(2, 2, 3);
  m.triangle(0, 1, 2);
  m.triangle(0, 0, 0);
  m.normals.assign(9, 0);
  m.normals_at = Attribute::kVertex;
  m.uvs.assign(6, 0.5f);
  m.uvs_at = Attribute::kVertex;
  b.add_to_group(0, b.add_mesh(make_mesh(m)));
  const auto scene = b.build();
  for (uint32_t f = 0; f < 2; ++f) {
    const Surface<float> s =
        setup_surface<float>(scene->view(), {0, 0, f, 0.2f, 0.3f}, {0, 0, 1}, true, true, true);
    for (const float x : {s.p.x, s.ng.x, s.ng.y, s.ng.z, s.ns.z, s.dpdu.x, s.uv.x, s.uv_per_length,
                          s.offset, s.terminator.y})
      EXPECT_TRUE(std::isfinite(x));
    EXPECT_EQ(s.ng.z, -1);
  }
}

// ---- spawned rays -------------------------------------------------------------------------------

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

/// Random unit vector on n's side with a cosine of about 10^-k.
V3 direction(const V3& n, std::mt19937& rng) {
  std::uniform_real_distribution<double> uniform(0, 1);
  const double cosine = std::pow(10.0, -4 * uniform(rng)), phi = 2 * kPiD * uniform(rng);
  const V3 s = unit(cross3(n, std::abs(n[0]) > 0.5 ? V3{0, 1, 0} : V3{1, 0, 0})), t = cross3(n, s);
  const double sine = std::sqrt(1 - cosine * cosine);
  return cosine * n + sine * std::cos(phi) * s + sine * std::sin(phi) * t;
}

struct SpawnCounts {
  size_t rays = 0, self_hits = 0, leaks = 0;
};
/// Traces rays to a closed convex mesh (geometry 0 of instance `inst`) from all around, and spawns
/// rays from the hits to both sides. With `pairs`, faces 2k and 2k + 1 are coplanar.
SpawnCounts spawn_around(const Scene& scene, const EmbreeAccelerator& accel, uint32_t inst,
                         const V3& centre, double size, bool pairs, size_t n, uint32_t seed) {
  const DenormalsOff denormals_off;
  std::mt19937 rng(seed);
  std::uniform_real_distribution<double> uniform(-1, 1);
  SpawnCounts counts;
  const uint32_t mesh = inst == 0 ? scene.groups()[0].meshes[0]
                                  : scene.groups()[scene.instances()[inst - 1].group].meshes[0];
  for (size_t i = 0; i < n; ++i) {
    const V3 around = unit({uniform(rng), uniform(rng), uniform(rng)});
    const V3 from = centre + 3 * size * around;
    const V3 at = centre + size * V3{uniform(rng), uniform(rng), uniform(rng)};
    const Vec3<float> d = narrow(unit(at - from));
    const SingleRayHit h = trace_one(accel, narrow(from), d);
    if (h.inst != inst) continue;
    const Surface<float> s =
        setup_surface<float>(scene.view(), {h.inst, mesh, h.prim, h.u, h.v}, d, false, true, true);
    // Within rounding errors of an edge of the body, either side is correct.
    const float edge = std::min({h.u, h.v, 1 - h.u - h.v});
    if (edge * size < 32.0 * static_cast<double>(s.offset)) continue;
    for (int k = 0; k < 4; ++k) {
      const V3 out = direction(wide(s.ng), rng);
      const Vec3<float> leave = narrow(out), enter = narrow(-1.0 * out);
      ++counts.rays;
      counts.self_hits += trace_one(accel, spawn_origin<float>(s, leave), leave).inst == inst;
      const SingleRayHit inside = trace_one(accel, spawn_origin<float>(s, enter), enter);
      if (inside.inst == kNoHit)
        ++counts.leaks;
      else if (inside.inst == inst &&
               (inside.prim == h.prim || (pairs && inside.prim / 2 == h.prim / 2)))
        ++counts.self_hits;
    }
  }
  return counts;
}

TEST(Surface, SpawnedRaysNeitherHitTheirOwnSurfaceNorLeak) {
  const size_t n = size_for_build(3000, 4);
  struct Case {
    const char* what;
    MeshData mesh;
    bool pairs;
    double extent;
  };
  const std::vector<Case> cases = {
      {"box", box({-1, -1, -1}, {1, 1, 1}), true, 1},
      {"thin box", box({-1, -0.001f, -1}, {1, 0.001f, 1}), true, 1},
      {"needle", box({-0.002f, -1, -0.002f}, {0.002f, 1, 0.002f}), true, 0.3},
      {"flat sphere", sphere(8, false), false, 1},
      {"smooth sphere", sphere(8, true), false, 1}};
  for (const Case& c : cases)
    for (const float s : {1e-3f, 1.f, 1e5f})
      for (const float shift : {0.f, 10.f, 1000.f})
        for (const bool instanced : {false, true}) {
          if (shift == 1000 && c.pairs && c.mesh.positions[1] != -1) continue;
          const Affine m = translate(shift * s, -0.7f * shift * s, 0.3f * shift * s) *
                           rotate(0, 33) * rotate(2, 21) * scale(s, s, s);
          SceneBuilder b;
          MeshData mesh = c.mesh;
          if (!instanced) {
            mesh.transform(m);
            const Affine turn = rotate(0, 33) * rotate(2, 21);
            for (size_t k = 0; k < mesh.normals.size(); k += 3) {
              const Vec3<float> normal =
                  turn.vector({mesh.normals[k], mesh.normals[k + 1], mesh.normals[k + 2]});
              mesh.normals[k] = normal.x;
              mesh.normals[k + 1] = normal.y;
              mesh.normals[k + 2] = normal.z;
            }
            b.add_to_group(0, b.add_mesh(make_mesh(mesh)));
          } else {
            const uint32_t group = b.add_group("group");
            b.add_to_group(group, b.add_mesh(make_mesh(mesh)));
            b.add_instance(0, group, m);
          }
          const auto scene = b.build();
          const EmbreeAccelerator accel(scene, 1);
          const SpawnCounts counts =
              spawn_around(*scene, accel, instanced ? 1 : 0, wide(m.t),
                           c.extent * static_cast<double>(s), c.pairs, n, 17);
          EXPECT_GT(counts.rays, n / 50) << c.what;
          EXPECT_EQ(counts.self_hits, 0u)
              << c.what << ", scale " << s << ", shift " << shift
              << (instanced ? ", instanced" : "") << ", of " << counts.rays;
          EXPECT_EQ(counts.leaks, 0u) << c.what << ", scale " << s << ", shift " << shift
                                      << (instanced ? ", instanced" : "") << ", of " << counts.rays;
        }
}

TEST(Surface, HugeGroundNextToSmallObjects) {
  const DenormalsOff denormals_off;
  SceneBuilder b;
  b.add_to_group(0, b.add_mesh(make_mesh(ground(1e4f))));
  const uint32_t group = b.add_group("box");
  b.add_to_group(group, b.add_mesh(make_mesh(box({-0.5f, 0.f, -0.5f}, {0.5f, 1.f, 0.5f}))));
  b.add_instance(0, group, translate(12, 0.25f, -7) * rotate(1, 30));
  const auto scene = b.build();
  const EmbreeAccelerator accel(scene, 1);
  std::mt19937 rng(3);
  std::uniform_real_distribution<double> uniform(-1, 1);
  const uint32_t ground_mesh = scene->groups()[0].meshes[0];
  size_t covered = 0;
  for (size_t i = 0; i < size_for_build(20000, 4); ++i) {
    // Tests near and far points of the ground, seen at all angles, also under the box.
    const double far = i % 2 ? 0.4 : 3000;
    const V3 at{12 + far * uniform(rng), 0, -7 + far * uniform(rng)};
    const V3 from =
        i % 2 ? at + V3{0, 0.2, 0} : at + V3{far * uniform(rng), 0.01 * far, far * uniform(rng)};
    const Vec3<float> d = narrow(unit(at - from));
    const SingleRayHit h = trace_one(accel, narrow(from), d);
    if (h.inst != 0) continue;
    const Surface<float> s = setup_surface<float>(scene->view(), {0, ground_mesh, h.prim, h.u, h.v},
                                                  d, false, true, true);
    EXPECT_LT(s.offset, 0.05f);
    EXPECT_LT(std::abs(s.p.y), s.offset);
    const V3 out = direction({0, 1, 0}, rng);
    const Vec3<float> leave = narrow(out);
    const SingleRayHit next = trace_one(accel, spawn_origin<float>(s, leave), leave);
    EXPECT_NE(next.inst, 0u) << "hit the ground again";
    // A ray straight up hits the underside of the box.
    const Vec3<float> up{0, 1, 0};
    const SingleRayHit above = trace_one(accel, spawn_origin<float>(s, up), up);
    if (i % 2 && std::hypot(s.p.x - 12, s.p.z + 7) < 0.45) {
      EXPECT_EQ(above.inst, 1u) << "light leaks under the box";
      ++covered;
    }
    const Vec3<float> down = narrow(-1.0 * out);
    EXPECT_EQ(trace_one(accel, spawn_origin<float>(s, down), down).inst, kNoHit);
  }
  EXPECT_GT(covered, 100u);
}

// ---- lanes --------------------------------------------------------------------------------------

constexpr size_t kFloats = 23;
template <typename F>
void store_surface(const Surface<F>& s, const Vec3<F>& o, std::vector<std::vector<float>>& to,
                   size_t i) {
  const F all[kFloats] = {
      s.p.x,    s.p.y,           s.p.z,          s.ng.x,         s.ng.y,         s.ng.z, s.ns.x,
      s.ns.y,   s.ns.z,          s.dpdu.x,       s.dpdu.y,       s.dpdu.z,       s.uv.x, s.uv.y,
      s.offset, s.uv_per_length, s.terminator.x, s.terminator.y, s.terminator.z, o.x,    o.y,
      o.z,      F(0.f)};
  for (size_t c = 0; c < kFloats; ++c) store(to[c].data() + i, all[c]);
}

TEST(Surface, LanesAgreeWhateverTheirNeighboursAre) {
  const DenormalsOff denormals_off;
  const auto scene = mixed();
  const SceneView view = scene->view();
  constexpr size_t kCount = 2048;
  std::vector<uint32_t> inst(kCount + 16), mesh(kCount + 16), prim(kCount + 16);
  std::vector<float> u(kCount + 16), v(kCount + 16), d[3];
  for (auto& c : d) c.resize(kCount + 16, 1.f);
  std::mt19937 rng(8);
  std::uniform_real_distribution<float> uniform(-1, 1);
  for (size_t i = 0; i < kCount; ++i) {
    inst[i] = static_cast<uint32_t>(rng() % (scene->instances().size() + 1));
    const Group& group = scene->groups()[inst[i] == 0 ? 0 : scene->instances()[inst[i] - 1].group];
    mesh[i] = group.meshes[rng() % group.meshes.size()];
    prim[i] = static_cast<uint32_t>(rng() % scene->meshes()[mesh[i]].triangle_count());
    u[i] = 0.5f * std::abs(uniform(rng));
    v[i] = 0.5f * std::abs(uniform(rng));
    const V3 dir = unit({uniform(rng), uniform(rng), uniform(rng)});
    for (size_t c = 0; c < 3; ++c) d[c][i] = static_cast<float>(dir[c]);
  }
  // `order` gives the record of each lane; lanes from `count` on are inactive and hold garbage.
  const auto run = [&]<typename F>(const std::vector<uint32_t>& order, size_t count, bool with_uv,
                                   bool with_terminator) {
    std::vector<std::vector<float>> out(kFloats, std::vector<float>(kCount + 16)), placed = out;
    for (size_t i = 0; i < count; i += kWidth<F>) {
      const Mask<F> active = first_lanes<F>(count - i);
      const UInt<F> at = load<UInt<F>>(order.data() + i);
      const auto id = [&](const std::vector<uint32_t>& x) {
        return gather<UInt<F>>(x.data(), at, Mask<UInt<F>>(active));
      };
      const auto real = [&](const std::vector<float>& x) {
        return gather<F>(x.data(), at, active);
      };
      const Vec3<F> dir{real(d[0]), real(d[1]), real(d[2])};
      const Surface<F> s = setup_surface<F>(view, {id(inst), id(mesh), id(prim), real(u), real(v)},
                                            dir, with_uv, with_terminator, active);
      store_surface<F>(s, spawn_origin<F>(s, dir), out, i);
    }
    for (size_t c = 0; c < kFloats; ++c)
      for (size_t i = 0; i < count; ++i) placed[c][order[i]] = out[c][i];
    return placed;
  };
  std::vector<uint32_t> random_order(kCount + 16, 0);
  std::iota(random_order.begin(), random_order.begin() + kCount, 0u);
  std::vector<uint32_t> by_instance = random_order, by_mesh = random_order;
  std::stable_sort(by_instance.begin(), by_instance.begin() + kCount,
                   [&](uint32_t a, uint32_t b) { return inst[a] < inst[b]; });
  std::stable_sort(by_mesh.begin(), by_mesh.begin() + kCount,
                   [&](uint32_t a, uint32_t b) { return mesh[a] < mesh[b]; });
  for (const bool with_uv : {false, true})
    for (const bool with_terminator : {false, true}) {
      const auto scalar = run.operator()<float>(random_order, kCount, with_uv, with_terminator);
      for_each_packet([&]<typename F>() {
        for (const auto* order : {&random_order, &by_instance, &by_mesh}) {
          const auto packets = run.template operator()<F>(*order, kCount, with_uv, with_terminator);
          for (size_t c = 0; c < kFloats; ++c)
            lane_testing::expect_same(scalar[c], packets[c], "surface");
        }
        const auto tail = run.template operator()<F>(random_order, 39, with_uv, with_terminator);
        for (size_t c = 0; c < kFloats; ++c)
          for (size_t i = 0; i < 39; ++i)
            ASSERT_TRUE(lane_testing::same_bits(scalar[c][i], tail[c][i])) << c << ", " << i;
      });
    }
}

TEST(Facing, BentNormalsAreSeenAndMirrorWhatIsAboveTheSurface) {
  for_each_lane_type([]<typename F>() {
    std::mt19937 rng(5);
    std::normal_distribution<float> normal;
    const auto direction = [&] {
      const Vec3<float> v(normal(rng), normal(rng), normal(rng));
      return normalize(v);
    };
    const auto all = [](const Vec3<float>& v) { return Vec3<F>(F(v.x), F(v.y), F(v.z)); };
    int lifted = 0;
    for (int i = 0; i < 4000; ++i) {
      const Vec3<float> ng = direction(), n = direction();
      Vec3<float> dir = direction();
      if (i % 2 == 0)  // at grazing angles
        dir = normalize(
            dir - ng * (dot(dir, ng) * (1 - std::pow(10.f, -0.001f * static_cast<float>(i)))));
      if (std::abs(dot(dir, ng)) < 1e-6f || dot(n, ng) < 0.05f) continue;
      const Vec3<F> facing = facing_normal<F>(all(dir), all(ng), all(n));
      const Vec3<F> adjusted = reflecting_normal<F>(all(dir), all(ng), facing);
      const V3 w = -1.0 * wide(dir),
               b{lane(adjusted.x, 0), lane(adjusted.y, 0), lane(adjusted.z, 0)};
      const double side = dot3(w, wide(ng)) > 0 ? 1 : -1, c = side * dot3(w, wide(ng));
      const V3 mirrored = 2 * dot3(w, b) * b - w;
      EXPECT_NEAR(dot3(b, b), 1, 1e-5);
      EXPECT_GT(side * dot3(w, b), 0) << i;
      EXPECT_GT(side * dot3(mirrored, wide(ng)), 0.8 * std::min(0.9 * c, 0.01) - 1e-6) << i;
      // Shading normals that reflect the viewing direction above the surface are unchanged.
      const V3 f{lane(facing.x, 0), lane(facing.y, 0), lane(facing.z, 0)};
      const V3 before = 2 * dot3(w, f) * f - w;
      if (side * dot3(before, wide(ng)) > 0.011) {
        EXPECT_EQ(b, f);
      } else {
        ++lifted;
      }
    }
    EXPECT_GT(lifted, 500);
  });
}

}  // namespace
}  // namespace wavecomb
