// SPDX-License-Identifier: Apache-2.0
/// Curves, points and Gaussian splats for tests.
#pragma once

#include "scene_testing.h"
#include "wavecomb/geometry/curve/segment.h"
#include "wavecomb/geometry/gaussian_splat/gaussian_splat.h"

namespace wavecomb::curve_testing {

using namespace scene_testing;

/// Arrays of a curve or point mesh.
struct CurveData {
  Primitive primitive = Primitive::kCubicTube;
  std::vector<float> positions, radii, normals, uvs;
  std::vector<uint32_t> segments, materials;

  void point(const Vec3<float>& p, float radius, const Vec3<float>& n = {0, 0, 1}) {
    positions.insert(positions.end(), {p.x, p.y, p.z});
    normals.insert(normals.end(), {n.x, n.y, n.z});
    radii.push_back(radius);
  }
};

/// Makes a mesh that owns its arrays.
inline Mesh make_curves(CurveData data, uint32_t material = kInheritMaterial,
                        std::string name = "/World/curves") {
  const auto owner = std::make_shared<const CurveData>(std::move(data));
  Mesh mesh;
  mesh.name = std::move(name);
  mesh.primitive = owner->primitive;
  mesh.positions = owner->positions;
  mesh.radii = owner->radii;
  mesh.indices = owner->segments;
  if (mesh.is_ribbon()) mesh.normals = owner->normals;
  mesh.uvs = owner->uvs;
  if (!owner->uvs.empty()) mesh.uvs_at = Attribute::kCorner;
  mesh.face_materials = owner->materials;
  mesh.material = material;
  mesh.owner = owner;
  return mesh;
}

/// Makes `n` wavy curves of `segments` segments that start inside a ball of radius `size` and grow
/// outwards. For point primitives, makes as many spheres as the curves would have control points.
inline CurveData strands(Primitive primitive, uint32_t n, uint32_t segments, float size,
                         float radius, uint32_t seed) {
  CurveData data;
  data.primitive = primitive;
  std::mt19937 rng(seed);
  std::uniform_real_distribution<float> uniform(-1, 1);
  const bool cubic = primitive == Primitive::kCubicTube || primitive == Primitive::kCubicRibbon;
  const uint32_t step = cubic ? 3 : 1, points = step * segments + 1;
  const auto random = [&] { return Vec3<float>(uniform(rng), uniform(rng), uniform(rng)); };
  for (uint32_t c = 0; c < n; ++c) {
    const auto first = static_cast<uint32_t>(data.radii.size());
    Vec3<float> at = random() * size, along = random() * (size / static_cast<float>(points));
    Vec3<float> turn = along;
    for (uint32_t k = 0; k < points; ++k) {
      data.point(at, radius * (1.2f - static_cast<float>(k) / static_cast<float>(points)),
                 Vec3<float>(0, 0, 1) + random() * 0.3f);
      // To make cubic curves smooth at joints, use equal steps between control points before and
      // after a joint.
      if (!cubic || k % 3 != 2)
        turn = along + random() * (0.6f * size / static_cast<float>(points));
      if (cubic && k % 3 == 0 && k > 0)
        turn = at - Vec3<float>(data.positions[3 * (first + k) - 3],
                                data.positions[3 * (first + k) - 2],
                                data.positions[3 * (first + k) - 1]);
      at += turn;
    }
    if (primitive == Primitive::kSphere) continue;
    for (uint32_t k = 0; k < segments; ++k)
      data.segments.push_back((first + step * k) | (k > 0 ? kCurveContinuesBefore : 0u) |
                              (k + 1 < segments ? kCurveContinuesAfter : 0u));
  }
  return data;
}

inline const std::vector<Primitive>& curved_primitives() {
  static const std::vector<Primitive> all = {Primitive::kLinearTube, Primitive::kCubicTube,
                                             Primitive::kLinearRibbon, Primitive::kCubicRibbon,
                                             Primitive::kSphere};
  return all;
}

/// Arrays of Gaussian splats.
struct GaussianSplatData {
  std::vector<float> positions, scales, orientations, opacities, harmonics, radii;
  std::vector<GaussianSplatRow> rows;
  uint32_t degree = 0;
};

/// Makes a mesh that owns the arrays, including the packed splat rows.
inline Mesh make_gaussian_splats(GaussianSplatData data, uint32_t material,
                                 std::string name = "/World/splats") {
  data.rows = make_gaussian_splat_rows(data.scales, data.orientations, data.opacities, "splats");
  data.radii = gaussian_splat_radii(data.rows);
  const auto owner = std::make_shared<const GaussianSplatData>(std::move(data));
  Mesh mesh;
  mesh.name = std::move(name);
  mesh.primitive = Primitive::kGaussianSplat;
  mesh.positions = owner->positions;
  mesh.radii = owner->radii;
  mesh.splats = owner->rows;
  mesh.harmonics = owner->harmonics;
  mesh.harmonics_degree = owner->degree;
  mesh.material = material;
  mesh.owner = owner;
  return mesh;
}

/// Makes `n` random splats in a ball of radius `size`, with scales up to `scale`.
inline GaussianSplatData random_gaussian_splats(uint32_t n, float size, float scale,
                                                uint32_t degree, uint32_t seed) {
  GaussianSplatData data;
  data.degree = degree;
  std::mt19937 rng(seed);
  std::uniform_real_distribution<float> uniform(-1, 1);
  for (uint32_t i = 0; i < n; ++i) {
    for (int k = 0; k < 3; ++k) {
      data.positions.push_back(size * uniform(rng));
      data.scales.push_back(scale * (0.55f + 0.45f * uniform(rng)));
    }
    for (int k = 0; k < 4; ++k) data.orientations.push_back(2 * uniform(rng));
    data.opacities.push_back(i % 7 == 0 ? 0.002f : 0.5f + 0.5f * uniform(rng));
    for (uint32_t k = 0; k < 3 * (degree + 1) * (degree + 1); ++k)
      data.harmonics.push_back(uniform(rng));
  }
  return data;
}

/// Makes a scene of triangles, curves, points and Gaussian splats, with all kinds of primitives and
/// programs, textures, presence, and mirrored and stretched instances.
inline ScenePtr hairy() {
  SceneBuilder b;
  const uint32_t image = add_texture(b, 16, 8, 3, random_texels(16 * 8 * 3, 0.1f, 0.9f, 1));
  const uint32_t mask = add_texture(b, 8, 8, 1, random_texels(64, -0.2f, 1.2f, 6));
  std::vector<uint32_t> materials;
  Material m = make_material(ProgramId::kDiffuse, {0.6f, 0.5f, 0.4f});
  materials.push_back(b.add_material(m));
  m.textures[static_cast<size_t>(Input::kBaseColor)] = use(image);
  materials.push_back(b.add_material(m));
  materials.push_back(b.add_material(make_material(ProgramId::kDielectric, {1, 1, 1}, 0)));
  materials.push_back(b.add_material(make_material(ProgramId::kMetal, {0.9f, 0.7f, 0.3f}, 0.3f)));
  m = make_material(ProgramId::kPrincipled, {0.3f, 0.6f, 0.2f}, 0.5f);
  m.presence = true;
  m.opacity = 0.5f;
  materials.push_back(b.add_material(m));
  m.textures[static_cast<size_t>(Input::kOpacity)] = use(mask, 0);
  materials.push_back(b.add_material(m));
  m = make_material(ProgramId::kEmissive);
  m.emission = {2, 1, 0.5f};
  materials.push_back(b.add_material(m));
  b.add_to_group(0, b.add_mesh(make_mesh(ground(4, -1.2f), materials[0])));
  const uint32_t group = b.add_group("clump");
  uint32_t seed = 1;
  for (const Primitive primitive : curved_primitives()) {
    CurveData data = strands(primitive, 12, 4, 1.f, 0.05f, seed++);
    const size_t count = make_curves(data).primitive_count();
    for (size_t i = 0; i < count; ++i) data.materials.push_back(materials[i % materials.size()]);
    std::mt19937 rng(seed);
    data.uvs.resize((primitive == Primitive::kSphere ? 2 : 4) * count);
    for (float& x : data.uvs) x = static_cast<float>(rng() % 1000) * 1e-3f;
    b.add_to_group(0, b.add_mesh(make_curves(std::move(data))));
    b.add_to_group(group, b.add_mesh(make_curves(strands(primitive, 6, 3, 0.5f, 0.04f, seed++))));
  }
  b.add_to_group(0, b.add_mesh(make_gaussian_splats(random_gaussian_splats(40, 1.2f, 0.3f, 3, 70),
                                                    materials[6])));
  b.add_to_group(group, b.add_mesh(make_gaussian_splats(
                            random_gaussian_splats(9, 0.5f, 0.2f, 1, 71), materials[6])));
  for (uint32_t i = 0; i < materials.size(); ++i) {
    const float x = -1.8f + 0.6f * static_cast<float>(i);
    b.add_instance(0, group,
                   translate(x, 0.4f - 0.2f * x, -0.5f) * rotate(1, 40.0 * i) *
                       scale(i % 2 ? -1.f : 1.f, 0.6f, 1.1f),
                   materials[i]);
  }
  b.add_light(make_light(LightKind::kDome, {0.5f, 0.6f, 0.8f}));
  Light rect = make_light(LightKind::kRect, {9, 9, 8}, translate(0, 3, 1) * rotate(0, -80));
  b.add_light(rect);
  b.set_camera(make_camera({0, 0.6, 4}, {0, -0.1, 0}, 0.9f));
  return b.build();
}

}  // namespace wavecomb::curve_testing
