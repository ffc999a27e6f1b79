// SPDX-License-Identifier: Apache-2.0
/// Triangles of emissive meshes: uniform over the area, shining to both sides.
#pragma once

#include "wavecomb/light/record.h"
#include "wavecomb/texture/lookup.h"

namespace wavecomb::detail {

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

/// A point q = p + b1 u + b2 v, with density 1 / area.
template <typename F>
inline KindSample<F> sample_triangle(const LightReader<F>& light, const MaterialView& materials,
                                     const Vec3<F>& from, const F& u, const F& v,
                                     const Mask<F>& active) {
  const Vec2<F> b = square_to_triangle(u, v);
  const Vec3<F> q = fma(light.u(), b.x, fma(light.v(), b.y, light.p()));
  const Direction<F> d = make_direction<F>(q - from);
  const F pdf = area_to_solid_angle<F>(d.length2, abs(dot(d.wi, light.n())), light.area());

  Color<F> radiance = light.radiance();
  const UInt<F> material = light.bits(offsetof(LightRecord, material));
  const Mask<F> textured = active & (pdf > 0.f) & Mask<F>(material != UInt<F>(kNoLight));
  if (any(textured)) {
    const Vec2<F> uv0 = light.vec2(offsetof(LightRecord, uv0)),
                  uv1 = light.vec2(offsetof(LightRecord, uv1)),
                  uv2 = light.vec2(offsetof(LightRecord, uv2));
    const Vec2<F> uv{fma(F(uv1.x - uv0.x), b.x, fma(F(uv2.x - uv0.x), b.y, uv0.x)),
                     fma(F(uv1.y - uv0.y), b.x, fma(F(uv2.y - uv0.y), b.y, uv0.y))};
    radiance =
        select<F>(textured, textured_emission<F>(materials, material, uv, textured), radiance);
  }
  return {d.wi, d.length, radiance, pdf, Mask<F>(false)};
}

/// Density over solid angle for a hit at distance t along dir.
template <typename F>
inline F triangle_pdf(const LightReader<F>& light, const Vec3<F>& dir, const F& t) {
  return area_to_solid_angle<F>(F(t * t), abs(dot(dir, light.n())), light.area());
}

}  // namespace wavecomb::detail
