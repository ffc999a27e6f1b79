// SPDX-License-Identifier: Apache-2.0
/// Rectangle lights (parallelograms, where their transform shears): uniform over the area.
#pragma once

#include "wavecomb/light/record.h"
#include "wavecomb/texture/lookup.h"

namespace wavecomb::detail {

/// Radiance at (s, t) of the rect: s to the right and t up as seen from the front.
template <typename F>
inline Color<F> rect_radiance(const LightReader<F>& light, const TextureView* textures, const F& s,
                              const F& t, const Mask<F>& active) {
  const Color<F> color = light.radiance();
  const UInt<F> texture = light.texture();
  const Mask<F> textured = active & Mask<F>(texture != UInt<F>(kNoTexture));
  if (none(textured)) return color;
  const Texel<F> texel = lookup<F>(textures, texture, s, t, F(0.f), textured);
  const Color<F> image(texel.r, texel.g, texel.b);
  return select<F>(textured, color * not_negative(image), color);
}

/// A point q = p + a u + b v, with density 1 / area; towards n only.
template <typename F>
inline KindSample<F> sample_rect(const LightReader<F>& light, const TextureView* textures,
                                 const Vec3<F>& from, const F& u, const F& v,
                                 const Mask<F>& active) {
  const Vec3<F> q = fma(light.u(), u, fma(light.v(), v, light.p()));
  const Direction<F> d = make_direction<F>(q - from);
  const F cos_light = -dot(d.wi, light.n());
  const F pdf = area_to_solid_angle<F>(d.length2, cos_light, light.area());
  return {d.wi, d.length, rect_radiance<F>(light, textures, u, v, active & (pdf > 0.f)), pdf,
          Mask<F>(false)};
}

/// What a ray gets from the rect at distance t.
template <typename F>
inline KindHit<F> hit_rect(const LightReader<F>& light, const TextureView* textures,
                           const Vec3<F>& origin, const Vec3<F>& dir, const F& t,
                           const Mask<F>& active) {
  const F cos_light = -dot(dir, light.n());
  const Mask<F> front = active & (cos_light > 0.f);
  // h = a u + b v; with m = u x v: a = (h x v) . m / m^2, b = (u x h) . m / m^2.
  const Vec3<F> h = fma(dir, t, origin) - light.p();
  const Vec3<F> edge_u = light.u(), edge_v = light.v();
  const Vec3<F> m = cross(edge_u, edge_v);
  const F m2 = dot(m, m);
  const F inverse = 1.f / select(m2 > 0.f, m2, F(1.f));
  const F a = dot(cross(h, edge_v), m) * inverse;
  const F b = dot(cross(edge_u, h), m) * inverse;
  const Color<F> radiance =
      rect_radiance<F>(light, textures, clamp(a, F(0.f), F(1.f)), clamp(b, F(0.f), F(1.f)), front);
  return {select<F>(front, radiance, Color<F>(F(0.f))),
          area_to_solid_angle<F>(F(t * t), cos_light, light.area())};
}

}  // namespace wavecomb::detail
