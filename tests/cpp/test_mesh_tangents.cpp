// SPDX-License-Identifier: Apache-2.0
/// Smoothly interpolated tangents: meshes that have them, where they are split, and their
/// orientation.
#include "wavecomb/geometry/mesh/tangents.h"

#include "lane_testing.h"
#include "scene_testing.h"
#include "wavecomb/core/encoding/octahedral.h"
#include "wavecomb/geometry/hit/surface.h"
#include "wavecomb/scene/parallel.h"

namespace wavecomb {
namespace {

using namespace scene_testing;
using lane_testing::same_bits;
using V = Vec3<float>;

Material brushed() {
  Material m = make_material(ProgramId::kOpenPbr, {0.8f, 0.8f, 0.8f}, 0.3f);
  m.metallic = 1;
  m.openpbr.anisotropy = 0.8f;
  return m;
}

/// Makes a scene of one mesh with one instance, transformed by `to_world`.
ScenePtr one_mesh(const MeshData& data, const Material& material, const Affine& to_world = {}) {
  SceneBuilder b;
  const uint32_t group = b.add_group("group");
  b.add_to_group(group, b.add_mesh(make_mesh(data, b.add_material(material))));
  b.add_instance(0, group, to_world);
  return b.build();
}

Surface<float> surface_at(const Scene& scene, uint32_t prim, float u, float v) {
  return setup_surface<float>(scene.view(), {1, 0, prim, u, v}, {0, -1, 0}, true, false, true);
}
V normalized(const V& v) {
  return v * (1 / length(v));
}
/// Returns the tangent in the plane of the shading normal, as shading frames use it.
V grain(const Surface<float>& s) {
  return make_frame<float>(s.ns, s.dpdu, s.handedness).s;
}
double degrees_between(const V& a, const V& b) {
  return std::acos(std::clamp(double{dot(normalized(a), normalized(b))}, -1.0, 1.0)) * 180 / kPiD;
}

/// Whether a triangle of sphere() touches a pole or the seam, where tangents are one-sided.
bool is_outermost(const Mesh& mesh, uint32_t prim) {
  for (size_t k = 0; k < 3; ++k) {
    const float* uv = &mesh.uvs[2 * mesh.indices[3 * prim + k]];
    if (uv[0] == 0 || uv[0] == 1 || uv[1] == 0 || uv[1] == 1) return true;
  }
  return false;
}

TEST(Directions, ComeBackFromTheirCodes) {
  std::mt19937 rng(5);
  std::normal_distribution<float> normal;
  for (int i = 0; i < 20000; ++i) {
    V v{normal(rng), normal(rng), normal(rng)};
    if (i < 27) v = {float(i % 3 - 1), float(i / 3 % 3 - 1), float(i / 9 - 1)};
    const uint32_t code = encode_direction(v);
    const V back = decode_direction<float>(code);
    if (length(v) == 0) {
      EXPECT_EQ(code, kNoDirection);
      EXPECT_EQ(length(back), 0);
      continue;
    }
    ASSERT_NEAR(length(back), 1, 1e-6);
    ASSERT_LT(length(back - normalized(v)), 7e-5f) << v.x << " " << v.y << " " << v.z;
  }
  EXPECT_EQ(encode_direction({kNan, 1, 0}), kNoDirection);
  EXPECT_EQ(encode_direction({kInf, 1, 0}), kNoDirection);
}

TEST(Tangents, OnlyMeshesWhoseMaterialAsksHaveThem) {
  const Material plain = make_material(ProgramId::kOpenPbr);
  EXPECT_EQ(one_mesh(sphere(6, true), plain)->view().tangents, nullptr);
  EXPECT_NE(one_mesh(sphere(6, true), brushed())->view().tangents, nullptr);
  EXPECT_EQ(one_mesh(sphere(6, false), brushed())->view().tangents, nullptr);  // flat
  MeshData without = sphere(6, true);
  without.uvs.clear();
  without.uvs_at = Attribute::kNone;
  EXPECT_EQ(one_mesh(without, brushed())->view().tangents, nullptr);

  SceneBuilder b;
  const uint32_t image = add_texture(b, 2, 2, 3, std::vector<float>(12, 0.5f));
  Material mapped = make_material(ProgramId::kPlastic);
  mapped.textures[static_cast<size_t>(Input::kNormal)] = use(image);
  const uint32_t grey = b.add_material(plain), metal = b.add_material(mapped);
  MeshData by_face = sphere(4, true);
  by_face.face_materials.assign(by_face.indices.size() / 3, grey);
  by_face.face_materials[3] = metal;
  b.add_to_group(0, b.add_mesh(make_mesh(sphere(4, true), grey)));
  b.add_to_group(0, b.add_mesh(make_mesh(by_face)));
  const uint32_t group = b.add_group("inherits");
  b.add_to_group(group, b.add_mesh(make_mesh(sphere(4, true))));
  b.add_instance(0, group, {}, grey);
  b.add_instance(0, group, translate(3, 0, 0), metal);
  const auto scene = b.build();
  ASSERT_NE(scene->view().tangents, nullptr);
  EXPECT_EQ(scene->view().tangents[0].codes, 0u);
  EXPECT_NE(scene->view().tangents[1].codes, 0u);
  EXPECT_NE(scene->view().tangents[2].codes, 0u);
}

/// Anisotropy along circles of latitude: the true direction is known at each point.
TEST(Tangents, ACoarseSphereIsBrushedAsAFineOne) {
  constexpr uint32_t kRings = 8;
  const MeshData ball = sphere(kRings, true);
  const auto smooth = one_mesh(ball, brushed()),
             flat = one_mesh(ball, make_material(ProgramId::kOpenPbr));
  double worst_smooth = 0, worst_flat = 0;
  std::mt19937 rng(3);
  std::uniform_real_distribution<float> uniform(0, 1);
  for (uint32_t prim = 0; prim < ball.indices.size() / 3; ++prim)
    for (int i = 0; i < 20; ++i) {
      float u = uniform(rng), v = uniform(rng);
      if (u + v > 1) u = 1 - u, v = 1 - v;
      const Surface<float> s = surface_at(*smooth, prim, u, v), f = surface_at(*flat, prim, u, v);
      EXPECT_TRUE(same_bits(s.uv_per_length, f.uv_per_length));
      EXPECT_EQ(s.handedness, 1);
      if (is_outermost(smooth->meshes()[0], prim)) continue;
      const V truth{s.ns.z, 0, -s.ns.x};
      worst_smooth = std::max(worst_smooth, degrees_between(grain(s), truth));
      worst_flat = std::max(worst_flat, degrees_between(grain(f), truth));
    }
  EXPECT_LT(worst_smooth, 3.5);
  EXPECT_GT(worst_flat, 8);
}

/// Two adjacent squares whose texture is mirrored at the shared edge.
MeshData mirrored_pair() {
  MeshData m;
  for (int i = 0; i < 6; ++i) m.vertex(float(i % 3 - 1), 0, -float(i / 3));
  m.triangle(0, 1, 4);
  m.triangle(0, 4, 3);
  m.triangle(1, 2, 5);
  m.triangle(1, 5, 4);
  for (int i = 0; i < 6; ++i) {
    m.uvs.insert(m.uvs.end(), {std::abs(float(i % 3 - 1)), float(i / 3)});
    m.normals.insert(m.normals.end(), {0, 1, 0});
  }
  m.uvs_at = m.normals_at = Attribute::kVertex;
  return m;
}

TEST(Tangents, AreSplitWhereTheTextureIsMirroredAndAtEdges) {
  const MeshTangents mirrored = make_tangents(make_mesh(mirrored_pair()));
  ASSERT_TRUE(mirrored.at_corners);
  for (size_t corner = 0; corner < 12; ++corner)
    EXPECT_LT(
        length(decode_direction<float>(mirrored.codes[corner]) - V(corner < 6 ? -1 : 1, 0, 0)),
        1e-4f);
  EXPECT_FALSE(make_tangents(make_mesh(sphere(6, true))).at_corners);

  // A roof of two slopes with u from eaves to eaves: one tangent at the ridge, or two if separate
  // normals make it a sharp edge.
  MeshData roof;
  for (int i = 0; i < 6; ++i) roof.vertex(float(i % 3 - 1), i % 3 == 1 ? 1.f : 0.f, -float(i / 3));
  roof.indices = mirrored_pair().indices;
  for (int i = 0; i < 6; ++i) roof.uvs.insert(roof.uvs.end(), {float(i % 3 - 1), float(i / 3)});
  roof.uvs_at = Attribute::kVertex;
  const float h = std::sqrt(0.5f);
  for (int i = 0; i < 6; ++i)
    roof.normals.insert(roof.normals.end(), {float(i % 3 - 1) * h, i % 3 == 1 ? 1 : h, 0});
  roof.normals_at = Attribute::kVertex;
  const MeshTangents round = make_tangents(make_mesh(roof));
  ASSERT_FALSE(round.at_corners);
  EXPECT_LT(length(decode_direction<float>(round.codes[1]) - V(1, 0, 0)), 1e-4f);
  roof.normals.clear();
  for (int i = 0; i < 12; ++i) roof.normals.insert(roof.normals.end(), {i < 6 ? -h : h, h, 0});
  roof.normals_at = Attribute::kCorner;
  const MeshTangents sharp = make_tangents(make_mesh(roof));
  ASSERT_TRUE(sharp.at_corners);
  for (size_t corner = 0; corner < 12; ++corner)
    EXPECT_LT(length(decode_direction<float>(sharp.codes[corner]) - V(h, corner < 6 ? h : -h, 0)),
              1e-4f);
}

TEST(Tangents, WhatCancelsOutIsTheTrianglesOwn) {
  // All triangles at a pole share one vertex with one texture coordinate.
  MeshData fan;
  fan.vertex(0, 1, 0);
  for (int i = 0; i < 6; ++i) {
    const double a = i * kPiD / 3;
    fan.vertex(float(std::cos(a)), 0, -float(std::sin(a)));
    fan.triangle(0, 1 + uint32_t(i), 1 + uint32_t(i + 1) % 6);
  }
  fan.normals.assign(21, 0);
  for (size_t i = 1; i < 21; i += 3) fan.normals[i] = 1;
  fan.normals_at = Attribute::kVertex;
  // Use texture coordinates per corner, so that u increases around the fan without wrapping back to
  // 0.
  for (int i = 0; i < 6; ++i)
    fan.uvs.insert(fan.uvs.end(), {0.5f, 1, float(i) / 6, 0, float(i + 1) / 6, 0});
  fan.uvs_at = Attribute::kCorner;
  EXPECT_EQ(make_tangents(make_mesh(fan)).codes[0], kNoDirection);
  const auto scene = one_mesh(fan, brushed());
  for (uint32_t prim = 0; prim < 6; ++prim)
    for (const float u : {0.f, 1e-3f, 0.4f}) {
      const Surface<float> s = surface_at(*scene, prim, u, u);
      EXPECT_TRUE(length(s.dpdu) > 0 && std::isfinite(length(s.dpdu)));
    }
}

/// The axis t of the frame points along v for any transform of the mesh and of its texture.
TEST(Tangents, FramesAreTurnedAsTheTextureIs) {
  MeshData ball = sphere(6, true), turned = ball;
  for (size_t i = 0; i < turned.uvs.size(); i += 2) turned.uvs[i] = 1 - turned.uvs[i];
  const Affine places[] = {Affine{}, rotate(1, 40) * scale(2, 1, 0.5f), scale(-1, 1, 1),
                           rotate(0, 20) * scale(1, -2, 1), scale(-1, -1, 1)};
  for (const Material& material : {brushed(), make_material(ProgramId::kOpenPbr)})
    for (const MeshData* data : {&ball, &turned})
      for (const Affine& place : places) {
        const auto scene = one_mesh(*data, material, place);
        const float side = place.determinant() < 0 ? -1.f : 1.f;
        for (uint32_t prim = 0; prim < data->indices.size() / 3; ++prim) {
          const Surface<float> s = surface_at(*scene, prim, 0.3f, 0.3f);
          ASSERT_EQ(s.handedness, data == &ball ? side : -side);
          // v increases towards the top of the sphere.
          const V up = place.vector(V(0, 1, 0));
          const Frame<float> f = make_frame<float>(s.ns, s.dpdu, s.handedness);
          const V v = normalized(up - s.ns * dot(s.ns, up));
          if (std::abs(dot(normalized(up), s.ns)) > 0.8f) continue;
          ASSERT_GT(dot(f.t, v), 0.5f) << prim;
        }
      }
}

/// Makes a sphere that rotates while the shutter is open.
Mesh spinning(uint32_t material) {
  MeshData data = sphere(5, true);
  MeshData later = data;
  later.transform(rotate(1, 60));
  data.positions.insert(data.positions.end(), later.positions.begin(), later.positions.end());
  data.normals = data.positions;
  Mesh mesh = make_mesh(std::move(data), material);
  mesh.steps = 2;
  return mesh;
}

TEST(Tangents, TurnWithAMeshThatDeforms) {
  SceneBuilder b;
  const uint32_t group = b.add_group("group");
  b.add_to_group(group, b.add_mesh(spinning(b.add_material(brushed()))));
  b.add_instance(0, group, {});
  const auto scene = b.build();
  for (const float time : {0.f, 0.5f, 1.f})
    for (uint32_t prim = 0; prim < scene->meshes()[0].triangle_count(); ++prim) {
      if (is_outermost(scene->meshes()[0], prim)) continue;
      const Surface<float> s = setup_surface<float>(scene->view(), {1, 0, prim, 0.3f, 0.3f, time},
                                                    {0, -1, 0}, true, false, true);
      ASSERT_LT(degrees_between(grain(s), {s.ns.z, 0, -s.ns.x}), 4) << time;
    }
}

TEST(Tangents, LanesAgree) {
  SceneBuilder b;
  const uint32_t metal = b.add_material(brushed()),
                 plain = b.add_material(make_material(ProgramId::kOpenPbr));
  const uint32_t group = b.add_group("group");
  for (const MeshData& m : {sphere(5, true), mirrored_pair(), sphere(4, false)})
    b.add_to_group(group, b.add_mesh(make_mesh(m, metal)));
  b.add_to_group(group, b.add_mesh(spinning(metal)));
  b.add_to_group(group, b.add_mesh(make_mesh(sphere(4, true), plain)));
  b.add_instance(0, group, rotate(0, 20));
  b.add_instance(0, group, rotate(1, 40) * scale(-1, 2, 1));
  const auto scene = b.build();
  const SceneView view = scene->view();
  constexpr size_t kCount = 1024;
  std::vector<uint32_t> inst(kCount), mesh(kCount), prim(kCount);
  std::vector<float> u(kCount), v(kCount), time(kCount);
  std::mt19937 rng(9);
  std::uniform_real_distribution<float> uniform(0, 0.5f);
  for (size_t i = 0; i < kCount; ++i) {
    inst[i] = 1 + static_cast<uint32_t>(rng() % 2);
    mesh[i] = static_cast<uint32_t>(rng() % 5);
    prim[i] = static_cast<uint32_t>(rng() % scene->meshes()[mesh[i]].triangle_count());
    u[i] = uniform(rng);
    v[i] = uniform(rng);
    time[i] = 2 * uniform(rng);
  }
  lane_testing::for_each_packet([&]<typename F>() {
    for (size_t i = 0; i < kCount; i += kWidth<F>) {
      const Mask<F> active = first_lanes<F>(1 + rng() % kWidth<F>);
      const Surface<F> s = setup_surface<F>(
          view,
          {load<UInt<F>>(&inst[i]), load<UInt<F>>(&mesh[i]), load<UInt<F>>(&prim[i]),
           load<F>(&u[i]), load<F>(&v[i]), load<F>(&time[i])},
          Vec3<F>(F(0.f), F(-1.f), F(0.f)), true, false, active);
      const uint32_t bits = lane_bits<F>(active);
      for (size_t k = 0; k < kWidth<F>; ++k) {
        if ((bits >> k & 1u) == 0) continue;
        const Surface<float> one = setup_surface<float>(
            view, {inst[i + k], mesh[i + k], prim[i + k], u[i + k], v[i + k], time[i + k]},
            {0, -1, 0}, true, false, true);
        ASSERT_TRUE(same_bits(one.dpdu.x, lane(s.dpdu.x, k)) &&
                    same_bits(one.dpdu.y, lane(s.dpdu.y, k)) &&
                    same_bits(one.dpdu.z, lane(s.dpdu.z, k)) &&
                    same_bits(one.handedness, lane(s.handedness, k)));
      }
    }
  });
}

TEST(Tangents, ThreadsChangeNoBit) {
  const Mesh mesh = make_mesh(sphere(200, true));
  ASSERT_GT(mesh.triangle_count(), 2u * 65536u);
  MeshTangents one, many;
  with_threads(1, [&] { one = make_tangents(mesh); });
  with_threads(4, [&] { many = make_tangents(mesh); });
  EXPECT_EQ(one.codes, many.codes);
}

TEST(Tangents, AnEditedSceneHasThoseOfOneBuiltAnew) {
  const MeshData ball = sphere(6, true);
  const auto before = one_mesh(ball, make_material(ProgramId::kOpenPbr)),
             anew = one_mesh(ball, brushed());
  Material metal = brushed();
  const auto edited = before->edited({.materials = {{0, metal}}});
  ASSERT_NE(edited->view().tangents, nullptr);
  EXPECT_EQ(edited->bytes().meshes, anew->bytes().meshes);
  const auto codes = [&](const Scene& scene) {
    const auto* p = reinterpret_cast<const uint32_t*>(scene.view().tangents[0].codes);
    return std::vector<uint32_t>(p, p + ball.positions.size() / 3);
  };
  EXPECT_EQ(codes(*edited), codes(*anew));
  // An edited scene shares tangents if the edit does not affect them, and drops them if no material
  // needs them.
  metal.base_color = {1, 0, 0};
  EXPECT_EQ(edited->edited({.materials = {{0, metal}}})->view().tangents, edited->view().tangents);
  metal.openpbr.anisotropy = 0;
  EXPECT_EQ(edited->edited({.materials = {{0, metal}}})->view().tangents, nullptr);
}

}  // namespace
}  // namespace wavecomb
