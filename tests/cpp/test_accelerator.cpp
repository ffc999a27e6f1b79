// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/accel/embree_accelerator.h"

#include <numeric>
#include <tuple>

#include "curve_testing.h"
#include "wavecomb/accel/presence.h"
#include "wavecomb/core/denormals.h"
#include "wavecomb/wave/stages/order_rays.h"

namespace wavecomb {
namespace {

using namespace scene_testing;

/// Rays in columns, padded for packets.
struct Rays {
  std::vector<float> ox, oy, oz, dx, dy, dz, tfar;
  std::vector<uint32_t> slot;
  size_t size = 0;

  explicit Rays(size_t n = 0) { resize(n); }
  void resize(size_t n) {
    size = n;
    for (auto* c : {&ox, &oy, &oz, &dx, &dy, &dz}) c->resize(n + 16, 0.f);
    tfar.resize(n + 16, kInf);
    slot.resize(n + 16, 0);
    std::iota(slot.begin(), slot.begin() + static_cast<long>(n), 0u);
  }
  void aim(size_t i, const std::array<double, 3>& o, const std::array<double, 3>& to) {
    const double d[3] = {to[0] - o[0], to[1] - o[1], to[2] - o[2]};
    const double l = std::sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]);
    float* const from[3] = {&ox[i], &oy[i], &oz[i]};
    float* const dir[3] = {&dx[i], &dy[i], &dz[i]};
    for (int c = 0; c < 3; ++c) {
      *from[c] = static_cast<float>(o[c]);
      *dir[c] = static_cast<float>(d[c] / l);
    }
  }
  /// Returns the rays in the given order, with the pool slot of each.
  Rays in_order(const std::vector<uint32_t>& order) const {
    Rays moved(size);
    const auto move = [&](const auto& from, auto& to) {
      for (size_t i = 0; i < size; ++i) to[i] = from[order[i]];
    };
    move(ox, moved.ox), move(oy, moved.oy), move(oz, moved.oz);
    move(dx, moved.dx), move(dy, moved.dy), move(dz, moved.dz);
    move(tfar, moved.tfar), move(slot, moved.slot);
    return moved;
  }
  RaySpan span(size_t begin, size_t n, bool limited) const {
    const auto b = static_cast<std::ptrdiff_t>(begin);
    return {ox.data() + b,
            oy.data() + b,
            oz.data() + b,
            dx.data() + b,
            dy.data() + b,
            dz.data() + b,
            limited ? tfar.data() + b : nullptr,
            slot.data() + b,
            n};
  }
};

struct Hits {
  std::vector<float> t, u, v;
  std::vector<uint32_t> prim, geom, inst;
  explicit Hits(size_t n)
      : t(n + 16), u(n + 16), v(n + 16), prim(n + 16), geom(n + 16), inst(n + 16) {}
  HitSpan span(size_t b) {
    return {t.data() + b,    u.data() + b,    v.data() + b,
            prim.data() + b, geom.data() + b, inst.data() + b};
  }
};

/// Presence keys for n slots.
struct Keys {
  std::vector<uint32_t> pixel_hash, sample;
  explicit Keys(size_t n) : pixel_hash(n + 16), sample(n + 16) {
    std::mt19937 rng(7);
    for (uint32_t& x : pixel_hash) x = rng();
    for (size_t i = 0; i < sample.size(); ++i) sample[i] = static_cast<uint32_t>(i % 17);
  }
  PresenceKeys keys(uint32_t salt = 0) const { return {pixel_hash.data(), sample.data(), 1, salt}; }
};

/// Traces all rays, with at most `chunk` rays per call of the accelerator.
Hits trace(const EmbreeAccelerator& accel, const Rays& rays, uint32_t width, bool coherent,
           const PresenceKeys& keys, bool limited = false, size_t chunk = 1u << 30) {
  Hits hits(rays.size);
  for (size_t b = 0; b < rays.size; b += chunk)
    accel.intersect(rays.span(b, std::min(chunk, rays.size - b), limited), hits.span(b), width,
                    coherent, keys);
  return hits;
}
std::vector<uint32_t> blocked(const EmbreeAccelerator& accel, const Rays& rays, uint32_t width,
                              bool coherent, const PresenceKeys& keys, size_t chunk = 1u << 30) {
  std::vector<uint32_t> out(rays.size + 16);
  for (size_t b = 0; b < rays.size; b += chunk)
    accel.occluded(rays.span(b, std::min(chunk, rays.size - b), true), out.data() + b, width,
                   coherent, keys);
  out.resize(rays.size);
  return out;
}

bool same_hit(const Hits& a, size_t i, const Hits& b, size_t j) {
  if (a.inst[i] == kNoHit || b.inst[j] == kNoHit) return a.inst[i] == b.inst[j];
  return std::memcmp(&a.t[i], &b.t[j], 4) == 0 && std::memcmp(&a.u[i], &b.u[j], 4) == 0 &&
         std::memcmp(&a.v[i], &b.v[j], 4) == 0 && a.prim[i] == b.prim[j] &&
         a.geom[i] == b.geom[j] && a.inst[i] == b.inst[j];
}
void expect_same_hits(const Hits& a, const Hits& b, size_t n, const std::string& what) {
  size_t differing = 0, first = 0;
  for (size_t i = n; i-- > 0;)
    if (!same_hit(a, i, b, i)) {
      ++differing;
      first = i;
    }
  EXPECT_EQ(differing, 0u) << what << ": first " << first << ", t " << a.t[first] << " and "
                           << b.t[first] << ", prim " << a.prim[first] << " and " << b.prim[first];
}

void expect_same_occlusion(const std::vector<uint32_t>& a, const std::vector<uint32_t>& b,
                           const std::string& what) {
  size_t differing = 0;
  for (size_t i = 0; i < a.size(); ++i) differing += a[i] != b[i];
  EXPECT_EQ(differing, 0u) << what << ", occlusion";
}

/// Expects bitwise equal hits and occlusion for every packet width, partial packets, coherent or
/// incoherent traversal, and order of rays.
void expect_hits_do_not_depend_on_packets(const EmbreeAccelerator& accel, const Rays& rays,
                                          bool coherent_too = true) {
  const DenormalsOff denormals_off;
  const Keys keys(rays.size);
  const Hits single = trace(accel, rays, 1, false, keys.keys());
  const std::vector<uint32_t> shadow = blocked(accel, rays, 1, false, keys.keys());
  const auto expect_same = [&](uint32_t width, bool coherent, size_t chunk) {
    const std::string name = "packets of " + std::to_string(width) +
                             (coherent ? ", coherent" : "") + ", calls of " + std::to_string(chunk);
    expect_same_hits(single, trace(accel, rays, width, coherent, keys.keys(), false, chunk),
                     rays.size, name);
    expect_same_occlusion(shadow, blocked(accel, rays, width, coherent, keys.keys(), chunk), name);
  };
  for (const bool coherent : {false, true}) {
    if (coherent && !coherent_too) continue;
    for (const uint32_t width : {1u, 4u, 8u, 16u}) expect_same(width, coherent, rays.size);
    // Test partial packets, with one inactive lane and with seven active lanes.
    for (const uint32_t width : {4u, 8u, 16u}) expect_same(width, coherent, width - 1);
    expect_same(16, coherent, 7);
  }

  std::vector<uint32_t> order(rays.size);
  std::iota(order.begin(), order.end(), 0u);
  std::shuffle(order.begin(), order.end(), std::mt19937(3));
  const Rays shuffled = rays.in_order(order);
  for (const bool coherent : {false, true}) {
    if (coherent && !coherent_too) continue;
    const Hits mixed = trace(accel, shuffled, 16, coherent, keys.keys());
    const std::vector<uint32_t> mixed_shadow = blocked(accel, shuffled, 16, coherent, keys.keys());
    size_t differing = 0, shadow_differing = 0;
    for (size_t i = 0; i < rays.size; ++i) {
      differing += !same_hit(single, order[i], mixed, i);
      shadow_differing += shadow[order[i]] != mixed_shadow[i];
    }
    EXPECT_EQ(differing, 0u) << "shuffled" << (coherent ? ", coherent" : "");
    EXPECT_EQ(shadow_differing, 0u) << "shuffled, occlusion" << (coherent ? ", coherent" : "");
  }
}

Rays random_rays(size_t n, float half, uint32_t seed) {
  Rays rays(n);
  std::mt19937 rng(seed);
  std::uniform_real_distribution<double> uniform(-half, half);
  for (size_t i = 0; i < n; ++i) {
    std::array<double, 3> a, b;
    for (double& x : a) x = uniform(rng);
    for (double& x : b) x = uniform(rng);
    rays.aim(i, a, b);
    rays.tfar[i] = std::abs(static_cast<float>(uniform(rng)));
  }
  return rays;
}

const std::vector<Affine>& transforms() {
  static const std::vector<Affine> all = {
      translate(1, 0.5f, -1) * rotate(1, 40),
      translate(-1.5f, 0, 0) * scale(-1, 1, 1),                            // mirrored
      translate(0, -1.5f, 0.5f) * rotate(0, 70) * scale(2, 0.3f, 1),       // stretched
      translate(0, 1.5f, 0) * rotate(2, 25) * scale(0.5f, -1.5f, -3),      // both
      Affine{{{1, 0.7f, 0}, {0, 1, -0.4f}, {0.2f, 0, 0.8f}}, {1, -1, 1}},  // sheared
      scale(-0.3f, -0.3f, -0.3f)};
  return all;
}
/// Makes random triangles in the world, and instances of a group of two further meshes of random
/// triangles.
std::shared_ptr<const Scene> soup_scene(uint32_t triangles) {
  SceneBuilder b;
  b.add_to_group(0, b.add_mesh(make_mesh(soup(triangles, 1))));
  b.add_to_group(0, b.add_mesh(make_mesh(soup(triangles / 2, 2, 0.2f))));
  const uint32_t group = b.add_group("group");
  b.add_to_group(group, b.add_mesh(make_mesh(soup(triangles, 3))));
  b.add_to_group(group, b.add_mesh(make_mesh(soup(triangles / 2, 4, 0.7f))));
  for (const Affine& m : transforms()) b.add_instance(0, group, m);
  return b.build();
}

struct ExactHit {
  /// Distance of the hit from the nearest edge of the triangle, in barycentric coordinates.
  double t, u, v, edge;
  uint32_t prim, geom, inst;
};

/// Finds all hits of a ray in double precision (Moeller and Trumbore), nearest first. Triangles are
/// enlarged by the distance `slack` in barycentric coordinates.
class BruteForce {
 public:
  explicit BruteForce(const Scene& scene) {
    const auto add = [&](uint32_t inst, const Affine& m, const Group& group) {
      uint32_t geom = 0;
      for (const uint32_t id : group.meshes) {
        const Mesh& mesh = scene.meshes()[id];
        for (uint32_t f = 0; f < mesh.triangle_count(); ++f) {
          Triangle t{{}, f, geom, inst};
          for (size_t k = 0; k < 3; ++k) {
            const float* p = &mesh.positions[3 * mesh.indices[3 * f + k]];
            for (int r = 0; r < 3; ++r) {
              const Vec3<float>& row = m.row[r];
              const double translation = r == 0 ? m.t.x : (r == 1 ? m.t.y : m.t.z);
              t.p[k][r] = static_cast<double>(row.x) * p[0] + static_cast<double>(row.y) * p[1] +
                          static_cast<double>(row.z) * p[2] + translation;
            }
          }
          triangles_.push_back(t);
        }
        ++geom;
      }
    };
    add(0, Affine{}, scene.groups()[0]);
    for (uint32_t i = 0; i < scene.instances().size(); ++i)
      add(i + 1, scene.instances()[i].to_world, scene.groups()[scene.instances()[i].group]);
  }

  std::vector<ExactHit> hits(const Rays& rays, size_t i, double slack) const {
    const double o[3] = {rays.ox[i], rays.oy[i], rays.oz[i]};
    const double d[3] = {rays.dx[i], rays.dy[i], rays.dz[i]};
    std::vector<ExactHit> all;
    for (const Triangle& t : triangles_) {
      double e1[3], e2[3], s[3], h[3], q[3];
      for (int c = 0; c < 3; ++c) {
        e1[c] = t.p[1][c] - t.p[0][c];
        e2[c] = t.p[2][c] - t.p[0][c];
        s[c] = o[c] - t.p[0][c];
      }
      cross(d, e2, h);
      const double det = dot(e1, h);
      if (det == 0) continue;
      const double u = dot(s, h) / det;
      if (u < -slack || u > 1 + slack) continue;
      cross(s, e1, q);
      const double v = dot(d, q) / det;
      if (v < -slack || u + v > 1 + slack) continue;
      const double distance = dot(e2, q) / det;
      if (distance <= 0) continue;
      all.push_back({distance, u, v, std::min({u, v, 1 - u - v}), t.prim, t.geom, t.inst});
    }
    std::sort(all.begin(), all.end(),
              [](const ExactHit& a, const ExactHit& b) { return a.t < b.t; });
    return all;
  }

 private:
  struct Triangle {
    double p[3][3];
    uint32_t prim, geom, inst;
  };
  static double dot(const double* a, const double* b) {
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
  }
  static void cross(const double* a, const double* b, double* c) {
    c[0] = a[1] * b[2] - a[2] * b[1];
    c[1] = a[2] * b[0] - a[0] * b[2];
    c[2] = a[0] * b[1] - a[1] * b[0];
  }
  std::vector<Triangle> triangles_;
};

/// Compares the hits of random rays with a brute-force search of `triangles` triangles, for a
/// triangle list or a BVH. At least 1 / `one_in` of the rays must hit a triangle.
void expect_brute_force(uint32_t triangles, HitRule rule, size_t one_in) {
  const auto scene = soup_scene(triangles);
  const EmbreeAccelerator accel(scene, 2, rule);
  const BruteForce exact(*scene);
  const size_t n = size_for_build(20000);
  const Rays rays = random_rays(n, 3, 11);
  const Hits hits = trace(accel, rays, 16, false, Keys(n).keys());
  size_t hit_count = 0, clear_count = 0;
  for (size_t i = 0; i < n; ++i) {
    // The reported hit is one of the exact hits, and no unambiguous hit lies before it.
    const std::vector<ExactHit> all = exact.hits(rays, i, 1e-4);
    const bool found = hits.inst[i] != kNoHit;
    hit_count += found;
    const ExactHit* match = nullptr;
    for (const ExactHit& h : all)
      if (found && h.prim == hits.prim[i] && h.geom == hits.geom[i] && h.inst == hits.inst[i])
        match = &h;
    if (found) {
      ASSERT_NE(match, nullptr) << "ray " << i;
      EXPECT_NEAR(hits.t[i], match->t, 2e-4) << "ray " << i;
      EXPECT_NEAR(hits.u[i], match->u, 1e-2) << "ray " << i;
      EXPECT_NEAR(hits.v[i], match->v, 1e-2) << "ray " << i;
    }
    for (const ExactHit& h : all) {
      if (h.edge < 1e-3 || (match && h.t > match->t - 1e-3) || h.t < 1e-4) continue;
      ADD_FAILURE() << "ray " << i << " missed a triangle at " << h.t;
    }
    clear_count += match && match->edge > 1e-3;
  }
  EXPECT_GT(hit_count, n / one_in);
  EXPECT_GT(clear_count, hit_count * 9 / 10);
}

TEST(Accelerator, HitsEqualBruteForceInDoublePrecision) {
  expect_brute_force(60, HitRule::kCanonical, 2);
}

/// Traces small scenes both with a triangle list and with a BVH.
class SmallScene : public testing::TestWithParam<HitRule> {};
INSTANTIATE_TEST_SUITE_P(Accelerator, SmallScene,
                         testing::Values(HitRule::kList, HitRule::kCanonical),
                         [](const auto& rule) {
                           return rule.param == HitRule::kList ? "List" : "Hierarchy";
                         });

TEST_P(SmallScene, IsTracedAsAsked) {
  const bool by_list = GetParam() == HitRule::kList;
  EXPECT_EQ(EmbreeAccelerator(soup_scene(4), 1, GetParam()).has_list(), by_list);
  EXPECT_EQ(EmbreeAccelerator(cornell(), 1, GetParam()).has_list(), by_list);
  EXPECT_FALSE(EmbreeAccelerator(soup_scene(60), 1, GetParam()).has_list());
  EXPECT_FALSE(EmbreeAccelerator(curve_testing::hairy(), 1, GetParam()).has_list());
}

// Rays that start exactly on a surface, as camera rays do if the near plane lies on a surface.
TEST_P(SmallScene, RaysThatStartOnASurfaceMeetItThere) {
  SceneBuilder b;
  b.add_to_group(0, b.add_mesh(make_mesh(quad({0, 0, 0}, {1, 0, 0}, {0, 1, 0}))));
  const EmbreeAccelerator accel(b.build(), 1, GetParam());
  Rays rays(40);
  for (size_t i = 0; i < rays.size; ++i) {
    const double x = 0.02 * static_cast<double>(i) + 0.1;
    rays.aim(i, {x, 0.4, 0}, {x + 0.1, 0.3, i % 2 == 0 ? -1.0 : 1.0});
  }
  const Keys keys(rays.size);
  for (const uint32_t width : {1u, 4u, 8u, 16u}) {
    const Hits hits = trace(accel, rays, width, false, keys.keys());
    const auto shadow = blocked(accel, rays, width, false, keys.keys());
    for (size_t i = 0; i < rays.size; ++i) {
      EXPECT_NE(hits.inst[i], kNoHit) << i;
      EXPECT_EQ(hits.t[i], 0.f) << i;
      EXPECT_EQ(shadow[i], 1u) << i;
    }
  }
}

TEST_P(SmallScene, HitsEqualBruteForceInDoublePrecision) {
  expect_brute_force(4, GetParam(), 10);
}

TEST_P(SmallScene, HitsDoNotDependOnPackets) {
  const EmbreeAccelerator accel(soup_scene(4), 1, GetParam());
  expect_hits_do_not_depend_on_packets(accel, random_rays(size_for_build(30000), 3, 5));
}

TEST(Accelerator, HitsDoNotDependOnPackets) {
  const auto scene = soup_scene(3000);
  const EmbreeAccelerator accel(scene, 2);
  expect_hits_do_not_depend_on_packets(accel, random_rays(size_for_build(30000), 3, 5));
}

TEST(Accelerator, CurvesAndPointsDoNotDependOnPackets) {
  const EmbreeAccelerator accel(curve_testing::hairy(), 1);
  expect_hits_do_not_depend_on_packets(accel, random_rays(size_for_build(30000), 2, 41));
}

TEST(Accelerator, CameraRaysDoNotDependOnPackets) {
  // Bundles of rays from one point or from a lens, traced with the coherent flag. Rays from a lens
  // pass close to edges of the Cornell box, where coherent packets may find different hits than
  // single rays.
  for (const auto& scene : {mixed(), cornell(), emissive_meshes()}) {
    const EmbreeAccelerator accel(scene, 2);
    for (const double radius : {0.0, 0.05, 0.5}) {
      SCOPED_TRACE(testing::Message() << "lens radius " << radius);
      const size_t side = size_for_build(160, 4);
      Rays rays(side * side);
      std::mt19937 rng(6);
      std::uniform_real_distribution<double> uniform(-radius, radius);
      for (size_t i = 0; i < rays.size; ++i) {
        const double x = static_cast<double>(i % side) / static_cast<double>(side) - 0.5;
        const double y = static_cast<double>(i / side) / static_cast<double>(side) - 0.5;
        rays.aim(i, {0.1 + uniform(rng), 0.6 + uniform(rng), 5}, {4 * x, 4 * y + 0.2, 0});
      }
      expect_hits_do_not_depend_on_packets(accel, rays, radius == 0);
    }
  }
}

/// Origin of the rays of a bundle.
enum class From { kAnywhere, kPoint, kLens };

/// Makes rays to vertices, edge midpoints and other edge points of a mesh, with origins anywhere,
/// at one point or on a lens.
Rays rays_at_edges(const Mesh& mesh, const Affine& m, size_t n, uint32_t seed, From where) {
  Rays rays(n);
  std::mt19937 rng(seed);
  std::uniform_real_distribution<double> uniform(0, 1);
  for (size_t i = 0; i < n; ++i) {
    const size_t f = rng() % mesh.triangle_count(), k = rng() % 3;
    const auto point = [&](size_t corner) {
      const float* p = &mesh.positions[3 * mesh.indices[3 * f + corner % 3]];
      const Vec3<float> w = m.point({p[0], p[1], p[2]});
      return std::array<double, 3>{w.x, w.y, w.z};
    };
    const auto a = point(k), b = point(k + 1);
    constexpr double kWhere[4] = {0, 0.5, 0.25, -1};
    double s = kWhere[i % 4];
    if (s < 0) s = uniform(rng);
    std::array<double, 3> to, from;
    for (size_t c = 0; c < 3; ++c) {
      to[c] = a[c] + s * (b[c] - a[c]);
      from[c] = to[c] + 10 * (uniform(rng) - 0.5);
    }
    if (i % 3 == 0) from = {to[0], to[1] + 4, to[2]};  // straight down
    from[1] = std::max(from[1], 2.0);
    if (where == From::kPoint) from = {0.5, 12, 0.25};
    if (where == From::kLens) from = {0.4 + 0.2 * uniform(rng), 12, 0.15 + 0.2 * uniform(rng)};
    rays.aim(i, from, to);
  }
  return rays;
}

/// Expects that coherent packets find nearly the same hits as single rays. The rays are chosen so
/// that differences are likely.
void expect_coherent_differs_seldom(const EmbreeAccelerator& accel, const Rays& rays) {
  const DenormalsOff denormals_off;
  const Keys keys(rays.size);
  const Hits a = trace(accel, rays, 1, false, keys.keys());
  const auto shadow = blocked(accel, rays, 1, false, keys.keys());
  for (const uint32_t width : {4u, 8u, 16u}) {
    const Hits b = trace(accel, rays, width, true, keys.keys());
    const auto coherent_shadow = blocked(accel, rays, width, true, keys.keys());
    size_t differing = 0, shadow_differing = 0;
    for (size_t i = 0; i < rays.size; ++i) {
      differing += !same_hit(a, i, b, i);
      shadow_differing += shadow[i] != coherent_shadow[i];
    }
    EXPECT_LT(differing, rays.size / 20) << width;
    EXPECT_LT(shadow_differing, rays.size / 100) << width;
  }
}

TEST(Accelerator, RaysAtSharedEdgesAndVerticesDoNotDependOnPackets) {
  for (const float bump : {0.f, 0.4f}) {
    for (const bool instanced : {false, true}) {
      SceneBuilder b;
      const Mesh mesh = make_mesh(grid(16, bump, 9));
      const Affine m =
          instanced ? rotate(1, 33) * scale(-1.3f, 0.8f, 0.7f) * translate(-8, 0, -8) : Affine{};
      const uint32_t id = b.add_mesh(mesh);
      if (instanced) {
        const uint32_t group = b.add_group("grid");
        b.add_to_group(group, id);
        b.add_instance(0, group, m);
      } else {
        b.add_to_group(0, id);
      }
      const EmbreeAccelerator accel(b.build(), 2);
      SCOPED_TRACE(testing::Message() << "bump " << bump << (instanced ? ", instanced" : ""));
      const Rays rays = rays_at_edges(mesh, m, size_for_build(50000), 21, From::kAnywhere);
      expect_hits_do_not_depend_on_packets(accel, rays, false);
      // Embree's coherent traversal tests boxes against a whole packet, and so finds triangles that
      // a single ray misses by a rounding error. Coherent traversal is meant for rays from one
      // point.
      expect_coherent_differs_seldom(accel, rays);
      expect_hits_do_not_depend_on_packets(
          accel, rays_at_edges(mesh, m, size_for_build(50000), 22, From::kPoint));
      const Rays lens = rays_at_edges(mesh, m, size_for_build(50000), 23, From::kLens);
      expect_hits_do_not_depend_on_packets(accel, lens, false);
      expect_coherent_differs_seldom(accel, lens);
      if (bump > 0) continue;
      // No ray passes through the grid except at its border, since the grid has no holes.
      const Hits hits = trace(accel, rays, 16, false, Keys(rays.size).keys());
      size_t missed = 0;
      for (size_t i = 0; i < rays.size; ++i) missed += hits.inst[i] == kNoHit;
      EXPECT_LT(missed, rays.size / 12);
    }
  }
}

TEST(Accelerator, ClosedMeshesHaveNoHoles) {
  SceneBuilder b;
  const Mesh mesh = make_mesh(sphere(12, false));
  b.add_to_group(0, b.add_mesh(mesh));
  const EmbreeAccelerator accel(b.build(), 1);
  const size_t n = size_for_build(50000);
  Rays rays(n);
  std::mt19937 rng(2);
  std::uniform_real_distribution<double> uniform(-0.5, 0.5);
  for (size_t i = 0; i < n; ++i) {
    const float* p = &mesh.positions[3 * mesh.indices[rng() % mesh.indices.size()]];
    rays.aim(i, {uniform(rng), uniform(rng), uniform(rng)}, {p[0], p[1], p[2]});
  }
  for (const uint32_t width : {1u, 4u, 8u, 16u}) {
    const Hits hits = trace(accel, rays, width, false, Keys(n).keys());
    size_t missed = 0;
    for (size_t i = 0; i < n; ++i) missed += hits.inst[i] == kNoHit;
    // Rays aim exactly at vertices, where robust traversal misses about one in ten thousand.
    EXPECT_LE(missed, n / 10000 + 1) << width;
    const auto shadow = blocked(accel, rays, width, false, Keys(n).keys());
    EXPECT_GE(std::count(shadow.begin(), shadow.end(), 1u) + static_cast<long>(n / 10000 + 1),
              static_cast<long>(n))
        << width;
  }
}

/// Makes a closed tube of `n` sides whose axis is not parallel to a coordinate axis.
std::shared_ptr<const Scene> turned_tube(uint32_t n, float half_length) {
  MeshData m;
  const Affine turn = rotate(0, 37) * rotate(1, 23) * rotate(2, 51);
  const auto vertex = [&](float x, float y, float z) {
    const Vec3<float> p = turn.point({x, y, z});
    m.vertex(p.x, p.y, p.z);
  };
  for (uint32_t i = 0; i < n; ++i)
    for (const float side : {-half_length, half_length}) {
      const double angle = 2 * M_PI * i / n;
      vertex(side, static_cast<float>(std::cos(angle)), static_cast<float>(std::sin(angle)));
    }
  vertex(-half_length, 0, 0);
  vertex(half_length, 0, 0);
  for (uint32_t i = 0; i < n; ++i) {
    const uint32_t a = 2 * i, b = 2 * ((i + 1) % n), end = 2 * n;
    m.triangle(a, a + 1, b);
    m.triangle(b, a + 1, b + 1);
    m.triangle(a, b, end);
    m.triangle(a + 1, b + 1, end + 1);
  }
  SceneBuilder b;
  b.add_to_group(0, b.add_mesh(make_mesh(m)));
  return b.build();
}

// Rays from inside closed rooms to points on their surfaces, edges and vertices.
TEST(Accelerator, ListsHaveNoHoles) {
  for (const float half_length : {1.f, 30.f, 500.f}) {
    const auto scene = turned_tube(20, half_length);
    const EmbreeAccelerator accel(scene, 1, HitRule::kList);
    ASSERT_TRUE(accel.has_list());
    const Mesh& mesh = scene->meshes()[0];
    const size_t n = size_for_build(200000);
    std::mt19937 rng(6);
    std::uniform_real_distribution<double> uniform(0, 1);
    const auto corner = [&](uint32_t face, uint32_t k, size_t axis) {
      return static_cast<double>(mesh.positions[3 * mesh.indices[3 * face + k] + axis]);
    };
    Rays rays(n);
    for (size_t i = 0; i < n; ++i) {
      const auto point = [&](uint32_t kind, double shrink) {
        const auto face = static_cast<uint32_t>(rng() % mesh.triangle_count());
        double a = kind == 2 ? 0 : uniform(rng), b = kind == 0 ? uniform(rng) : 0;
        if (a + b > 1) a = 1 - a, b = 1 - b;
        std::array<double, 3> p;
        for (size_t k = 0; k < 3; ++k)
          p[k] = shrink * ((1 - a - b) * corner(face, 0, k) + a * corner(face, 1, k) +
                           b * corner(face, 2, k));
        return p;
      };
      rays.aim(i, point(0, 0.9 * uniform(rng)), point(static_cast<uint32_t>(i % 3), 1));
    }
    const Keys keys(n);
    const Hits hits = trace(accel, rays, 16, false, keys.keys());
    EXPECT_EQ(std::count(hits.inst.begin(), hits.inst.begin() + static_cast<long>(n), kNoHit), 0)
        << half_length;
    const auto shadow = blocked(accel, rays, 16, false, keys.keys());
    EXPECT_EQ(std::count(shadow.begin(), shadow.end(), 0u), 0) << half_length;
    expect_hits_do_not_depend_on_packets(accel, rays);
  }
}

// If two triangles coincide, the reported triangle depends on their ids, not on the packet width.
TEST(Accelerator, CoincidentSurfacesDoNotDependOnPackets) {
  SceneBuilder b;
  b.add_to_group(0, b.add_mesh(make_mesh(grid(8, 0.3f, 1))));
  b.add_to_group(0, b.add_mesh(make_mesh(grid(8, 0.3f, 1))));
  const EmbreeAccelerator accel(b.build(), 1);
  Rays rays = random_rays(20000, 1, 3);
  for (size_t i = 0; i < rays.size; ++i)
    rays.aim(i, {4, 5, 4}, {4 + 4 * rays.ox[i], 0, 4 + 4 * rays.oz[i]});
  expect_hits_do_not_depend_on_packets(accel, rays);
}

// Rays onto surfaces that intersect many times, partly coplanar, with coincident instances. The
// rays are in random order and sorted by direction.
TEST(Accelerator, IncoherentRaysAtCrossingSurfacesDoNotDependOnPackets) {
  SceneBuilder b;
  const uint32_t group = b.add_group("crossing");
  for (const uint32_t seed : {1u, 2u, 3u})
    b.add_to_group(group, b.add_mesh(make_mesh(grid(12, 0.4f, seed))));
  b.add_to_group(group, b.add_mesh(make_mesh(grid(12, 0, 0))));
  b.add_to_group(group, b.add_mesh(make_mesh(quad({-1, 0, -1}, {14, 0, 0}, {0, 0, 14}))));
  const Affine m = rotate(0, 20) * rotate(2, 31) * translate(-6, 0, -6);
  b.add_instance(0, group, m);
  b.add_instance(0, group, m);
  b.add_instance(0, group, rotate(1, 90) * m);
  const EmbreeAccelerator accel(b.build(), 1);
  Rays rays(size_for_build(30000));
  std::mt19937 rng(13);
  std::uniform_real_distribution<double> uniform(-6, 6);
  for (size_t i = 0; i < rays.size; ++i) {
    std::array<double, 3> from, to;
    for (double& x : from) x = uniform(rng);
    for (double& x : to) x = uniform(rng);
    rays.aim(i, from, to);
    rays.tfar[i] = static_cast<float>(std::abs(uniform(rng)));
  }
  expect_hits_do_not_depend_on_packets(accel, rays);

  std::vector<uint32_t> key(rays.size), order(rays.size);
  for (size_t i = 0; i < rays.size; ++i)
    key[i] = direction_key<float>(Vec3<float>(rays.dx[i], rays.dy[i], rays.dz[i]));
  sort_by_direction(key.data(), rays.slot.data(), rays.size, order.data());
  expect_hits_do_not_depend_on_packets(accel, rays.in_order(order));
}

/// Compares occlusion with the hits of the same rays on `triangles` triangles, for a triangle list
/// or a BVH. At least 1 / `one_in` of the rays must be blocked.
void expect_occlusion_agrees(uint32_t triangles, HitRule rule, size_t one_in) {
  const auto scene = soup_scene(triangles);
  const EmbreeAccelerator accel(scene, 2, rule);
  const size_t n = size_for_build(50000);
  const Rays rays = random_rays(n, 3, 17);
  const Keys keys(n);
  const Hits all = trace(accel, rays, 16, false, keys.keys());
  const Hits near = trace(accel, rays, 16, false, keys.keys(), true);
  const std::vector<uint32_t> shadow = blocked(accel, rays, 16, false, keys.keys());
  size_t count = 0;
  for (size_t i = 0; i < n; ++i) {
    // Hits beyond `tfar` are excluded, and nearer hits are found.
    const bool expected = all.inst[i] != kNoHit && all.t[i] <= rays.tfar[i];
    EXPECT_EQ(near.inst[i] != kNoHit, expected) << i;
    if (expected) {
      EXPECT_TRUE(same_hit(all, i, near, i)) << i;
    }
    EXPECT_EQ(shadow[i], expected ? 1u : 0u) << i;
    count += expected;
  }
  EXPECT_GT(count, n / one_in);
  EXPECT_LT(count, n * 9 / 10);
}

TEST(Accelerator, OcclusionAgreesWithIntersection) {
  expect_occlusion_agrees(300, HitRule::kCanonical, 10);
}

TEST_P(SmallScene, OcclusionAgreesWithIntersection) {
  expect_occlusion_agrees(4, GetParam(), 40);
}

TEST_P(SmallScene, LightShapesAreFoundByTheirRecord) {
  SceneBuilder b;
  b.add_light(make_light(LightKind::kSphere, {1, 1, 1}, translate(4, 0, 0)));
  b.add_light(make_light(LightKind::kDome, {1, 1, 1}));
  b.add_light(make_light(LightKind::kDisk, {1, 1, 1}, translate(0, 4, 0) * rotate(0, -90)));
  b.add_light(make_light(LightKind::kRect, {1, 1, 1},
                         translate(0, 0, -4) * rotate(1, 180) * scale(-2, 0.5f, 1)));
  Light point = make_light(LightKind::kSphere, {1, 1, 1}, translate(-4, 0, 0));
  point.radius = 0;
  b.add_light(point);
  b.add_light(make_light(LightKind::kDistant, {1, 1, 1}));
  const auto scene = b.build();
  const EmbreeAccelerator accel(scene, 1, GetParam());
  const auto& record = scene->light_set().of_input;
  Rays rays(9);
  const auto from_centre = [&](size_t i, double x, double y, double z) {
    rays.aim(i, {0, 0, 0}, {x, y, z});
  };
  from_centre(0, 4, 0.4, 0);
  from_centre(1, 4, 0.6, 0);     // beside it
  from_centre(2, 0.4, 4, 0.25);  // disk of radius 0.5
  from_centre(3, 0.4, 4, 0.35);
  from_centre(4, 0.9, 0.2, -4);  // rect of 2 x 0.5
  from_centre(5, 0.9, 0.3, -4);
  from_centre(6, -4, 0, 0);  // a point light has no shape
  from_centre(7, 1, 1, 1);
  rays.aim(8, {0, 0, -8}, {0, 0.1, 0});
  const Keys keys(9);
  for (const uint32_t width : {1u, 4u, 8u, 16u}) {
    const Hits hits = trace(accel, rays, width, false, keys.keys());
    const auto expect = [&](size_t i, uint32_t input, double t) {
      EXPECT_EQ(hits.inst[i], kLightShape) << i;
      EXPECT_EQ(hits.geom[i], record[input]) << i;
      EXPECT_NEAR(hits.t[i], t, 2e-5) << i;
    };
    // |o + t d - c| = r: t = b - sqrt(b^2 - c).
    const double b4 = 16 / std::sqrt(16.16);
    expect(0, 0, b4 - std::sqrt(b4 * b4 - 16 + 0.25));
    expect(2, 2, std::sqrt(16 + 0.16 + 0.0625));
    expect(4, 3, std::sqrt(16 + 0.81 + 0.04));
    expect(8, 3, std::sqrt(16 + 0.01 / 4));
    for (const size_t i : {1u, 3u, 5u, 6u, 7u}) EXPECT_EQ(hits.inst[i], kNoHit) << i;
    const auto shadow = blocked(accel, rays, width, false, keys.keys());
    EXPECT_EQ(shadow, (std::vector<uint32_t>{1, 0, 1, 0, 1, 0, 0, 0, 1}));
  }
}

TEST_P(SmallScene, CylinderLightsAreOpenAtTheirEnds) {
  SceneBuilder b;
  Light tube = make_light(LightKind::kCylinder, {1, 1, 1}, translate(0, 0, 3));  // along x
  tube.length = 4;
  b.add_light(tube);
  const EmbreeAccelerator accel(b.build(), 1, GetParam());
  Rays rays(5);
  rays.aim(0, {0, 0, 0}, {1.9, 0, 3});
  rays.aim(1, {2.1, 0, 0}, {2.1, 0, 3});
  rays.aim(2, {-5, 0, 3}, {5, 0, 3});
  rays.aim(3, {-3, 0, 3}, {-2, 0.25, 3});
  rays.aim(4, {0, 0, 3}, {0, 1, 3});  // from inside
  const Keys keys(5);
  const Hits hits = trace(accel, rays, 4, false, keys.keys());
  const double s = std::sqrt(1.9 * 1.9 + 9);
  EXPECT_NEAR(hits.t[0], s * 2.5 / 3, 1e-5);
  EXPECT_EQ(hits.inst[1], kNoHit);
  EXPECT_EQ(hits.inst[2], kNoHit);
  EXPECT_NEAR(hits.t[3], std::sqrt(1 + 0.0625) * 2, 1e-5);
  EXPECT_NEAR(hits.t[4], 0.5, 1e-6);
}

TEST(Accelerator, LightShapesDoNotDependOnPackets) {
  SceneBuilder b;
  std::mt19937 rng(4);
  std::uniform_real_distribution<float> uniform(-2, 2);
  for (int i = 0; i < 60; ++i) {
    const LightKind kind = i % 4 == 0   ? LightKind::kRect
                           : i % 4 == 1 ? LightKind::kDisk
                           : i % 4 == 2 ? LightKind::kSphere
                                        : LightKind::kCylinder;
    const float x = uniform(rng), y = uniform(rng), z = uniform(rng), a = uniform(rng);
    b.add_light(make_light(kind, {1, 1, 1},
                           translate(x, y, z) * rotate(i % 2, 90 * a) * scale(0.8f, 0.5f, 0.5f)));
  }
  const EmbreeAccelerator accel(b.build(), 1);
  expect_hits_do_not_depend_on_packets(accel, random_rays(size_for_build(30000), 3, 8));
}

/// A stack of `n` partly transparent squares at z = 0, -1 and so on, with an opaque square behind.
std::shared_ptr<const Scene> leaves(int n, float opacity, float threshold, bool textured,
                                    bool instanced) {
  SceneBuilder b;
  Material m = make_material(ProgramId::kPrincipled);
  m.presence = threshold == 0;
  m.opacity = opacity;
  m.opacity_threshold = threshold;
  if (textured) {
    const uint32_t t = add_texture(b, 2, 1, 1, {0.f, 1.f}, Wrap::kClamp);
    m.textures[static_cast<size_t>(Input::kOpacity)] = use(t, 0);
  }
  const uint32_t leaf = b.add_material(m);
  const uint32_t group = b.add_group("leaf");
  b.add_to_group(group, b.add_mesh(make_mesh(quad({-1, -1, 0}, {2, 0, 0}, {0, 2, 0}))));
  for (int i = 0; i < n; ++i) {
    const auto z = static_cast<float>(-i);
    if (instanced)
      b.add_instance(0, group, translate(0, 0, z), leaf);
    else
      b.add_to_group(0, b.add_mesh(make_mesh(quad({-1, -1, z}, {2, 0, 0}, {0, 2, 0}), leaf)));
  }
  b.add_to_group(0, b.add_mesh(make_mesh(quad({-9, -9, -20}, {18, 0, 0}, {0, 18, 0}))));
  return b.build();
}

TEST_P(SmallScene, PresenceIsAProbability) {
  const size_t n = size_for_build(20000, 4);
  Rays rays(n);
  std::mt19937 rng(1);
  std::uniform_real_distribution<double> uniform(-0.95, 0.95);
  for (size_t i = 0; i < n; ++i) {
    const double x = uniform(rng), y = uniform(rng);
    rays.aim(i, {x, y, 5}, {x, y, 0});
  }
  const Keys keys(n);
  for (const bool instanced : {false, true}) {
    for (const float opacity : {0.f, 0.25f, 0.5f, 1.f}) {
      const auto scene = leaves(3, opacity, 0, false, instanced);
      const EmbreeAccelerator accel(scene, 1, GetParam());
      SCOPED_TRACE(testing::Message() << "opacity " << opacity << (instanced ? ", instanced" : ""));
      expect_hits_do_not_depend_on_packets(accel, rays);
      const Hits hits = trace(accel, rays, 16, false, keys.keys());
      double count[4] = {0, 0, 0, 0};
      for (size_t i = 0; i < n; ++i) {
        ASSERT_NE(hits.inst[i], kNoHit);
        const int layer = static_cast<int>(std::lround(hits.t[i] - 5));
        ++count[layer > 3 ? 3 : layer];
      }
      double expected = static_cast<double>(n), left = 1;
      for (int layer = 0; layer < 4; ++layer) {
        const double p = left * (layer < 3 ? opacity : 1);
        expected = p * static_cast<double>(n);
        left -= p;
        // With 16 comparisons, 4.5 sigma gives a false alarm rate of 1e-4 in total.
        EXPECT_NEAR(count[layer], expected, 4.5 * std::sqrt(expected * (1 - p)) + 1e-9) << layer;
      }
      // A different salt gives different random decisions.
      const Hits again = trace(accel, rays, 16, false, keys.keys(1));
      size_t same = 0;
      for (size_t i = 0; i < n; ++i) same += hits.t[i] == again.t[i];
      if (opacity == 0 || opacity == 1) {
        EXPECT_EQ(same, n);
      } else {
        EXPECT_LT(same, n * 3 / 4);
      }
    }
  }
}

TEST_P(SmallScene, PresenceKeysMayStandInRows) {
  // Keys are laid out as in the path pool: the two words of a key are inside a row of 16 words.
  const size_t n = 2000, words = 16;
  Rays rays(n);
  for (size_t i = 0; i < n; ++i) {
    const double x = static_cast<double>(i) / n - 0.5;
    rays.aim(i, {x, 0.1, 5}, {x, 0.1, 0});
    rays.slot[i] = static_cast<uint32_t>(n - 1 - i);
  }
  const Keys keys(n);
  std::vector<uint32_t> rows(words * n, 0xdeadbeefu);
  for (size_t i = 0; i < n; ++i) {
    rows[words * i + 13] = keys.pixel_hash[i];
    rows[words * i + 14] = keys.sample[i];
  }
  const PresenceKeys in_rows{rows.data() + 13, rows.data() + 14, words, 5};
  const EmbreeAccelerator accel(leaves(3, 0.4f, 0, false, true), 1, GetParam());
  for (const uint32_t width : {1u, 4u, 8u, 16u}) {
    expect_same_hits(trace(accel, rays, width, false, keys.keys(5)),
                     trace(accel, rays, width, false, in_rows), n, "keys in rows");
    EXPECT_EQ(blocked(accel, rays, width, false, keys.keys(5)),
              blocked(accel, rays, width, false, in_rows));
  }
}

TEST_P(SmallScene, PresenceByTextureAndThreshold) {
  const size_t n = 4096;
  Rays rays(n);
  for (size_t i = 0; i < n; ++i) {
    const double x = (static_cast<double>(i) + 0.5) / n * 1.98 - 0.99;
    rays.aim(i, {x, 0.3, 5}, {x, 0.3, 0});
  }
  const Keys keys(n);
  for (const bool instanced : {false, true}) {
    for (const float threshold : {0.f, 0.5f, 0.9f}) {
      const auto scene = leaves(1, 1, threshold, true, instanced);
      const EmbreeAccelerator accel(scene, 1, GetParam());
      expect_hits_do_not_depend_on_packets(accel, rays);
      const Hits hits = trace(accel, rays, 16, false, keys.keys());
      for (size_t i = 0; i < n; ++i) {
        // Opacity rises from 0 at u = 1/4 to 1 at u = 3/4.
        const double opacity = std::clamp(rays.ox[i] + 0.5, 0.0, 1.0);
        const bool present = hits.t[i] < 10;
        if (std::abs(opacity - threshold) < 1e-3) continue;
        if (threshold > 0) {
          EXPECT_EQ(present, opacity > threshold) << opacity;
        } else if (opacity == 0 || opacity == 1) {
          EXPECT_EQ(present, opacity == 1) << opacity;
        }
      }
    }
  }
}

/// A stack of three clear squares, turned by `degrees` about y and 1 apart along z, with an opaque
/// square behind. Their material has opacity `opacity`, index 1.5 and no roughness.
std::shared_ptr<const Scene> panes(float opacity, double degrees, bool instanced) {
  SceneBuilder b;
  Material m = make_material(ProgramId::kPrincipled);
  m.opacity = opacity;
  m.roughness = 0;
  m.ior = 1.5f;
  const uint32_t glass = b.add_material(m);
  const uint32_t group = b.add_group("pane");
  b.add_to_group(group, b.add_mesh(make_mesh(quad({-4, -4, 0}, {8, 0, 0}, {0, 8, 0}))));
  for (int i = 0; i < 3; ++i) {
    const Affine place = translate(0, 0, static_cast<float>(-i)) * rotate(1, degrees);
    if (instanced)
      b.add_instance(0, group, place * scale(1, 0.5f, 3), glass);
    else
      b.add_to_group(0, b.add_mesh(make_mesh(
                            quad({-4, -4, 0}, {8, 0, 0}, {0, 8, 0}).transform(place), glass)));
  }
  b.add_to_group(0, b.add_mesh(make_mesh(quad({-9, -9, -20}, {18, 0, 0}, {0, 18, 0}))));
  return b.build();
}

/// Fraction of light that a pane lets pass, by Fresnel's formulas for index 1.5.
double pane_transmission(double opacity, double degrees) {
  const double c = std::cos(degrees * kPiD / 180), t = std::sqrt(1 - (1 - c * c) / 2.25);
  const double p = (1.5 * c - t) / (1.5 * c + t), s = (c - 1.5 * t) / (c + 1.5 * t);
  return (1 - opacity) * (1 - 0.5 * (p * p + s * s));
}

TEST_P(SmallScene, StraightTransmissionIsAProbability) {
  const size_t n = size_for_build(20000, 4);
  Rays rays(n);
  std::mt19937 rng(2);
  std::uniform_real_distribution<double> uniform(-0.2, 0.2);
  for (size_t i = 0; i < n; ++i) {
    const double x = uniform(rng), y = uniform(rng);
    rays.aim(i, {x, y, 5}, {x, y, 0});
    rays.tfar[i] = i % 2 == 0 ? 15.f : 30.f;  // before and behind the opaque square
  }
  const Keys words(n);
  PresenceKeys keys = words.keys(4);
  for (const bool instanced : {false, true})
    for (const auto& [opacity, degrees] : {std::pair(0.1, 0.0), {0.4, 50.0}, {0.0, 75.0}}) {
      const auto scene = panes(static_cast<float>(opacity), degrees, instanced);
      const EmbreeAccelerator accel(scene, 1, GetParam());
      SCOPED_TRACE(testing::Message() << opacity << " " << degrees << " " << instanced);
      const double passes = pane_transmission(opacity, degrees);
      keys.passes_straight = false;
      const Hits opaque = trace(accel, rays, 16, false, keys);
      keys.passes_straight = true;
      const Hits hits = trace(accel, rays, 16, false, keys);
      expect_same_hits(hits, trace(accel, rays, 1, false, keys), n, "panes");
      double count[4] = {0, 0, 0, 0};
      for (size_t i = 0; i < n; ++i) {
        ASSERT_LT(opaque.t[i], 6.f);
        const int layer = static_cast<int>(std::lround(hits.t[i] - opaque.t[i]));
        ++count[std::min(layer, 3)];
      }
      double left = 1;
      for (int layer = 0; layer < 4; ++layer) {
        const double p = layer < 3 ? left * (1 - passes) : left, expected = p * n;
        left -= p;
        // With 24 comparisons, 4.7 sigma gives a false alarm rate of 1e-4 in total.
        EXPECT_NEAR(count[layer], expected, 4.7 * std::sqrt(expected * (1 - p))) << layer;
      }
      // Shadow rays pass all panes and are attenuated, equally for all packet widths.
      std::vector<uint32_t> first;
      for (const uint32_t width : {1u, 4u, 8u, 16u}) {
        std::vector<uint32_t> depths(n, 0);
        keys.optical_depth = depths.data();
        const std::vector<uint32_t> stopped = blocked(accel, rays, width, false, keys);
        keys.optical_depth = nullptr;
        for (size_t i = 0; i < n; ++i) {
          ASSERT_EQ(stopped[i] != 0, i % 2 == 1) << i;
          if (stopped[i] != 0) {
            depths[i] = 0;
          } else {
            ASSERT_NEAR(surface_transmittance<float>(depths[i]), std::pow(passes, 3), 1e-4) << i;
          }
        }
        if (first.empty()) first = depths;
        EXPECT_EQ(first, depths) << width;
      }
    }
}

TEST(Accelerator, PresenceIsStratifiedOverThePixel) {
  const EmbreeAccelerator accel(panes(0.4f, 0, false), 1);
  const double passes = pane_transmission(0.4, 0);
  constexpr size_t kSamples = 256, kPixels = 64;
  const size_t n = kSamples * kPixels;
  Rays rays(n);
  Keys words(n);
  std::mt19937 rng(3);
  for (size_t i = 0; i < n; ++i) {
    rays.aim(i, {0.1, 0.05, 5}, {0.1, 0.05, 0});
    words.sample[i] = static_cast<uint32_t>(i % kSamples);
    words.pixel_hash[i] =
        i % kSamples == 0 ? static_cast<uint32_t>(rng()) : words.pixel_hash[i - 1];
  }
  PresenceKeys keys = words.keys(6);
  keys.passes_straight = true;
  const Hits hits = trace(accel, rays, 16, false, keys);
  double pairs = 0;
  for (size_t pixel = 0; pixel < kPixels; ++pixel) {
    int first = 0;
    for (size_t i = pixel * kSamples; i < (pixel + 1) * kSamples; ++i) {
      first += hits.t[i] > 5.5f;
      pairs += hits.t[i] > 6.5f;
    }
    EXPECT_NEAR(first, passes * kSamples, 1.01) << pixel;
  }
  // The decisions of two panes are independent: 4 sigma of a binomial distribution.
  const double expected = passes * passes * static_cast<double>(n);
  EXPECT_NEAR(pairs, expected, 4 * std::sqrt(expected * (1 - passes * passes)));
}

TEST(Accelerator, PresenceByItself) {
  const auto scene = leaves(1, 1, 0.5f, true, false);
  const uint32_t mesh = scene->groups()[0].meshes[0];
  const Keys keys(1);
  for (int i = 0; i < 100; ++i) {
    const float u = (static_cast<float>(i) + 0.5f) / 100;
    // Triangle 0 has uv (0, 0), (1, 0), (1, 1), so u = b1 + b2 and v = b2.
    const PresenceQuery at{
        .instance = 0, .geom = 0, .mesh = mesh, .prim = 0, .u = u, .v = 0, .slot = 0};
    EXPECT_EQ(is_present(scene->view(), at, keys.keys()), u > 0.5f) << u;
  }
}

TEST(Accelerator, MemoryIsAccounted) {
  SceneBuilder small, large;
  small.add_to_group(0, small.add_mesh(make_mesh(soup(100, 1))));
  large.add_to_group(0, large.add_mesh(make_mesh(soup(20000, 1))));
  const EmbreeAccelerator a(small.build(), 1), b(large.build(), 1);
  EXPECT_GT(a.bytes(), 100u);
  EXPECT_GT(b.bytes(), a.bytes() + 20000u * 16);
  EXPECT_LT(b.bytes(), 20000u * 1000);
}

TEST_P(SmallScene, EmptySceneAndZeroAreaFaces) {
  SceneBuilder empty;
  const EmbreeAccelerator nothing(empty.build(), 1, GetParam());
  SceneBuilder flat;
  MeshData m;
  m.vertex(0, 0, 0);
  m.vertex(1, 0, 0);
  m.vertex(2, 0, 0);
  m.triangle(0, 1, 2);  // a line
  m.triangle(0, 0, 0);  // a point
  flat.add_to_group(0, flat.add_mesh(make_mesh(m)));
  flat.add_to_group(0, flat.add_mesh(make_mesh(MeshData{})));
  const auto flat_scene = flat.build();
  EXPECT_EQ(flat_scene->unique_triangles(), 2u);
  const EmbreeAccelerator line(flat_scene, 1, GetParam());
  Rays rays(40);
  for (size_t i = 0; i < 40; ++i) rays.aim(i, {0.05 * static_cast<double>(i), 3, 0}, {0.1, 0, 0});
  const Keys keys(40);
  for (const auto* accel : {&nothing, &line})
    for (const uint32_t width : {1u, 4u, 8u, 16u}) {
      const Hits hits = trace(*accel, rays, width, true, keys.keys());
      for (size_t i = 0; i < 40; ++i) EXPECT_EQ(hits.inst[i], kNoHit);
      const auto shadow = blocked(*accel, rays, width, false, keys.keys());
      EXPECT_EQ(std::count(shadow.begin(), shadow.end(), 1u), 0);
    }
}

TEST(Accelerator, NativeWidth) {
  const EmbreeAccelerator accel(cornell(), 1);
  const uint32_t w = accel.native_width();
  EXPECT_TRUE(w == 1 || w == 4 || w == 8 || w == 16) << w;
}

}  // namespace
}  // namespace wavecomb
