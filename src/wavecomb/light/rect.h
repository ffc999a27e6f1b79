// SPDX-License-Identifier: Apache-2.0
/// Rectangle lights: uniform over the solid angle; parallelograms, which a shear makes of them, and
/// what is seen very small: uniform over the area.
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

/// Solid angles below are no better sampled than the area, and lose digits.
inline constexpr float kLeastRectSolidAngle = 2e-3f;

/// A rectangle as a point sees it (C. Urena, M. Fajardo, A. King, "An Area-Preserving
/// Parametrization for Spherical Rectangles", CGF 32(4) 2013). The point is at the origin of x, y
/// along the edges and z towards the rectangle, which is [x0, x1] x [y0, y1] at the distance z.
///
/// The solid angle is the sum over its corners of +-atan(x y / (z sqrt(x^2 + y^2 + z^2))), which
/// is what the paper's sum of angles minus 2 pi comes to: there each angle is pi / 2 + asin(b c), b
/// and c the z components of the normals of the planes through two neighbouring edges.
template <typename F>
struct SphericalRect {
  Vec3<F> x, y, n;
  F width, height, x0, x1, y0, y1, z;
  F solid_angle;
  F begin;   ///< k of the paper
  F b0, b1;  ///< z components of the normals for the edges y0 and y1
  Mask<F> usable;
};

template <typename F>
inline SphericalRect<F> make_spherical_rect(const LightReader<F>& light, const Vec3<F>& from) {
  SphericalRect<F> r;
  const Direction<F> u = make_direction<F>(light.u()), v = make_direction<F>(light.v());
  r.x = u.wi;
  r.y = v.wi;
  r.n = light.n();
  r.width = u.length;
  r.height = v.length;
  const Vec3<F> corner = light.p() - from;
  r.x0 = dot(corner, r.x);
  r.y0 = dot(corner, r.y);
  r.x1 = r.x0 + r.width;
  r.y1 = r.y0 + r.height;
  r.z = -dot(corner, r.n);  // the light is seen from the side that n points to
  const F z2 = r.z * r.z, x02 = r.x0 * r.x0, x12 = r.x1 * r.x1, y02 = r.y0 * r.y0,
          y12 = r.y1 * r.y1;
  const auto corner_angle = [&](const F& a, const F& b, const F& a2, const F& b2) {
    return atan2(F(a * b), F(r.z * sqrt(F(F(a2 + b2) + z2))));
  };
  const F a01 = corner_angle(r.x1, r.y0, x12, y02), a12 = corner_angle(r.x1, r.y1, x12, y12),
          a23 = corner_angle(r.x0, r.y1, x02, y12), a30 = corner_angle(r.x0, r.y0, x02, y02);
  r.solid_angle = F(a12 - a01) + F(a30 - a23);
  r.begin = kPi + F(a23 - a30);
  const F least(1e-30f);  // a point on the line of an edge
  r.b0 = -r.y0 / sqrt(max(F(z2 + y02), least));
  r.b1 = r.y1 / sqrt(max(F(z2 + y12), least));
  r.usable = (abs(dot(r.x, r.y)) < 1e-5f) & (r.z > 0.f) & (r.solid_angle > kLeastRectSolidAngle) &
             is_finite(r.solid_angle);
  return r;
}

/// Where on the rectangle (u, v) of the unit square lands, as shares of its width and height: the
/// paper's algorithm 2, with its z0 = -z.
template <typename F>
inline Vec2<F> sample_spherical_rect(const SphericalRect<F>& r, const F& u, const F& v) {
  const auto [sin_a, cos_a] = sincos_2pi(F(fma(u, r.solid_angle, r.begin) * kInv2Pi));
  const F good_sin = select(abs(sin_a) > 1e-20f, sin_a, F(1e-20f));
  const F f = fma(cos_a, r.b0, F(-r.b1)) / good_sin;
  const F f2 = fma(f, f, F(r.b0 * r.b0));
  const F c = clamp(copysign(F(1.f / sqrt(max(f2, F(1e-30f)))), f), F(-1.f), F(1.f));
  const F s = sqrt(max(F((1.f - c) * (1.f + c)), F(1e-14f)));
  const F x = clamp(F(c * r.z / s), r.x0, r.x1);
  const F d2 = fma(x, x, F(r.z * r.z));
  const F h0 = r.y0 / sqrt(fma(r.y0, r.y0, d2)), h1 = r.y1 / sqrt(fma(r.y1, r.y1, d2));
  const F h = fma(v, F(h1 - h0), h0);
  const F rest = max(F((1.f - h) * (1.f + h)), F(1e-14f));
  const F y = clamp(F(h * sqrt(F(d2 / rest))), r.y0, r.y1);
  const auto share = [](const F& at, const F& size) {
    return clamp(F(at / select(size > 0.f, size, F(1.f))), F(0.f), F(1.f));
  };
  return {share(F(x - r.x0), r.width), share(F(y - r.y0), r.height)};
}

/// Density over solid angle of a point of the rect; 0 where it is seen from behind.
template <typename F>
inline F rect_pdf(const SphericalRect<F>& r, const F& distance2, const F& cos_light,
                  const F& area) {
  const F by_area = area_to_solid_angle<F>(distance2, cos_light, area);
  const F by_angle = 1.f / select(r.usable, r.solid_angle, F(1.f));
  return select(r.usable & (by_area > 0.f), by_angle, by_area);
}

/// A point q = p + a u + b v, towards n only.
template <typename F>
inline KindSample<F> sample_rect(const LightReader<F>& light, const TextureView* textures,
                                 const Vec3<F>& from, const F& u, const F& v,
                                 const Mask<F>& active) {
  const SphericalRect<F> r = make_spherical_rect<F>(light, from);
  Vec2<F> at{u, v};
  if (any(active & r.usable)) {
    const Vec2<F> by_angle = sample_spherical_rect<F>(r, u, v);
    at = {select(r.usable, by_angle.x, u), select(r.usable, by_angle.y, v)};
  }
  const Vec3<F> q = fma(light.u(), at.x, fma(light.v(), at.y, light.p()));
  const Direction<F> d = make_direction<F>(q - from);
  const F cos_light = -dot(d.wi, light.n());
  const F pdf = rect_pdf<F>(r, d.length2, cos_light, light.area());
  return {d.wi, d.length, rect_radiance<F>(light, textures, at.x, at.y, active & (pdf > 0.f)), pdf,
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
  const SphericalRect<F> r = make_spherical_rect<F>(light, origin);
  return {select<F>(front, radiance, Color<F>(F(0.f))),
          rect_pdf<F>(r, F(t * t), cos_light, light.area())};
}

}  // namespace wavecomb::detail
