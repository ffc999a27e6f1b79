// SPDX-License-Identifier: Apache-2.0
#include <functional>

#include "scene_testing.h"

namespace wavecomb {
namespace {

using namespace scene_testing;

/// Expects an Error with a one-line message that contains `words`.
void expect_error(const std::function<void(SceneBuilder&)>& use, const std::string& words) {
  SceneBuilder b;
  try {
    use(b);
  } catch (const Error& e) {
    const std::string message = e.what();
    EXPECT_NE(message.find(words), std::string::npos)
        << "'" << message << "' lacks '" << words << "'";
    EXPECT_EQ(message.find('\n'), std::string::npos) << message;
    EXPECT_GT(message.size(), words.size() + 5) << message;
    return;
  }
  ADD_FAILURE() << "taken, though it should say '" << words << "'";
}

MeshData triangle() {
  MeshData m;
  m.vertex(0, 0, 0);
  m.vertex(1, 0, 0);
  m.vertex(0, 1, 0);
  m.triangle(0, 1, 2);
  return m;
}
/// Adds a triangle named /World/bad, modified by `change`.
std::function<void(SceneBuilder&)> mesh_with(const std::function<void(MeshData&)>& change) {
  return [change](SceneBuilder& b) {
    MeshData m = triangle();
    change(m);
    b.add_mesh(make_mesh(m, kInheritMaterial, "/World/bad"));
  };
}

TEST(SceneBuilder, RefusesBadMeshes) {
  const std::string name = "mesh '/World/bad'";
  for (const float bad : {kNan, kInf, -kInf})
    for (size_t i = 0; i < 9; ++i)
      expect_error(mesh_with([=](MeshData& m) { m.positions[i] = bad; }), name);
  expect_error(mesh_with([](MeshData& m) { m.indices[2] = 3; }), name);
  expect_error(mesh_with([](MeshData& m) { m.indices[0] = 0xffffffffu; }), name);
  expect_error(mesh_with([](MeshData& m) { m.indices.pop_back(); }), name);
  expect_error(mesh_with([](MeshData& m) { m.positions.pop_back(); }), name);
  expect_error(mesh_with([](MeshData& m) { m.positions.clear(); }), name);
  for (const Attribute at : {Attribute::kVertex, Attribute::kCorner}) {
    expect_error(mesh_with([=](MeshData& m) {
                   m.normals.assign(6, 0);
                   m.normals_at = at;
                 }),
                 "2 normals where 3 are needed");
    expect_error(mesh_with([=](MeshData& m) {
                   m.uvs.assign(8, 0);
                   m.uvs_at = at;
                 }),
                 "4 texture coordinates where 3 are needed");
    expect_error(mesh_with([=](MeshData& m) { m.normals_at = at; }), name);
  }
  expect_error(mesh_with([](MeshData& m) { m.face_materials = {0, 0}; }), name);
}

TEST(SceneBuilder, RefusesUnknownIds) {
  expect_error([](SceneBuilder& b) { b.add_to_group(0, 0); }, "mesh 0");
  expect_error(
      [](SceneBuilder& b) {
        b.add_mesh(make_mesh(triangle()));
        b.add_to_group(1, 0);
      },
      "group 1");
  expect_error([](SceneBuilder& b) { b.add_instance(0, 1, {}); }, "never added");
  expect_error([](SceneBuilder& b) { b.add_instance(3, 0, {}); }, "never added");
  expect_error([](SceneBuilder& b) { b.add_instance(0, 0, {}); }, "world");
  expect_error(
      [](SceneBuilder& b) {
        Material m = make_material(ProgramId::kDiffuse);
        m.name = "/World/red";
        m.textures[0] = use(0);
        b.add_material(m);
      },
      "material '/World/red'");
  expect_error(
      [](SceneBuilder& b) {
        add_texture(b, 1, 1, 1, {1});
        Material m = make_material(ProgramId::kDiffuse);
        m.textures[0] = use(0, 5);
        b.add_material(m);
      },
      "material '/World/material'");
  expect_error(
      [](SceneBuilder& b) {
        Light l = make_light(LightKind::kDome, {1, 1, 1});
        l.texture = 0;
        b.add_light(l);
      },
      "light '/World/light'");
  expect_error(
      [](SceneBuilder& b) {
        b.add_mesh(make_mesh(triangle(), 0, "/World/bad"));
        b.build();
      },
      "mesh '/World/bad'");
  expect_error(
      [](SceneBuilder& b) {
        MeshData m = triangle();
        m.face_materials = {7};
        b.add_mesh(make_mesh(m, kInheritMaterial, "/World/bad"));
        b.build();
      },
      "mesh '/World/bad'");
  expect_error(
      [](SceneBuilder& b) {
        const uint32_t group = b.add_group("/World/group");
        b.add_to_group(group, b.add_mesh(make_mesh(triangle())));
        b.add_instance(0, group, {}, 4);
        b.build();
      },
      "material that was never added");
}

TEST(SceneBuilder, RefusesBadNumbersInMaterials) {
  const auto with = [](const std::function<void(Material&)>& change) {
    return [change](SceneBuilder& b) {
      Material m = make_material(ProgramId::kPrincipled);
      change(m);
      b.add_material(m);
    };
  };
  const std::string name = "material '/World/material'";
  for (const float bad : {kNan, kInf, -kInf}) {
    for (Vec3<float> Material::* color :
         {&Material::base_color, &Material::specular_color, &Material::emission,
          &Material::conductor_eta, &Material::conductor_k})
      expect_error(with([=](Material& m) { (m.*color).y = bad; }), name);
    for (float Material::* value : {&Material::roughness, &Material::metallic, &Material::clearcoat,
                                    &Material::clearcoat_roughness, &Material::opacity,
                                    &Material::ior, &Material::opacity_threshold})
      expect_error(with([=](Material& m) { m.*value = bad; }), name);
    expect_error(
        [bad](SceneBuilder& b) {
          Material m = make_material(ProgramId::kDiffuse);
          m.textures[0] = use(add_texture(b, 1, 1, 1, {1}));
          m.textures[0].uv[2] = bad;
          b.add_material(m);
        },
        name);
  }
  expect_error(with([](Material& m) { m.ior = 0; }), name);
  expect_error(with([](Material& m) { m.ior = -1.5f; }), name);
}

TEST(SceneBuilder, RefusesBadLights) {
  const auto with = [](const std::function<void(Light&)>& change) {
    return [change](SceneBuilder& b) {
      Light l = make_light(LightKind::kRect, {1, 1, 1});
      change(l);
      b.add_light(l);
    };
  };
  const std::string name = "light '/World/light'";
  for (const float bad : {kNan, kInf, -1.f}) {
    expect_error(with([=](Light& l) { l.color.z = bad; }), name);
    for (float Light::* size : {&Light::width, &Light::height, &Light::radius, &Light::angle})
      expect_error(with([=](Light& l) { l.*size = bad; }), name);
  }
  expect_error(with([](Light& l) { l.to_world.row[1].y = kNan; }), name);
  expect_error(with([](Light& l) { l.to_world.t.x = kInf; }), name);
}

TEST(SceneBuilder, RefusesBadCameras) {
  const auto with = [](const std::function<void(Camera&)>& change) {
    return [change](SceneBuilder& b) {
      Camera c;
      change(c);
      b.set_camera(c);
    };
  };
  expect_error(with([](Camera& c) { c.to_world = scale(1, 0, 1); }), "camera");
  expect_error(with([](Camera& c) { c.to_world.t.z = kNan; }), "camera");
  expect_error(with([](Camera& c) { c.window[1] = -0.5f; }), "camera");
  expect_error(with([](Camera& c) { c.window[3] = kNan; }), "camera");
  expect_error(with([](Camera& c) { c.window[0] = -kInf; }), "camera");
  expect_error(with([](Camera& c) { c.lens_radius = -1; }), "camera");
  expect_error(with([](Camera& c) { c.lens_radius = kInf; }), "camera");
  expect_error(with([](Camera& c) {
                 c.lens_radius = 1;
                 c.focus_distance = 0;
               }),
               "camera");
  for (const float bad : {kNan, -1.f})
    expect_error(with([=](Camera& c) { c.near_clip = bad; }), "camera");
  expect_error(with([](Camera& c) { c.far_clip = kNan; }), "camera");
  expect_error(with([](Camera& c) { c.near_clip = c.far_clip = 3; }), "camera");
}

TEST(SceneBuilder, RefusesBadInstances) {
  for (const float bad : {kNan, kInf})
    expect_error(
        [bad](SceneBuilder& b) {
          const uint32_t group = b.add_group("/World/tree");
          Affine m;
          m.row[2].x = bad;
          b.add_instance(0, group, m);
        },
        "/World/tree");
}

TEST(SceneBuilder, RefusesCyclesOfGroups) {
  expect_error(
      [](SceneBuilder& b) {
        const uint32_t a = b.add_group("/World/a");
        b.add_instance(0, a, {});
        b.add_instance(a, a, {});
        b.build();
      },
      "group '/World/a' holds itself");
  expect_error(
      [](SceneBuilder& b) {
        const uint32_t x = b.add_group("/World/x"), y = b.add_group("/World/y");
        const uint32_t z = b.add_group("/World/z");
        b.add_instance(0, x, {});
        b.add_instance(x, y, {});
        b.add_instance(y, z, {});
        b.add_instance(z, x, {});
        b.build();
      },
      "holds itself");
  // The same group twice as siblings, or along two paths of the hierarchy, is not a cycle.
  SceneBuilder b;
  const uint32_t leaf = b.add_group("leaf"), twig = b.add_group("twig"),
                 bough = b.add_group("bough");
  b.add_to_group(leaf, b.add_mesh(make_mesh(triangle())));
  b.add_instance(twig, leaf, {});
  b.add_instance(bough, leaf, {});
  b.add_instance(bough, twig, {});
  b.add_instance(0, bough, {});
  b.add_instance(0, twig, {});
  EXPECT_EQ(b.build()->instances().size(), 3u);
}

TEST(SceneBuilder, ManyLevelsOfSharedGroupsDoNotHang) {
  // A ladder of groups without meshes: 2^40 paths, none of which contains a mesh.
  SceneBuilder b;
  uint32_t above = 0;
  for (int i = 0; i < 40; ++i) {
    const uint32_t group = b.add_group("level");
    b.add_instance(above, group, {});
    b.add_instance(above, group, translate(1, 0, 0));
    above = group;
  }
  EXPECT_TRUE(b.build()->instances().empty());
}

TEST(SceneBuilder, DeepChainsOfGroups) {
  SceneBuilder b;
  uint32_t above = 0;
  constexpr int kLevels = 2000;
  for (int i = 0; i < kLevels; ++i) {
    const uint32_t group = b.add_group("level");
    b.add_instance(above, group, translate(1, 0, 0));
    above = group;
  }
  b.add_to_group(above, b.add_mesh(make_mesh(triangle())));
  const auto scene = b.build();
  ASSERT_EQ(scene->instances().size(), 1u);
  EXPECT_EQ(scene->instances()[0].to_world.t.x, kLevels);
}

/// Computes the same product of transforms in double precision.
struct Affine64 {
  double a[3][4] = {{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}};
  Affine64() = default;
  explicit Affine64(const Affine& m) {
    const float t[3] = {m.t.x, m.t.y, m.t.z};
    for (int i = 0; i < 3; ++i) {
      a[i][0] = m.row[i].x;
      a[i][1] = m.row[i].y;
      a[i][2] = m.row[i].z;
      a[i][3] = t[i];
    }
  }
  friend Affine64 operator*(const Affine64& x, const Affine64& y) {
    Affine64 r;
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 4; ++j) {
        r.a[i][j] = j == 3 ? x.a[i][3] : 0;
        for (int k = 0; k < 3; ++k) r.a[i][j] += x.a[i][k] * y.a[k][j];
      }
    return r;
  }
};

TEST(SceneBuilder, NestedGroupsFlatten) {
  SceneBuilder b;
  std::vector<uint32_t> materials;
  for (int i = 0; i < 4; ++i)
    materials.push_back(b.add_material(make_material(ProgramId::kDiffuse)));
  const uint32_t leaf = b.add_group("leaf"), branch = b.add_group("branch"),
                 tree = b.add_group("tree");
  b.add_to_group(leaf, b.add_mesh(make_mesh(triangle())));
  b.add_to_group(branch, b.add_mesh(make_mesh(triangle(), materials[3])));
  const Affine l[2] = {translate(0.1f, 0.2f, 0.3f) * rotate(0, 20), scale(1, -2, 0.5f)};
  const Affine c[2] = {rotate(1, 50) * translate(1, 0, 2), scale(0.5f, 0.5f, -0.5f)};
  const Affine t[2] = {translate(10, 0, 0), rotate(2, 70) * scale(3, 1, 1)};
  b.add_instance(branch, leaf, l[0]);                // inherits
  b.add_instance(branch, leaf, l[1], materials[1]);  // separate material
  b.add_instance(tree, branch, c[0], materials[0]);
  b.add_instance(tree, branch, c[1]);
  b.add_instance(0, tree, t[0], materials[2]);
  b.add_instance(0, tree, t[1]);
  const auto scene = b.build();
  // Each tree has two branches with a mesh each, and two leaves per branch.
  ASSERT_EQ(scene->instances().size(), 12u);
  EXPECT_EQ(scene->unique_triangles(), 2u);
  EXPECT_EQ(scene->instanced_triangles(), 12u);
  const auto grey = static_cast<uint32_t>(scene->materials().size() - 1);
  size_t found = 0;
  for (int ti = 0; ti < 2; ++ti)
    for (int ci = 0; ci < 2; ++ci)
      for (int li = -1; li < 2; ++li) {
        Affine64 m = Affine64(t[ti]) * Affine64(c[ci]);
        if (li >= 0) m = m * Affine64(l[li]);
        const uint32_t from_tree = ti == 0 ? materials[2] : grey;
        const uint32_t from_branch = ci == 0 ? materials[0] : from_tree;
        const uint32_t material = li == 1 ? materials[1] : from_branch;
        for (const Instance& i : scene->instances()) {
          if (i.group != (li < 0 ? branch : leaf) || i.material != material) continue;
          const Affine64 got(i.to_world);
          double worst = 0;
          for (int r = 0; r < 3; ++r)
            for (int k = 0; k < 4; ++k) worst = std::max(worst, std::abs(got.a[r][k] - m.a[r][k]));
          if (worst < 1e-5) ++found;
        }
      }
  EXPECT_EQ(found, 12u);
}

TEST(SceneBuilder, SingularInstancesAreLeftOut) {
  SceneBuilder b;
  const uint32_t group = b.add_group("/World/group");
  b.add_to_group(group, b.add_mesh(make_mesh(triangle())));
  b.add_instance(0, group, scale(1, 0, 1));
  b.add_instance(0, group, scale(0, 0, 0));
  b.add_instance(0, group, translate(1, 2, 3) * scale(1, 2, -3));
  b.add_instance(0, group, Affine{{{1, 2, 3}, {2, 4, 6}, {0, 0, 1}}, {0, 0, 0}});
  // A transform product that overflows.
  const uint32_t huge = b.add_group("/World/huge");
  b.add_instance(huge, group, scale(1e30f, 1e30f, 1e30f));
  b.add_instance(0, huge, scale(1e30f, 1e30f, 1e30f));
  const auto scene = b.build();
  ASSERT_EQ(scene->instances().size(), 1u);
  EXPECT_EQ(scene->instances()[0].to_world.t.y, 2);
  ASSERT_EQ(scene->warnings().size(), 1u);
  EXPECT_NE(scene->warnings()[0].find("4 instances"), std::string::npos) << scene->warnings()[0];
}

TEST(SceneBuilder, SmallInstancesAreNotSingular) {
  for (const float s : {1e-3f, 1e-6f, 1e5f}) {
    SceneBuilder b;
    const uint32_t group = b.add_group("/World/group");
    b.add_to_group(group, b.add_mesh(make_mesh(triangle())));
    b.add_instance(0, group, scale(s, s, s));
    EXPECT_EQ(b.build()->instances().size(), 1u) << s;
  }
}

TEST(SceneBuilder, ZeroAreaFacesAreKept) {
  SceneBuilder b;
  MeshData m = triangle();
  m.triangle(0, 0, 1);
  m.triangle(2, 2, 2);
  m.triangle(2, 1, 0);
  b.add_to_group(0, b.add_mesh(make_mesh(m)));
  const auto scene = b.build();
  EXPECT_EQ(scene->unique_triangles(), 4u);
  EXPECT_EQ(scene->meshes()[0].indices[9], 2u);
}

TEST(SceneBuilder, EmptyScenesAndMeshes) {
  SceneBuilder b;
  const auto empty = b.build();
  EXPECT_TRUE(empty->bounds().empty());
  EXPECT_EQ(empty->light_set().size(), 0u);
  EXPECT_EQ(empty->materials().size(), 1u);
  b.add_to_group(0, b.add_mesh(make_mesh(MeshData{})));
  const auto hollow = b.build();
  EXPECT_EQ(hollow->unique_triangles(), 0u);
  EXPECT_TRUE(hollow->bounds().empty());
}

TEST(SceneBuilder, BuildLeavesTheBuilderEmpty) {
  SceneBuilder b;
  b.add_to_group(
      0, b.add_mesh(make_mesh(triangle(), b.add_material(make_material(ProgramId::kMetal)))));
  b.add_light(make_light(LightKind::kRect, {1, 1, 1}));
  const auto first = b.build();
  EXPECT_EQ(first->unique_triangles(), 1u);
  EXPECT_EQ(first->materials().size(), 2u);
  const auto second = b.build();
  EXPECT_EQ(second->unique_triangles(), 0u);
  EXPECT_EQ(second->lights().size(), 0u);
  EXPECT_EQ(first->groups()[0].meshes.size(), 1u);
  EXPECT_EQ(first->view().material_program[0], static_cast<uint32_t>(ProgramId::kMetal));
}

TEST(SceneBuilder, FailedAdditionsLeaveIdsAlone) {
  SceneBuilder b;
  EXPECT_EQ(b.add_mesh(make_mesh(triangle())), 0u);
  MeshData bad = triangle();
  bad.indices[0] = 9;
  EXPECT_THROW(b.add_mesh(make_mesh(bad)), Error);
  EXPECT_EQ(b.add_mesh(make_mesh(triangle())), 1u);
  Light light = make_light(LightKind::kRect, {-1, 0, 0});
  EXPECT_THROW(b.add_light(light), Error);
  EXPECT_EQ(b.add_light(make_light(LightKind::kRect, {1, 1, 1})), 0u);
}

TEST(SceneBuilder, BoundsCoverInstances) {
  SceneBuilder b;
  const uint32_t group = b.add_group("group");
  b.add_to_group(group, b.add_mesh(make_mesh(box({-1, -1, -1}, {1, 1, 1}))));
  b.add_instance(0, group, translate(5, 0, 0) * scale(2, -1, 1));
  b.add_to_group(0, b.add_mesh(make_mesh(triangle())));
  const auto scene = b.build();
  EXPECT_EQ(scene->bounds().lo.x, 0);
  EXPECT_EQ(scene->bounds().hi.x, 7);
  EXPECT_EQ(scene->bounds().lo.y, -1);
  EXPECT_EQ(scene->bounds().hi.z, 1);
}

TEST(SceneBuilder, EmissiveFacesBecomeLights) {
  SceneBuilder b;
  Material lamp = make_material(ProgramId::kEmissive);
  lamp.emission = {1, 2, 3};
  const uint32_t glow = b.add_material(lamp);
  const uint32_t dull = b.add_material(make_material(ProgramId::kDiffuse));
  lamp.emission = {0, 0, 0};
  const uint32_t off = b.add_material(lamp);
  Material glossy = make_material(ProgramId::kDiffuse);
  glossy.emission = {5, 5, 5};
  const uint32_t diffuse = b.add_material(glossy);
  const uint32_t group = b.add_group("group");
  b.add_to_group(group, b.add_mesh(make_mesh(triangle(), dull)));
  MeshData two = triangle();
  two.triangle(2, 1, 0);
  two.face_materials = {dull, glow};
  b.add_to_group(group, b.add_mesh(make_mesh(two)));
  b.add_to_group(group, b.add_mesh(make_mesh(triangle())));  // the instance's material
  b.add_instance(0, group, translate(0, 0, 5), glow);
  b.add_instance(0, group, scale(2, 2, 2), off);
  b.add_to_group(0, b.add_mesh(make_mesh(triangle(), diffuse)));
  const auto scene = b.build();
  const SceneView view = scene->view();
  EXPECT_TRUE(view.has_emissive_meshes);
  const auto light_of = [&](uint32_t inst, uint32_t geom) {
    return view.emissive_lights[view.instances[inst].emissive + geom];
  };
  EXPECT_EQ(light_of(0, 0), kNoLight);
  EXPECT_EQ(light_of(1, 0), kNoLight);
  ASSERT_NE(light_of(1, 1), kNoLight);
  ASSERT_NE(light_of(1, 2), kNoLight);
  EXPECT_EQ(light_of(2, 2), kNoLight);
  const auto record = [&](uint32_t inst, uint32_t geom, uint32_t face) {
    const LightSet& set = scene->light_set();
    return set.triangles[light_of(inst, geom) + face - set.first_triangle()];
  };
  EXPECT_EQ(record(1, 1, 0).selection_pdf, 0);
  EXPECT_GT(record(1, 1, 1).selection_pdf, 0);
  EXPECT_FLOAT_EQ(std::fabs(record(1, 1, 1).m[2]), 0.5f);
  EXPECT_FLOAT_EQ(std::fabs(record(2, 1, 1).m[2]), 2.f);
  EXPECT_FLOAT_EQ(record(1, 2, 0).p[2], 5);
  EXPECT_FLOAT_EQ(record(1, 2, 0).radiance[1], 2);
}

}  // namespace
}  // namespace wavecomb
