// SPDX-License-Identifier: Apache-2.0
/// Helpers that make lights for tests, and a double-precision ray tracer for single lights.
#pragma once

#include <optional>

#include "numbers_testing.h"
#include "wavecomb/light/description/light_builder.h"
#include "wavecomb/light/sampling/escape.h"
#include "wavecomb/light/sampling/light_sample.h"

namespace wavecomb::light_testing {

using numbers_testing::kPiD;
using numbers_testing::scale;
using numbers_testing::translate;

/// A light set with its textures.
struct Lights {
  std::vector<TexturePtr> textures;
  std::vector<TextureView> views;
  std::vector<IesProfile> profiles;
  std::vector<MaterialRecord> records;
  std::vector<TextureUseRecord> uses;
  LightSet set;

  Lights() = default;
  explicit Lights(const std::vector<Light>& lights,
                  const std::vector<EmissiveTriangle>& triangles = {}, float scene_radius = 10.f) {
    build(lights, triangles, scene_radius);
  }
  uint32_t add_texture(uint32_t width, uint32_t height, const std::vector<float>& rgb,
                       Wrap t = Wrap::kClamp) {
    textures.push_back(std::make_unique<Texture>(TextureDesc{
        "test", rgb.data(), width, height, 3, TexelFormat::kF32, false, Wrap::kRepeat, t}));
    views.push_back(textures.back()->view());
    return static_cast<uint32_t>(textures.size() - 1);
  }
  /// Adds a material whose emission is a texture.
  uint32_t add_material(uint32_t texture, std::array<float, 4> scale = {1, 1, 1, 1}) {
    const auto id = static_cast<uint32_t>(records.size());
    records.emplace_back().textured_inputs = input_bit(Input::kEmission);
    uses.resize(uses.size() + kInputCount);
    uses[id * kInputCount + static_cast<uint32_t>(Input::kEmission)] = {
        texture, 4, {scale[0], scale[1], scale[2], scale[3]}, {0, 0, 0, 0}, {1, 0, 0, 0, 1, 0}};
    return id;
  }
  void build(const std::vector<Light>& lights, const std::vector<EmissiveTriangle>& triangles = {},
             float scene_radius = 10.f) {
    set = build_lights({.lights = lights,
                        .triangle_count = triangles.size(),
                        .triangle = [&triangles](size_t i) { return triangles[i]; },
                        .scene_radius = scene_radius,
                        .textures = textures,
                        .profiles = profiles});
  }
  LightView view() const { return set.view({records.data(), uses.data(), views.data()}); }
};

inline Light make_light(LightKind kind, const Affine& to_world = {}) {
  Light light;
  light.name = "/World/light";
  light.kind = kind;
  light.to_world = to_world;
  light.color = {2, 3, 4};
  return light;
}
/// Rotates by `degrees` about the x axis, then about the y axis.
inline Affine rotate(double x_degrees, double y_degrees) {
  const double a = x_degrees * kPiD / 180, b = y_degrees * kPiD / 180;
  const auto f = [](double v) { return static_cast<float>(v); };
  const Affine x{
      {{1, 0, 0}, {0, f(std::cos(a)), f(-std::sin(a))}, {0, f(std::sin(a)), f(std::cos(a))}},
      {0, 0, 0}};
  const Affine y{
      {{f(std::cos(b)), 0, f(std::sin(b))}, {0, 1, 0}, {f(-std::sin(b)), 0, f(std::cos(b))}},
      {0, 0, 0}};
  return y * x;
}
inline EmissiveTriangle make_triangle(const Vec3<float>& a, const Vec3<float>& b,
                                      const Vec3<float>& c) {
  EmissiveTriangle t{};
  const Vec3<float> p[3] = {a, b, c};
  float* const to[3] = {t.p0, t.p1, t.p2};
  for (int i = 0; i < 3; ++i) {
    to[i][0] = p[i].x;
    to[i][1] = p[i].y;
    to[i][2] = p[i].z;
  }
  t.radiance[0] = 2;
  t.radiance[1] = 3;
  t.radiance[2] = 4;
  return t;
}

/// Returns the distance along `dir` to the shape of the first light of a view, which is a rect,
/// disk, sphere, cylinder or triangle.
inline std::optional<float> trace(const LightView& view, const Vec3<float>& origin,
                                  const Vec3<float>& dir) {
  LightRecord r{};
  if (view.first_triangle > 0) {
    r = view.lights[0];
  } else {
    const TriangleLight& t = view.triangles[0];
    r.kind = static_cast<uint32_t>(LightKind::kTriangle);
    std::copy(t.p, t.p + 3, r.p);
    std::copy(t.u, t.u + 3, r.u);
    std::copy(t.v, t.v + 3, r.v);
  }
  const double o[3] = {origin.x - r.p[0], origin.y - r.p[1], origin.z - r.p[2]};
  const double d[3] = {dir.x, dir.y, dir.z};
  const auto dot = [](const double* a, const double* b) {
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
  };
  const auto kind = static_cast<LightKind>(r.kind);
  if (kind == LightKind::kSphere) {
    const double b = dot(o, d), dd = dot(d, d),
                 c = dot(o, o) - static_cast<double>(r.radius) * r.radius;
    const double discriminant = b * b - dd * c;
    if (discriminant < 0 || (c > 0 && b > 0)) return std::nullopt;
    const double root = std::sqrt(discriminant);
    return static_cast<float>(c > 0 ? (-b - root) / dd : (-b + root) / dd);
  }
  if (kind == LightKind::kCylinder) {
    const double a[3] = {r.u[0], r.u[1], r.u[2]};
    const double aa = dot(a, a), oa = dot(o, a) / aa, da = dot(d, a) / aa;
    double po[3], pd[3];
    for (int i = 0; i < 3; ++i) {
      po[i] = o[i] - oa * a[i];
      pd[i] = d[i] - da * a[i];
    }
    const double b = dot(po, pd), dd = dot(pd, pd),
                 c = dot(po, po) - static_cast<double>(r.radius) * r.radius;
    if (b * b - dd * c < 0) return std::nullopt;
    for (const double sign : {-1.0, 1.0}) {
      const double t = (-b + sign * std::sqrt(b * b - dd * c)) / dd, along = oa + t * da;
      if (t > 0 && along >= 0 && along <= 1) return static_cast<float>(t);
    }
    return std::nullopt;
  }
  const double u[3] = {r.u[0], r.u[1], r.u[2]}, v[3] = {r.v[0], r.v[1], r.v[2]};
  const double m[3] = {u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2],
                       u[0] * v[1] - u[1] * v[0]};
  const double t = -dot(o, m) / dot(d, m);
  if (!(t > 0) || !std::isfinite(t)) return std::nullopt;
  // h = a u + b v, without a component along m
  const double h[3] = {o[0] + t * d[0], o[1] + t * d[1], o[2] + t * d[2]};
  const double hv[3] = {h[1] * v[2] - h[2] * v[1], h[2] * v[0] - h[0] * v[2],
                        h[0] * v[1] - h[1] * v[0]};
  const double uh[3] = {u[1] * h[2] - u[2] * h[1], u[2] * h[0] - u[0] * h[2],
                        u[0] * h[1] - u[1] * h[0]};
  const double a = dot(hv, m) / dot(m, m), b = dot(uh, m) / dot(m, m);
  const bool inside = kind == LightKind::kDisk   ? a * a + b * b <= 1
                      : kind == LightKind::kRect ? a >= 0 && a <= 1 && b >= 0 && b <= 1
                                                 : a >= 0 && b >= 0 && a + b <= 1;
  return inside ? std::optional<float>(static_cast<float>(t)) : std::nullopt;
}

}  // namespace wavecomb::light_testing
