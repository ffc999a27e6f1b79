// SPDX-License-Identifier: Apache-2.0
// Tests of surface values: rays, lights and shading read the same values at a hit.
#include "curve_testing.h"
#include "lane_testing.h"
#include "wavecomb/geometry/hit/hit_material.h"
#include "wavecomb/geometry/hit/surface.h"
#include "wavecomb/material/inputs/graph_inputs.h"
#include "wavecomb/material/inputs/presence.h"
#include "wavecomb/material/lobes/fresnel.h"
#include "wavecomb/material/lobes/straight_transmission.h"

namespace wavecomb {
namespace {

using namespace curve_testing;
using lane_testing::same_bits;

/// Meshes with texture coordinates and normals per vertex, per corner and without; curves of all
/// kinds with and without texture coordinates; untransformed, rotated and mirrored instances;
/// materials of faces, meshes and instances.
std::shared_ptr<const Scene> all_kinds() {
  SceneBuilder b;
  std::mt19937 rng(2);
  std::uniform_real_distribution<float> uniform(-1, 1);
  for (int i = 0; i < 5; ++i)
    b.add_material(make_material(ProgramId::kDiffuse, Vec3<float>(0.1f * static_cast<float>(i))));
  const uint32_t group = b.add_group("all");
  const auto add = [&](Mesh mesh) { b.add_to_group(group, b.add_mesh(std::move(mesh))); };
  for (const Attribute at : {Attribute::kNone, Attribute::kVertex, Attribute::kCorner})
    for (const bool by_face : {false, true}) {
      MeshData data = quad({-1, -1, 0}, {2, 0.5f, 0}, {0.3f, 2, 1});
      data.uvs_at = at;
      data.uvs.resize(at == Attribute::kNone ? 0 : (at == Attribute::kVertex ? 8 : 12));
      for (float& x : data.uvs) x = 3 * uniform(rng);
      data.normals_at = at;
      data.normals.resize(at == Attribute::kNone ? 0 : (at == Attribute::kVertex ? 12 : 18));
      for (float& x : data.normals) x = uniform(rng);
      if (by_face) data.face_materials = {3, kInheritMaterial};
      add(make_mesh(std::move(data), at == Attribute::kVertex ? 2 : kInheritMaterial));
    }
  for (const Primitive primitive : curved_primitives())
    for (const bool authored : {false, true}) {
      CurveData data = strands(primitive, 4, 3, 1.f, 0.1f, 7);
      const size_t count =
          primitive == Primitive::kSphere ? data.radii.size() : 2 * data.segments.size();
      if (authored) data.uvs.resize(2 * count);
      for (float& x : data.uvs) x = 3 * uniform(rng);
      add(make_curves(std::move(data)));
    }
  b.add_instance(0, group, translate(1, 2, 3), 1);
  b.add_instance(0, group, rotate(0, 40) * scale(-1, 2, 0.5f), 4);
  b.set_camera(make_camera({0, 0, 5}, {0, 0, 0}));
  return b.build();
}

/// Hits distributed over a scene.
struct Hits {
  static constexpr size_t kCount = 1024;
  uint32_t inst[kCount], mesh[kCount], prim[kCount];
  float u[kCount], v[kCount];

  explicit Hits(const Scene& scene) {
    std::mt19937 rng(5);
    std::uniform_real_distribution<float> uniform(0, 0.5f);
    const Group& group = scene.groups()[1];
    for (size_t i = 0; i < kCount; ++i) {
      inst[i] = 1 + static_cast<uint32_t>(rng() % 2);
      mesh[i] = group.meshes[rng() % group.meshes.size()];
      prim[i] = static_cast<uint32_t>(rng() % scene.meshes()[mesh[i]].primitive_count());
      u[i] = uniform(rng);
      v[i] = uniform(rng);
    }
  }
  template <typename F>
  MeshHit<F> at(size_t i) const {
    return {load<UInt<F>>(inst + i), load<UInt<F>>(mesh + i), load<UInt<F>>(prim + i),
            load<F>(u + i), load<F>(v + i)};
  }
};

template <typename F>
Vec2<F> uv_of(const SceneView& scene, const MeshHit<F>& hit) {
  return hit_uv<F>(scene.meshes, hit.mesh, hit.prim, hit.u, hit.v, Mask<F>(true));
}

TEST(SurfaceValues, TextureCoordinatesAreTheSameForRaysAndForShading) {
  const auto scene = all_kinds();
  const Hits hits(*scene);
  const SceneView view = scene->view();
  for (size_t i = 0; i < Hits::kCount; ++i) {
    const MeshHit<float> hit = hits.at<float>(i);
    const Surface<float> s = setup_surface<float>(view, hit, {0, 0, -1}, true, false, true);
    const Vec2<float> uv = uv_of<float>(view, hit);
    ASSERT_TRUE(same_bits(uv.x, s.uv.x) && same_bits(uv.y, s.uv.y)) << "mesh " << hit.mesh;
  }
  lane_testing::for_each_packet([&]<typename F>() {
    for (size_t i = 0; i < Hits::kCount; i += kWidth<F>) {
      const Vec2<F> wide = uv_of<F>(view, hits.at<F>(i));
      for (size_t k = 0; k < kWidth<F>; ++k) {
        const Vec2<float> one = uv_of<float>(view, hits.at<float>(i + k));
        ASSERT_TRUE(same_bits(one.x, lane(wide.x, k)) && same_bits(one.y, lane(wide.y, k)));
      }
    }
  });
}

TEST(SurfaceValues, MaterialsAreOfTheFaceTheMeshOrTheInstance) {
  const auto scene = all_kinds();
  const Hits hits(*scene);
  const SceneView view = scene->view();
  for (size_t i = 0; i < Hits::kCount; ++i) {
    const Mesh& mesh = scene->meshes()[hits.mesh[i]];
    uint32_t expected =
        mesh.face_materials.empty() ? mesh.material : mesh.face_materials[hits.prim[i]];
    const uint32_t inherited = hits.inst[i] == 1 ? 1 : 4;
    if (expected == kInheritMaterial) expected = inherited;
    ASSERT_EQ(hit_material<float>(view, inherited, hits.mesh[i], hits.prim[i], true), expected);
  }
  lane_testing::for_each_packet([&]<typename F>() {
    using U = UInt<F>;
    for (size_t i = 0; i < Hits::kCount; i += kWidth<F>) {
      const MeshHit<F> hit = hits.at<F>(i);
      const U wide = hit_material<F>(view, U(4u), hit.mesh, hit.prim, Mask<F>(true));
      for (size_t k = 0; k < kWidth<F>; ++k)
        ASSERT_EQ(hit_material<float>(view, 4, hits.mesh[i + k], hits.prim[i + k], true),
                  (lane(wide, k)));
    }
  });
}

/// All inputs that a graph can read at a point.
template <typename F>
std::array<F, 15> values_of(const GraphPoint<F>& at) {
  return {at.uv.x,
          at.uv.y,
          at.footprint.width,
          at.position.x,
          at.position.y,
          at.position.z,
          at.normal.x,
          at.normal.y,
          at.normal.z,
          at.local_position.x,
          at.local_position.y,
          at.local_position.z,
          at.local_normal.x,
          at.local_normal.y,
          at.local_normal.z};
}
template <typename F>
GraphPoint<F> rest_of(const SceneView& scene, const MeshHit<F>& hit) {
  return point_at_rest<F>(scene.meshes, scene.instances, hit.inst,
                          {hit.mesh, hit.prim, hit.u, hit.v}, uv_of<F>(scene, hit), Mask<F>(true));
}

TEST(SurfaceValues, PointsAtRestAreThoseOfShading) {
  const auto scene = all_kinds();
  const Hits hits(*scene);
  SceneView view = scene->view();
  view.materials.graphs.inputs = ~0u;  // request all inputs
  for (size_t i = 0; i < Hits::kCount; ++i) {
    const MeshHit<float> hit = hits.at<float>(i);
    const auto rest = values_of<float>(rest_of<float>(view, hit));
    const Vec3<float> dir(0, 0, -1);
    Surface<float> s = setup_surface<float>(view, hit, dir, true, false, true);
    if (scene->meshes()[hit.mesh].is_curved()) {
      ASSERT_TRUE(same_bits(rest[0], s.uv.x) && same_bits(rest[1], s.uv.y));
      continue;
    }
    s.ns = s.ng;
    const auto shaded = values_of<float>(graph_point<float>(view, hit, s, dir, 0.f, true));
    for (size_t k = 0; k < rest.size(); ++k) ASSERT_NEAR(rest[k], shaded[k], 1e-5f) << k;
  }
  lane_testing::for_each_packet([&]<typename F>() {
    for (size_t i = 0; i < Hits::kCount; i += kWidth<F>) {
      const auto wide = values_of<F>(rest_of<F>(view, hits.at<F>(i)));
      for (size_t k = 0; k < kWidth<F>; ++k) {
        const auto one = values_of<float>(rest_of<float>(view, hits.at<float>(i + k)));
        for (size_t c = 0; c < one.size(); ++c)
          ASSERT_TRUE(same_bits(one[c], lane(wide[c], k))) << "value " << c;
      }
    }
  });
}

TEST(SurfaceValues, CosinesAreThoseOfShading) {
  const auto scene = all_kinds();
  const Hits hits(*scene);
  const SceneView view = scene->view();
  const Vec3<float> dir = normalize(Vec3<float>(0.3f, -0.5f, -1.f));
  for (size_t i = 0; i < Hits::kCount; ++i) {
    const MeshHit<float> hit = hits.at<float>(i);
    const Surface<float> s = setup_surface<float>(view, hit, dir, false, false, true);
    ASSERT_NEAR(unadjusted_cosine<float>(view, hit, dir, true),
                unadjusted_cosine<float>(s.unadjusted, dir), 2e-6f)
        << "mesh " << hit.mesh;
  }
}

TEST(SurfaceValues, DegenerateTrianglesFaceTheRay) {
  SceneBuilder b;
  b.add_material(make_material(ProgramId::kDiffuse, Vec3<float>(0.5f)));
  const uint32_t group = b.add_group("all");
  b.add_to_group(group, b.add_mesh(make_mesh(quad({0, 0, 0}, {1, 0, 0}, {2, 0, 0}), 0)));
  b.add_instance(0, group, translate(0, 0, 0), 0);
  b.set_camera(make_camera({0, 0, 5}, {0, 0, 0}));
  const auto scene = b.build();
  const Vec3<float> dir(0, 0, -1);
  EXPECT_FLOAT_EQ(unadjusted_cosine<float>(scene->view(), {1, 0, 0, 0.2f, 0.3f}, dir, true), 1.f);
}

/// Materials with straight transmission. The last two have no table.
std::vector<Material> clear_materials() {
  std::vector<Material> all;
  for (const float roughness : {0.f, 0.2f, 0.9f})
    for (const float coat : {0.f, 0.7f})
      for (const float metallic : {0.f, 0.4f}) {
        Material m = make_material(ProgramId::kPrincipled, {0.9f, 0.5f, 0.3f});
        m.roughness = roughness;
        m.clearcoat = coat;
        m.metallic = metallic;
        m.opacity = 0.1f * static_cast<float>(all.size() % 7);
        m.ior = 1.2f + 0.1f * static_cast<float>(all.size());
        if (all.size() % 4 == 3) m.emission = {1, 1, 1};
        all.push_back(m);
      }
  for (const bool opaque : {true, false}) {
    Material m = make_material(ProgramId::kPrincipled, {0.9f, 0.5f, 0.3f});
    m.opacity = opaque ? 1.f : 0.2f;
    m.textures[static_cast<size_t>(opaque ? Input::kOpacity : Input::kRoughness)] = use(0, 0);
    all.push_back(m);
  }
  return all;
}

TEST(SurfaceValues, TablesOfStraightTransmissionAreThoseOfTheLayers) {
  SceneBuilder b;
  add_texture(b, 2, 2, 1, {0.2f, 0.3f, 0.4f, 0.8f});
  const std::vector<Material> materials = clear_materials();
  for (const Material& m : materials) b.add_material(m);
  b.add_to_group(0, b.add_mesh(make_mesh(quad({0, 0, 0}, {1, 0, 0}, {0, 1, 0}), 0)));
  b.set_camera(make_camera({0, 0, 5}, {0, 0, 0}));
  const auto scene = b.build();
  const SceneView view = scene->view();
  const MeshHit<float> hit{0, 0, 0, 0.2f, 0.3f};
  for (uint32_t m = 0; m < materials.size(); ++m) {
    const bool constant = m + 2 < materials.size();
    ASSERT_EQ(view.materials.straight_table[m] != kNoStraightTable, constant) << m;
    const auto not_a_number = [](auto /*lanes*/) { return kNan; };
    const float at_nan = straight_transmission<float>(view, hit, m, not_a_number, true).probability;
    EXPECT_TRUE(!constant || (at_nan >= 0 && at_nan <= 1)) << m << " " << at_nan;
    for (uint32_t i = 0; i <= 1000; ++i) {
      const float z = static_cast<float>(i) / 1000;
      const auto cosine = [&](auto /*lanes*/) { return z; };
      const auto exact = detail::evaluate_straight<float>(view, hit, m, cosine, true);
      const auto found = straight_transmission<float>(view, hit, m, cosine, true);
      ASSERT_NEAR(found.probability, exact.probability, 3e-4f) << m << " " << z;
      ASSERT_TRUE(same_bits(found.opacity, exact.opacity)) << m;
    }
  }
  lane_testing::for_each_packet([&]<typename F>() {
    using U = UInt<F>;
    for (uint32_t i = 0; i < 200; ++i) {
      alignas(64) uint32_t material[kWidth<F>];
      alignas(64) float z[kWidth<F>];
      for (size_t k = 0; k < kWidth<F>; ++k) {
        material[k] = static_cast<uint32_t>((i + 3 * k) % materials.size());
        z[k] = static_cast<float>((i * 37 + k * 11) % 200) / 199.f;
      }
      const MeshHit<F> wide_hit{U(0u), U(0u), U(0u), F(0.2f), F(0.3f)};
      const auto cosine = [&](const auto& /*lanes*/) { return load<F>(z); };
      const auto wide =
          straight_transmission<F>(view, wide_hit, load<U>(material), cosine, Mask<F>(true));
      for (size_t k = 0; k < kWidth<F>; ++k) {
        const auto one_cosine = [&](auto /*lanes*/) { return z[k]; };
        const auto one = straight_transmission<float>(view, hit, material[k], one_cosine, true);
        ASSERT_TRUE(same_bits(one.probability, lane(wide.probability, k)));
        ASSERT_TRUE(same_bits(one.opacity, lane(wide.opacity, k)));
      }
    }
  });
}

TEST(SurfaceValues, SmoothThinWallsHaveTables) {
  SceneBuilder b;
  add_texture(b, 2, 2, 1, {0.2f, 0.3f, 0.4f, 0.8f});
  Material wall = make_material(ProgramId::kOpenPbr);
  wall.openpbr.thin_walled = true;
  wall.openpbr.transmission_weight = 1;
  wall.openpbr.transmission_color = {0.9f, 0.5f, 0.7f};
  wall.roughness = 0;
  Material solid = wall, rough = wall, textured = wall, metal = wall, glowing = wall, cut = wall;
  solid.openpbr.thin_walled = false;
  rough.roughness = 0.4f;
  textured.textures[static_cast<size_t>(Input::kBaseColor)] = use(0, 0);
  metal.metallic = 1;
  glowing.emission = {1, 1, 1};
  cut.presence = true;
  cut.opacity = 0.5f;
  for (const Material& m : {wall, glowing, solid, rough, textured, metal, cut}) b.add_material(m);
  b.add_to_group(0, b.add_mesh(make_mesh(quad({0, 0, 0}, {1, 0, 0}, {0, 1, 0}), 0)));
  b.set_camera(make_camera({0, 0, 5}, {0, 0, 0}));
  const auto scene = b.build();
  const MaterialView& view = scene->view().materials;
  for (uint32_t m = 0; m < 7; ++m) {
    const bool clear = m < 2;
    EXPECT_EQ(view.straight_table[m] != kNoStraightTable, clear) << m;
    EXPECT_EQ((view.materials[m].flags & kTransmitsStraight) != 0, clear) << m;
  }
  for (uint32_t i = 1; i <= 100; ++i) {
    const float z = static_cast<float>(i) / 100;
    const auto cosine = [&](auto /*lanes*/) { return z; };
    const float r = fresnel_dielectric(z, 1.5f).reflectance, passed = 0.5f * (1 - r) / (1 + r);
    const MeshHit<float> hit{0, 0, 0, 0.2f, 0.3f};
    EXPECT_NEAR(straight_transmission<float>(scene->view(), hit, 0, cosine, true).probability,
                passed, 3e-4f);
    EXPECT_NEAR(straight_transmission<float>(scene->view(), hit, 1, cosine, true).probability,
                std::min(passed, kMaxEmissivePassing), 3e-4f);
  }
}

}  // namespace
}  // namespace wavecomb
