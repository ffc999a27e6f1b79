// SPDX-License-Identifier: Apache-2.0
/// Small scenes for tests, and statistics of rendered images.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <limits>
#include <memory>
#include <random>
#include <stdexcept>
#include <string>
#include <vector>

#include "numbers_testing.h"
#include "wavecomb/core/error.h"
#include "wavecomb/light/kinds/kinds.h"
#include "wavecomb/render/renderer.h"
#include "wavecomb/render/snapshot.h"
#include "wavecomb/render/statistics/render_statistics.h"
#include "wavecomb/scene/scene.h"

namespace wavecomb::scene_testing {

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
inline constexpr bool kSanitized = true;
#else
inline constexpr bool kSanitized = false;
#endif
/// Returns `n`, or n / divisor under sanitizers, which slow tests down about twenty times.
inline constexpr uint32_t size_for_build(uint32_t n, uint32_t divisor = 8) {
  return kSanitized ? std::max(1u, n / divisor) : n;
}

using numbers_testing::kInf;
using numbers_testing::kNan;
using numbers_testing::kPiD;
using numbers_testing::scale;
using numbers_testing::translate;

// ---- transforms -------------------------------------------------------------------------------

/// Rotates by `degrees` about x (0), y (1) or z (2).
inline Affine rotate(int axis, double degrees) {
  const auto c = static_cast<float>(std::cos(degrees * kPiD / 180));
  const auto s = static_cast<float>(std::sin(degrees * kPiD / 180));
  if (axis == 0) return {{{1, 0, 0}, {0, c, -s}, {0, s, c}}, {0, 0, 0}};
  if (axis == 1) return {{{c, 0, s}, {0, 1, 0}, {-s, 0, c}}, {0, 0, 0}};
  return {{{c, -s, 0}, {s, c, 0}, {0, 0, 1}}, {0, 0, 0}};
}
/// Returns the transform of a camera at `eye` that looks at `at`. Its y axis points up, or along -z
/// if it looks straight down.
inline Affine look_at(const std::array<double, 3>& eye, const std::array<double, 3>& at) {
  using V = std::array<double, 3>;
  const auto cross = [](const V& a, const V& b) {
    return V{a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
  };
  const auto unit = [](const V& a) {
    const double l = std::sqrt(a[0] * a[0] + a[1] * a[1] + a[2] * a[2]);
    return V{a[0] / l, a[1] / l, a[2] / l};
  };
  const V z = unit({eye[0] - at[0], eye[1] - at[1], eye[2] - at[2]});
  const V up = std::abs(z[1]) > 0.999 ? V{0, 0, -1} : V{0, 1, 0};
  const V x = unit(cross(up, z)), y = cross(z, x);
  const auto f = [](double v) { return static_cast<float>(v); };
  return {{{f(x[0]), f(y[0]), f(z[0])}, {f(x[1]), f(y[1]), f(z[1])}, {f(x[2]), f(y[2]), f(z[2])}},
          {f(eye[0]), f(eye[1]), f(eye[2])}};
}
/// Makes a camera whose image plane at z = -1 is `size` wide and high.
inline Camera make_camera(const std::array<double, 3>& eye, const std::array<double, 3>& at,
                          float size = 1) {
  Camera camera;
  camera.to_world = look_at(eye, at);
  for (int i = 0; i < 4; ++i) camera.window[i] = (i % 2 == 0 ? -0.5f : 0.5f) * size;
  return camera;
}

// ---- meshes -----------------------------------------------------------------------------------

/// Arrays of a mesh.
struct MeshData {
  std::vector<float> positions, normals, uvs;
  std::vector<uint32_t> indices, face_materials;
  Attribute normals_at = Attribute::kNone, uvs_at = Attribute::kNone;

  uint32_t vertex(float x, float y, float z) {
    positions.insert(positions.end(), {x, y, z});
    return static_cast<uint32_t>(positions.size() / 3 - 1);
  }
  void triangle(uint32_t a, uint32_t b, uint32_t c) { indices.insert(indices.end(), {a, b, c}); }
  /// Transforms all points.
  MeshData& transform(const Affine& m) {
    for (size_t i = 0; i < positions.size(); i += 3) {
      const Vec3<float> p = m.point({positions[i], positions[i + 1], positions[i + 2]});
      positions[i] = p.x;
      positions[i + 1] = p.y;
      positions[i + 2] = p.z;
    }
    return *this;
  }
};

/// Makes a Mesh that owns its arrays.
inline Mesh make_mesh(MeshData data, uint32_t material = kInheritMaterial,
                      std::string name = "/World/mesh") {
  const auto owner = std::make_shared<const MeshData>(std::move(data));
  Mesh mesh;
  mesh.name = std::move(name);
  mesh.positions = owner->positions;
  mesh.indices = owner->indices;
  mesh.normals = owner->normals;
  mesh.normals_at = owner->normals_at;
  mesh.uvs = owner->uvs;
  mesh.uvs_at = owner->uvs_at;
  mesh.face_materials = owner->face_materials;
  mesh.material = material;
  mesh.owner = owner;
  return mesh;
}

/// Makes a parallelogram, counter-clockwise seen from the side that u x v points to.
inline MeshData quad(const Vec3<float>& p, const Vec3<float>& u, const Vec3<float>& v) {
  MeshData m;
  m.vertex(p.x, p.y, p.z);
  m.vertex(p.x + u.x, p.y + u.y, p.z + u.z);
  m.vertex(p.x + u.x + v.x, p.y + u.y + v.y, p.z + u.z + v.z);
  m.vertex(p.x + v.x, p.y + v.y, p.z + v.z);
  m.triangle(0, 1, 2);
  m.triangle(0, 2, 3);
  m.uvs = {0, 0, 1, 0, 1, 1, 0, 1};
  m.uvs_at = Attribute::kVertex;
  return m;
}
/// Makes a square in the plane y = `y` that faces up.
inline MeshData ground(float half, float y = 0) {
  return quad({-half, y, half}, {2 * half, 0, 0}, {0, 0, -2 * half});
}

/// Makes a closed box of 12 triangles with outward winding, two per side in the order -x +x -y +y
/// -z +z.
inline MeshData box(const Vec3<float>& lo, const Vec3<float>& hi) {
  MeshData m;
  for (int i = 0; i < 8; ++i)
    m.vertex(i & 1 ? hi.x : lo.x, i & 2 ? hi.y : lo.y, i & 4 ? hi.z : lo.z);
  constexpr uint32_t kSides[6][4] = {{0, 4, 6, 2}, {1, 3, 7, 5}, {0, 1, 5, 4},
                                     {2, 6, 7, 3}, {0, 2, 3, 1}, {4, 5, 7, 6}};
  for (const auto& s : kSides) {
    m.triangle(s[0], s[1], s[2]);
    m.triangle(s[0], s[2], s[3]);
  }
  return m;
}

/// Makes a closed unit sphere of n x 2n quads, n > 1, with its poles on the y axis, with or without
/// vertex normals.
inline MeshData sphere(uint32_t n, bool smooth) {
  MeshData m;
  for (uint32_t j = 0; j <= n; ++j)
    for (uint32_t i = 0; i <= 2 * n; ++i) {
      const double theta = kPiD * j / n, phi = kPiD * (i % (2 * n)) / n;
      const double r = j == 0 || j == n ? 0 : std::sin(theta);
      const uint32_t a =
          m.vertex(static_cast<float>(r * std::cos(phi)), static_cast<float>(std::cos(theta)),
                   static_cast<float>(-r * std::sin(phi)));
      m.uvs.insert(m.uvs.end(),
                   {static_cast<float>(i) / (2.f * n), 1.f - static_cast<float>(j) / n});
      if (i == 2 * n || j == n) continue;
      const uint32_t b = a + 2 * n + 1;
      if (j + 1 < n) m.triangle(a, b, b + 1);
      if (j > 0) m.triangle(a, b + 1, a + 1);
    }
  m.uvs_at = Attribute::kVertex;
  if (smooth) {
    m.normals = m.positions;
    m.normals_at = Attribute::kVertex;
  }
  return m;
}

/// Makes `n` random triangles in [-1, 1]^3 with edges of about length `size`.
inline MeshData soup(uint32_t n, uint32_t seed, float size = 0.4f) {
  MeshData m;
  std::mt19937 rng(seed);
  std::uniform_real_distribution<float> uniform(-1, 1);
  for (uint32_t i = 0; i < n; ++i) {
    const float x = uniform(rng), y = uniform(rng), z = uniform(rng);
    for (int k = 0; k < 3; ++k) {
      const float a = uniform(rng), b = uniform(rng), c = uniform(rng);
      m.vertex(x + size * a, y + size * b, z + size * c);
    }
    m.triangle(3 * i, 3 * i + 1, 3 * i + 2);
  }
  return m;
}

/// Makes n x n quads over [0, n]^2 with shared vertices and random heights along y.
inline MeshData grid(uint32_t n, float bump, uint32_t seed) {
  MeshData m;
  std::mt19937 rng(seed);
  std::uniform_real_distribution<float> uniform(-bump, bump);
  for (uint32_t j = 0; j <= n; ++j)
    for (uint32_t i = 0; i <= n; ++i)
      m.vertex(static_cast<float>(i), bump > 0 ? uniform(rng) : 0.f, static_cast<float>(j));
  for (uint32_t j = 0; j < n; ++j)
    for (uint32_t i = 0; i < n; ++i) {
      const uint32_t a = j * (n + 1) + i, b = a + n + 1;
      m.triangle(a, b, b + 1);
      m.triangle(a, b + 1, a + 1);
    }
  return m;
}

// ---- materials, lights ------------------------------------------------------------------------

inline Material make_material(ProgramId program, const Vec3<float>& color = {0.5f, 0.5f, 0.5f},
                              float roughness = 0.5f) {
  Material m;
  m.name = "/World/material";
  m.program = program;
  m.base_color = color;
  m.roughness = roughness;
  return m;
}
/// Makes a material that emits and is a Lambertian reflector: a principled surface with a
/// refractive index of 1.
inline Material glowing(float albedo, float radiance) {
  Material m = make_material(ProgramId::kPrincipled, Vec3<float>(albedo), 1);
  m.emission = Vec3<float>(radiance);
  m.ior = 1;
  return m;
}
inline Light make_light(LightKind kind, const Vec3<float>& color, const Affine& to_world = {}) {
  Light light;
  light.name = "/World/light";
  light.kind = kind;
  light.color = color;
  light.to_world = to_world;
  return light;
}
inline uint32_t add_texture(SceneBuilder& b, uint32_t width, uint32_t height, uint32_t channels,
                            const std::vector<float>& texels, Wrap wrap = Wrap::kRepeat) {
  return b.add_texture(
      {"texture", texels.data(), width, height, channels, TexelFormat::kF32, false, wrap, wrap});
}
inline TextureUse use(uint32_t texture, uint32_t channel = 4) {
  TextureUse u;
  u.texture = texture;
  u.channel = channel;
  return u;
}
inline std::vector<float> random_texels(size_t n, float lo, float hi, uint32_t seed) {
  std::mt19937 rng(seed);
  std::uniform_real_distribution<float> uniform(lo, hi);
  std::vector<float> texels(n);
  for (float& x : texels) x = uniform(rng);
  return texels;
}

// ---- scenes -----------------------------------------------------------------------------------

using ScenePtr = std::shared_ptr<const Scene>;

/// An open box of diffuse walls with two boxes inside and a rect light below the ceiling.
inline ScenePtr cornell() {
  SceneBuilder b;
  const uint32_t white = b.add_material(make_material(ProgramId::kDiffuse, {0.7f, 0.7f, 0.7f}));
  const uint32_t red = b.add_material(make_material(ProgramId::kDiffuse, {0.6f, 0.1f, 0.1f}));
  const uint32_t green = b.add_material(make_material(ProgramId::kDiffuse, {0.1f, 0.6f, 0.1f}));
  const auto add = [&](const MeshData& m, uint32_t material) {
    b.add_to_group(0, b.add_mesh(make_mesh(m, material)));
  };
  MeshData room = box({-1, -1, -1}, {1, 1, 1});
  room.indices.resize(30);  // open towards +z
  room.face_materials = {red, red, green, green, white, white, white, white, white, white};
  b.add_to_group(0, b.add_mesh(make_mesh(room)));
  MeshData tall = box({-0.3f, -0.6f, -0.3f}, {0.3f, 0.6f, 0.3f});
  add(tall.transform(translate(-0.35f, -0.4f, -0.3f) * rotate(1, 18)), white);
  MeshData low = box({-0.3f, -0.3f, -0.3f}, {0.3f, 0.3f, 0.3f});
  add(low.transform(translate(0.35f, -0.7f, 0.3f) * rotate(1, -17)), white);
  Light light = make_light(LightKind::kRect, {12, 11, 9}, translate(0, 0.99f, 0) * rotate(0, -90));
  light.width = light.height = 0.5f;
  b.add_light(light);
  b.set_camera(make_camera({0, 0, 3.6}, {0, 0, 0}, 0.9f));
  return b.build();
}

/// A scene with all six programs, textures, instances (also mirrored and stretched) and every kind
/// of light. One material has the given opacity.
inline ScenePtr mixed(float opacity = 0.4f) {
  SceneBuilder b;
  const uint32_t image = add_texture(b, 16, 8, 3, random_texels(16 * 8 * 3, 0.1f, 0.9f, 1));
  const uint32_t grey = add_texture(b, 8, 8, 1, random_texels(64, 0.05f, 0.8f, 2));
  const uint32_t bumps = add_texture(b, 8, 8, 3, random_texels(64 * 3, 0.3f, 0.7f, 3));
  const uint32_t sky = add_texture(b, 16, 8, 3, random_texels(16 * 8 * 3, 0.f, 1.5f, 4));
  std::vector<uint32_t> materials;
  const auto add = [&](const Material& m) { materials.push_back(b.add_material(m)); };
  const auto at = [](Material& m, Input s) -> TextureUse& {
    return m.textures[static_cast<size_t>(s)];
  };

  Material m = make_material(ProgramId::kDiffuse, {0.6f, 0.5f, 0.4f});
  at(m, Input::kBaseColor) = use(image);
  add(m);
  m = make_material(ProgramId::kMetal, {0.9f, 0.7f, 0.3f}, 0.3f);
  at(m, Input::kRoughness) = use(grey, 0);
  add(m);
  m = make_material(ProgramId::kMetal, {}, 0.15f);
  m.conductor_eta = {0.2f, 0.92f, 1.1f};
  m.conductor_k = {3.9f, 2.45f, 2.14f};
  add(m);
  add(make_material(ProgramId::kDielectric, {1, 1, 1}, 0));
  add(make_material(ProgramId::kDielectric, {0.9f, 1, 0.95f}, 0.4f));
  m = make_material(ProgramId::kPlastic, {0.1f, 0.3f, 0.7f}, 0.2f);
  at(m, Input::kNormal) = use(bumps);
  at(m, Input::kNormal).scale = {2, 2, 2, 1};
  at(m, Input::kNormal).bias = {-1, -1, -1, 0};
  add(m);
  m = make_material(ProgramId::kEmissive);
  m.emission = {3, 2, 1};
  add(m);
  m = make_material(ProgramId::kPrincipled, {0.7f, 0.4f, 0.2f}, 0.35f);
  m.metallic = 0.4f;
  m.clearcoat = 0.7f;
  m.clearcoat_roughness = 0.1f;
  at(m, Input::kBaseColor) = use(image);
  at(m, Input::kBaseColor).uv = {3, 1, 0.2f, -1, 2, 0.1f};
  at(m, Input::kMetallic) = use(grey, 0);
  add(m);
  m = make_material(ProgramId::kPrincipled, {0.2f, 0.6f, 0.3f}, 0.6f);
  m.opacity = opacity;
  add(m);
  m = make_material(ProgramId::kPrincipled, {0.1f, 0.1f, 0.1f}, 0.6f);
  at(m, Input::kEmission) = use(image);
  add(m);

  b.add_to_group(0, b.add_mesh(make_mesh(ground(6, -1), materials[0])));
  const uint32_t ball = b.add_group("ball"), block = b.add_group("block");
  b.add_to_group(ball, b.add_mesh(make_mesh(sphere(8, true))));
  MeshData cube = box({-1, -1, -1}, {1, 1, 1});
  for (uint32_t f = 0; f < 12; ++f)
    cube.face_materials.push_back(f < 4 ? kInheritMaterial : materials[f % 3 + 5]);
  b.add_to_group(block, b.add_mesh(make_mesh(cube)));
  b.add_to_group(block, b.add_mesh(make_mesh(sphere(5, false).transform(translate(0, 1.8f, 0)))));
  uint32_t i = 0;
  for (const uint32_t material : materials) {
    const float x = -2.4f + 1.2f * static_cast<float>(i % 5), z = i < 5 ? 0.6f : -1.2f;
    const Affine turn = rotate(1, 31.0 * i) * rotate(0, 12.0 * i);
    const float s = 0.42f + 0.02f * static_cast<float>(i);
    if (i % 3 == 2)
      b.add_instance(0, block, translate(x, -0.4f, z) * turn * scale(0.6f * s, s, 0.8f * s),
                     material);
    else
      b.add_instance(0, ball, translate(x, -0.5f, z) * turn * scale(i % 2 ? -s : s, s, 1.1f * s),
                     material);
    ++i;
  }
  Light dome = make_light(LightKind::kDome, {0.6f, 0.7f, 0.9f});
  dome.texture = sky;
  b.add_light(dome);
  Light rect = make_light(LightKind::kRect, {8, 8, 6}, translate(0, 3.5f, 1) * rotate(0, -80));
  rect.texture = image;
  rect.width = 1.5f;
  b.add_light(rect);
  Light disk = make_light(LightKind::kDisk, {4, 6, 8}, translate(3, 2, 1) * rotate(1, 60));
  b.add_light(disk);
  Light bulb = make_light(LightKind::kSphere, {9, 3, 3}, translate(-2.5f, 1.4f, 1));
  bulb.radius = 0.2f;
  bulb.group = b.light_group("bulb");
  b.add_light(bulb);
  bulb.radius = 0;
  bulb.to_world = translate(1, 2.5f, 2);
  b.add_light(bulb);
  Light sun = make_light(LightKind::kDistant, {90, 80, 70}, rotate(0, -50) * rotate(1, 20));
  sun.angle = 3;
  sun.group = b.light_group("sun");
  b.add_light(sun);
  Camera camera = make_camera({0.4, 1.3, 5.5}, {0, -0.2, 0}, 0.8f);
  camera.lens_radius = 0.03f;
  camera.focus_distance = 5;
  b.set_camera(camera);
  return b.build();
}

/// A scene lit only by emissive meshes: constant, textured and instanced.
inline ScenePtr emissive_meshes() {
  SceneBuilder b;
  const uint32_t image = add_texture(b, 4, 4, 3, random_texels(48, 0.f, 8.f, 5));
  const uint32_t floor = b.add_material(make_material(ProgramId::kDiffuse, {0.6f, 0.6f, 0.6f}));
  Material lamp = make_material(ProgramId::kEmissive);
  lamp.emission = {5, 4, 3};
  const uint32_t constant = b.add_material(lamp);
  lamp.textures[static_cast<size_t>(Input::kEmission)] = use(image);
  const uint32_t textured = b.add_material(lamp);
  Material both = make_material(ProgramId::kPrincipled, {0.3f, 0.5f, 0.7f}, 0.4f);
  both.emission = {0.4f, 0.1f, 0.1f};
  const uint32_t glossy = b.add_material(both);
  MeshData room = box({-2, -1, -2}, {2, 2, 2});
  room.indices.resize(30);
  room.face_materials.assign(10, floor);
  room.face_materials[6] = textured;
  b.add_to_group(0, b.add_mesh(make_mesh(room)));
  const uint32_t group = b.add_group("lamp");
  Mesh ball = make_mesh(sphere(4, true));
  ball.light_group = b.light_group("lamps");
  b.add_to_group(group, b.add_mesh(std::move(ball)));
  b.add_instance(0, group, translate(-1, 0, -1) * scale(0.4f, 0.2f, 0.4f), constant);
  b.add_instance(0, group, translate(0.8f, -0.5f, 0) * scale(-0.4f, 0.4f, 0.4f), glossy);
  b.add_instance(0, group, translate(0.2f, 0.5f, -0.5f) * scale(0.2f, 0.2f, 0.2f), textured);
  b.set_camera(make_camera({0, 0.5, 5}, {0, 0.3, 0}, 0.9f));
  return b.build();
}

/// Makes a scene of several layers of cut-out leaves in front of a wall. Their opacity is a
/// constant, a texture, or a texture with a threshold.
inline ScenePtr presence() {
  SceneBuilder b;
  const uint32_t mask = add_texture(b, 8, 8, 1, random_texels(64, -0.2f, 1.2f, 6));
  std::vector<uint32_t> leaves;
  for (int i = 0; i < 6; ++i) {
    Material m = make_material(ProgramId::kPrincipled, {0.3f, 0.6f, 0.2f}, 0.7f);
    m.presence = true;
    if (i < 3) m.opacity = 0.5f * static_cast<float>(i);
    if (i >= 3) m.textures[static_cast<size_t>(Input::kOpacity)] = use(mask, 0);
    if (i == 4) m.opacity_threshold = 0.5f;
    if (i == 5) {
      m.presence = false;
      m.opacity_threshold = 0.25f;
    }
    leaves.push_back(b.add_material(m));
  }
  const uint32_t wall = b.add_material(make_material(ProgramId::kDiffuse, {0.8f, 0.7f, 0.6f}));
  b.add_to_group(0, b.add_mesh(make_mesh(quad({-3, -3, -2}, {6, 0, 0}, {0, 6, 0}), wall)));
  const uint32_t group = b.add_group("leaf");
  b.add_to_group(group, b.add_mesh(make_mesh(quad({-0.5f, -0.5f, 0}, {1, 0, 0}, {0, 1, 0}))));
  for (int i = 0; i < 36; ++i) {
    const auto x = static_cast<float>(i % 6), y = static_cast<float>(i / 6);
    b.add_instance(0, group,
                   translate(0.5f * x - 1.2f, 0.5f * y - 1.2f, 0.11f * x - 0.07f * y) *
                       rotate(2, 10.0 * i) * scale(1.2f, i % 2 ? -1.f : 1.f, 1),
                   leaves[i % 6]);
  }
  MeshData own = quad({-1, -1, 0.9f}, {2, 0, 0}, {0, 2, 0});
  own.face_materials = {leaves[1], leaves[3]};
  b.add_to_group(0, b.add_mesh(make_mesh(own)));
  Light light = make_light(LightKind::kRect, {20, 20, 20},
                           translate(1, 2, 3) * rotate(1, 20) * rotate(0, -35));
  b.add_light(light);
  b.add_light(make_light(LightKind::kDome, {0.2f, 0.2f, 0.3f}));
  b.set_camera(make_camera({0, 0, 5}, {0, 0, 0}, 0.8f));
  return b.build();
}

// ---- images -----------------------------------------------------------------------------------

inline void expect_same_bits(const std::vector<float>& a, const std::vector<float>& b,
                             const std::string& what) {
  ASSERT_EQ(a.size(), b.size()) << what;
  if (a.empty() || std::memcmp(a.data(), b.data(), 4 * a.size()) == 0) return;
  size_t first = a.size(), differing = 0;
  for (size_t i = a.size(); i-- > 0;)
    if (std::memcmp(&a[i], &b[i], 4) != 0) {
      first = i;
      ++differing;
    }
  ADD_FAILURE() << what << ": " << differing << " of " << a.size() << " values differ, first "
                << first << ": " << a[first] << " and " << b[first];
}
inline void expect_same_image(const RenderedImage& a, const RenderedImage& b,
                              const std::string& what) {
  expect_same_bits(a.beauty, b.beauty, what + ", beauty");
  expect_same_bits(a.albedo, b.albedo, what + ", albedo");
  expect_same_bits(a.normal, b.normal, what + ", normal");
  expect_same_bits(a.depth, b.depth, what + ", depth");
  EXPECT_EQ(a.samples, b.samples) << what;
  ASSERT_EQ(a.aovs.size(), b.aovs.size()) << what;
  for (size_t i = 0; i < a.aovs.size(); ++i) {
    const AovLayer &x = a.aovs[i], &y = b.aovs[i];
    ASSERT_EQ(x.name, y.name) << what;
    if (x.name != "cost") expect_same_bits(x.values, y.values, what + ", " + x.name);
  }
}

/// Returns the AOV layer called `name`, which must exist.
inline const AovLayer& layer(const RenderedImage& image, const std::string& name) {
  const auto at = std::find_if(image.aovs.begin(), image.aovs.end(),
                               [&](const AovLayer& one) { return one.name == name; });
  if (at == image.aovs.end()) throw std::runtime_error("no layer " + name);
  return *at;
}

/// Returns the mean of a channel over all pixels, and its standard error if the noise of pixels is
/// independent.
struct Mean {
  double mean = 0, error = 0;
};
inline Mean mean_of(const std::vector<double>& values) {
  Mean m;
  for (double x : values) m.mean += x / static_cast<double>(values.size());
  double sum = 0;
  for (double x : values) sum += (x - m.mean) * (x - m.mean);
  const auto n = static_cast<double>(values.size());
  m.error = values.size() > 1 ? std::sqrt(sum / (n - 1) / n) : kInf;
  return m;
}
inline Mean mean_of(const RenderedImage& image, size_t channel = 0) {
  std::vector<double> values;
  for (size_t i = channel; i < image.beauty.size(); i += 3) values.push_back(image.beauty[i]);
  return mean_of(values);
}
/// Returns the mean of the differences between the pixels of two images.
inline Mean mean_difference(const RenderedImage& a, const RenderedImage& b, size_t channel = 0) {
  std::vector<double> values;
  for (size_t i = channel; i < a.beauty.size(); i += 3)
    values.push_back(static_cast<double>(a.beauty[i]) - b.beauty[i]);
  return mean_of(values);
}

}  // namespace wavecomb::scene_testing
