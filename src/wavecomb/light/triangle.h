// SPDX-License-Identifier: Apache-2.0
/// Triangles of emissive meshes: uniform over the area, shining to both sides.
#pragma once

#include "wavecomb/core/rows.h"
#include "wavecomb/light/record.h"
#include "wavecomb/scene/graph_value.h"
#include "wavecomb/texture/lookup.h"

namespace wavecomb::detail {

/// Radiance that the graphs of each lane's material give at a point of a triangle.
template <typename F>
[[gnu::noinline, gnu::cold]] Color<F> graph_emission(const MaterialView& view, const UInt<F>& graph,
                                                     const Vec3<F>& p, const Vec2<F>& uv,
                                                     const MeshPlace<F>& place,
                                                     const Mask<F>& active) {
  GraphPoint<F> at;
  at.uv = uv;
  at.place = place;
  at.position = p;
  return graph_value<F>(view, graph, kEmissionOutput, at, active, Color<F>(F(0.f)));
}

/// Radiance that the emission slot of each lane's material gives at `uv`: texel * scale + bias,
/// read at the finest level, in [0, 1e18] as material/ keeps it.
template <typename F>
inline Color<F> textured_emission(const MaterialView& view, const UInt<F>& material,
                                  const Vec2<F>& uv, const Mask<F>& active) {
  using R = TextureUseRecord;
  constexpr auto kWords = static_cast<uint32_t>(sizeof(R) / 4);
  const UInt<F> first = (material * kSlotCount + static_cast<uint32_t>(Slot::kEmission)) * kWords;
  const auto real = [&](size_t offset_bytes, size_t i) {
    return gather<F>(view.uses, first + static_cast<uint32_t>(offset_bytes / 4 + i), active);
  };
  F m[6];
  for (size_t i = 0; i < 6; ++i) m[i] = real(offsetof(R, uv), i);
  const F s = fma(m[0], uv.x, fma(m[1], uv.y, m[2]));
  const F t = fma(m[3], uv.x, fma(m[4], uv.y, m[5]));
  const UInt<F> texture = float_bits<F>(real(offsetof(R, texture), 0));
  const Texel<F> texel = lookup<F>(view.textures, texture, s, t, F(0.f), active);
  const auto channel = [&](const F& value, size_t i) {
    return fma(value, real(offsetof(R, scale), i), real(offsetof(R, bias), i));
  };
  const F c[4] = {channel(texel.r, 0), channel(texel.g, 1), channel(texel.b, 2),
                  channel(texel.a, 3)};
  const UInt<F> which = float_bits<F>(real(offsetof(R, channel), 0));
  F one = c[0];
  for (uint32_t i = 1; i < 4; ++i) one = select(Mask<F>(which == UInt<F>(i)), c[i], one);
  const Mask<F> rgb = Mask<F>(which >= UInt<F>(4u));
  const auto sane = [](const F& x) { return min(max(x, F(0.f)), F(1e18f)); };
  return {sane(select(rgb, c[0], one)), sane(select(rgb, c[1], one)), sane(select(rgb, c[2], one))};
}

/// The triangles of the lights in the active lanes.
template <typename F>
struct TriangleReader {
  Vec3<F> p, u, v, m;
  Color<F> radiance;
  F pick_pdf;

  TriangleReader(const LightView& view, const UInt<F>& light, const Mask<F>& active) {
    constexpr uint32_t kWords = sizeof(TriangleLight) / 4;
    const auto r =
        load_rows<kWords, F>(view.triangles, (light - view.first_triangle) * kWords, active);
    const auto vec3 = [&](size_t offset_bytes) {
      return Vec3<F>(r[offset_bytes / 4], r[offset_bytes / 4 + 1], r[offset_bytes / 4 + 2]);
    };
    p = vec3(offsetof(TriangleLight, p));
    u = vec3(offsetof(TriangleLight, u));
    v = vec3(offsetof(TriangleLight, v));
    m = vec3(offsetof(TriangleLight, m));
    radiance = vec3(offsetof(TriangleLight, radiance));
    pick_pdf = r[offsetof(TriangleLight, pick_pdf) / 4];
  }
};

/// A point q = p + b1 u + b2 v, with density 1 / area.
template <typename F>
inline KindSample<F> sample_triangle(const TriangleReader<F>& light, const LightView& view,
                                     const Vec3<F>& from, const F& u, const F& v,
                                     const Mask<F>& active) {
  const Vec2<F> b = square_to_triangle(u, v);
  const Vec3<F> q = fma(light.u, b.x, fma(light.v, b.y, light.p));
  const Direction<F> d = make_direction<F>(q - from);
  const F pdf = area_to_solid_angle<F>(d.length2, abs(dot(d.wi, light.m)), F(1.f));

  Color<F> radiance = light.radiance;
  const Mask<F> textured = active & (pdf > 0.f) & (light.radiance.x == TriangleLight::kTextured);
  if (any(textured)) {
    const UInt<F> material = float_bits<F>(light.radiance.y),
                  index = float_bits<F>(light.radiance.z);
    const auto uvs = load_rows<8, F>(view.triangle_uvs, index * 8u, textured);
    const Vec2<F> uv{fma(F(uvs[2] - uvs[0]), b.x, fma(F(uvs[4] - uvs[0]), b.y, uvs[0])),
                     fma(F(uvs[3] - uvs[1]), b.x, fma(F(uvs[5] - uvs[1]), b.y, uvs[1]))};
    Mask<F> plain = textured;
    if (view.materials.graphs.programs) [[unlikely]] {
      using U = UInt<F>;
      const U graph =
          gather<U>(view.materials.materials,
                    material * static_cast<uint32_t>(sizeof(MaterialRecord) / 4) +
                        static_cast<uint32_t>(offsetof(MaterialRecord, emission_graph) / 4),
                    Mask<U>(textured));
      const Mask<F> driven = textured & Mask<F>(graph != U(kNoGraph));
      plain = textured & not_(driven);
      if (any(driven)) {
        const Vec3<F> at = q;
        const MeshPlace<F> place{float_bits<F>(uvs[6]), float_bits<F>(uvs[7]), b.x, b.y};
        radiance = select<F>(
            driven, graph_emission<F>(view.materials, graph, at, uv, place, driven), radiance);
      }
    }
    if (any(plain))
      radiance =
          select<F>(plain, textured_emission<F>(view.materials, material, uv, plain), radiance);
  }
  return {d.wi, d.length, radiance, pdf, Mask<F>(false)};
}

/// Density over solid angle, and the probability of the light's choice by power.
template <typename F>
struct TriangleDensity {
  F solid_angle, pick_pdf;
};

/// For a hit at distance t along dir.
template <typename F>
inline TriangleDensity<F> triangle_pdf(const LightView& view, const UInt<F>& light,
                                       const Vec3<F>& dir, const F& t, const Mask<F>& active) {
  static_assert(offsetof(TriangleLight, pick_pdf) == offsetof(TriangleLight, m) + 12);
  const auto r = load_rows<4, F>(
      view.triangles,
      (light - view.first_triangle) * (sizeof(TriangleLight) / 4) + offsetof(TriangleLight, m) / 4,
      active);
  const F projected = abs(dot(dir, Vec3<F>(r[0], r[1], r[2])));
  return {area_to_solid_angle<F>(F(t * t), projected, F(1.f)), r[3]};
}

}  // namespace wavecomb::detail
