// SPDX-License-Identifier: Apache-2.0
/// Rectangle lights, sampled uniformly by solid angle. Parallelograms (sheared rectangles) and
/// rectangles of very small solid angle are sampled uniformly by area.
///
/// With an image, a point is sampled from the image's distribution with probability a, and
/// otherwise uniformly as described above. For both techniques, the density of a direction is the
/// density of the mixture,
///     p = a p_image d^2 / (A cos) + (1 - a) p_even,
/// where p_image is the image density over the unit square, A the area, d the distance, cos the
/// cosine at the light, and p_even the density without an image. Let i be the effective fraction of
/// the image that emits light (Distribution2D::spread), and g the fraction of the rectangle that
/// makes up most of its solid angle as seen from the point. The fraction g is 1 if all parts of the
/// rectangle are equally close. Then a = g / (g + i), clamped to a range, since the technique with
/// the smaller fraction samples the light better: the image from far away, and the solid angle
/// nearby.
#pragma once

#include "wavecomb/light/kinds/image.h"
#include "wavecomb/light/records/record_reader.h"
#include "wavecomb/texture/lookup.h"

namespace wavecomb::detail {

/// Returns the radiance at (s, t) of the rectangle, with s to the right and t up as seen from the
/// front.
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

/// Smallest solid angle for solid angle sampling. Below it, area sampling is equally good, and
/// computed solid angles are imprecise.
inline constexpr float kMinRectSolidAngle = 2e-3f;

/// Rectangle as seen from a point (C. Urena, M. Fajardo, A. King, "An Area-Preserving
/// Parametrization for Spherical Rectangles", CGF 32(4) 2013). The point is the origin, x and y run
/// along the edges, and z points towards the rectangle, which is [x0, x1] x [y0, y1] at distance z.
///
/// The solid angle is the sum over the corners of +-atan(x y / (z d)), d = sqrt(x^2 + y^2 + z^2).
/// This sum equals the paper's sum of angles minus 2 pi, in which each angle is pi / 2 + asin(b c),
/// with b and c the z components of the normals of the planes through two adjacent edges. Each
/// angle is the argument of the complex number z d + i x y, so that the difference of the two
/// angles along an edge x, which is less than pi, is the argument of
///   z^2 d_0 d_1 + x^2 y_0 y_1 + i x z (y_1 d_0 - y_0 d_1).
/// If this number is out of the range of float (lengths above 10^9 or below 10^-9), the rectangle
/// is not usable.
template <typename F>
struct SphericalRect {
  Vec3<F> x, y, n;
  F inverse_width, inverse_height, x0, x1, y0, y1, z;
  F solid_angle;
  F begin;  ///< variable k of Urena et al.
  /// 1 / sqrt(y0^2 + z^2), and the z components of the normals at the edges y0 and y1
  F near_y, b0, b1;
  Mask<F> usable;
};

template <typename F>
inline SphericalRect<F> make_spherical_rect(const LightReader<F>& light, const Vec3<F>& from) {
  SphericalRect<F> r;
  r.inverse_width = light[&LightRecord::inverse_u];
  r.inverse_height = light[&LightRecord::inverse_v];
  r.x = light.u() * r.inverse_width;
  r.y = light.v() * r.inverse_height;
  r.n = light.n();
  const Vec3<F> corner = light.p() - from;
  r.x0 = dot(corner, r.x);
  r.y0 = dot(corner, r.y);
  r.x1 = r.x0 + light[&LightRecord::length_u];
  r.y1 = r.y0 + light[&LightRecord::length_v];
  r.z = -dot(corner, r.n);  // z > 0 on the front of the light, to which n points
  const F z2 = r.z * r.z, edge0 = fma(r.y0, r.y0, z2), edge1 = fma(r.y1, r.y1, z2);
  const auto between = [&](const F& x) {
    const F zd0 = r.z * sqrt(fma(x, x, edge0)), zd1 = r.z * sqrt(fma(x, x, edge1));
    const F xy0 = x * r.y0, xy1 = x * r.y1;
    return atan2(fma(xy1, zd0, F(-(xy0 * zd1))), fma(zd0, zd1, F(xy0 * xy1)));
  };
  const F right = between(r.x1), left = between(r.x0);
  r.solid_angle = right - left;
  r.begin = kPi + left;
  const F least(1e-30f);  // This lower bound avoids 0 / 0 for points on the line through an edge.
  r.near_y = 1.f / sqrt(max(edge0, least));
  r.b0 = -r.y0 * r.near_y;
  r.b1 = r.y1 / sqrt(max(edge1, least));
  r.usable = (abs(dot(r.x, r.y)) < 1e-5f) & (r.z > 0.f) & (r.solid_angle > kMinRectSolidAngle) &
             is_finite(r.solid_angle);
  return r;
}

/// Maps (u, v) of the unit square to a point on the rectangle, in fractions of its width and
/// height. The function implements algorithm 2 of Urena et al., with z0 = -z and f = g / sin.
template <typename F>
inline Vec2<F> sample_spherical_rect(const SphericalRect<F>& r, const F& u, const F& v) {
  const auto [sin_a, cos_a] = sincos_2pi(F(fma(u, r.solid_angle, r.begin) * kInv2Pi));
  const F g = fma(cos_a, r.b0, F(-r.b1)), sine = abs(sin_a);
  const F n0 = r.z * r.near_y * sine;
  const F a2 = F(abs(g) - n0) * F(abs(g) + n0);
  const F away = F(r.z * sine) / sqrt(max(a2, F(1e-30f)));
  const F x = clamp(copysign(away, F(g * sin_a)), r.x0, r.x1);
  const F d2 = fma(x, x, F(r.z * r.z));
  const F h0 = r.y0 / sqrt(fma(r.y0, r.y0, d2)), h1 = r.y1 / sqrt(fma(r.y1, r.y1, d2));
  const F h = fma(v, F(h1 - h0), h0);
  const F rest = max(F((1.f - h) * (1.f + h)), F(1e-14f));
  const F y = clamp(F(h * sqrt(F(d2 / rest))), r.y0, r.y1);
  const auto share = [](const F& at, const F& inverse) {
    return clamp(F(at * inverse), F(0.f), F(1.f));
  };
  return {share(F(x - r.x0), r.inverse_width), share(F(y - r.y0), r.inverse_height)};
}

/// Returns the solid angle density of a point on the rectangle; 0 if the rectangle is seen from
/// behind.
template <typename F>
inline F rect_pdf(const SphericalRect<F>& r, const F& distance2, const F& cos_light,
                  const F& area) {
  const Mask<F> visible = (cos_light > 0.f) & (distance2 > 0.f) & (area > 0.f);
  const F by_angle = 1.f / select(r.usable, r.solid_angle, F(1.f));
  const F pdf = select(visible, by_angle, F(0.f));
  if (all(r.usable)) return pdf;
  return select(r.usable, pdf, area_to_solid_angle<F>(distance2, cos_light, area));
}

/// Returns the probability a of sampling a rectangle from its image, whose distribution has the
/// given `spread`. The probability is a multiple of 1/16, so that both techniques get a whole
/// number of the 2^24 values of u. The fraction g is estimated by its lower bound, solid angle /
/// (area * largest solid angle per area), where the largest solid angle per area is z / d^3 at the
/// closest point.
template <typename F>
inline F texture_share(const SphericalRect<F>& r, const F& area, float spread) {
  const F x = clamp(F(0.f), r.x0, r.x1), y = clamp(F(0.f), r.y0, r.y1);
  const F d2 = fma(x, x, fma(y, y, F(r.z * r.z)));
  const F most = area * r.z;
  const F g = r.solid_angle * d2 * sqrt(d2) / select(r.usable & (most > 0.f), most, F(1.f));
  const F share = g / F(g + spread);
  const F sixteenths = clamp(floor(fma(share, F(16.f), F(0.5f))), F(2.f), F(14.f));
  return select(r.usable, sixteenths, F(14.f)) * 0.0625f;
}

/// Returns the lanes whose rectangles are sampled from an image.
template <typename F>
inline Mask<F> has_light_texture(const LightReader<F>& light, const Mask<F>& active) {
  return active & Mask<F>(light.texture() != UInt<F>(kNoTexture)) &
         Mask<F>(light[&LightRecord::distribution] != UInt<F>(kNoDistribution));
}

/// Calls one(distribution, lanes) for each distinct image of the lanes' lights.
template <typename F, typename Function>
inline void for_each_texture(const LightView& view, const LightReader<F>& light,
                             const Mask<F>& lanes, const Function& one) {
  const UInt<F> index = light[&LightRecord::distribution];
  Mask<F> pending = lanes;
  while (any(pending)) {
    const auto first = static_cast<size_t>(std::countr_zero(lane_bits<F>(pending)));
    const uint32_t number = lane(index, first);
    const Mask<F> same = pending & Mask<F>(index == UInt<F>(number));
    one(view.distributions[number], same);
    pending = pending & not_(same);
  }
}

/// Maps (u, v) to a point on the rectangle, in fractions of its edges, ignoring its image.
template <typename F>
inline Vec2<F> sample_rect_uniformly(const SphericalRect<F>& r, const F& u, const F& v,
                                     const Mask<F>& active) {
  if (none(active & r.usable)) return {u, v};
  const Vec2<F> by_angle = sample_spherical_rect<F>(r, u, v);
  return {select(r.usable, by_angle.x, u), select(r.usable, by_angle.y, v)};
}

/// Point on the rectangle in fractions of its edges. `share` is the probability of sampling from
/// the image, or 0 without an image, and `texture_pdf` is the image density over the unit square.
template <typename F>
struct RectPoint {
  Vec2<F> at;
  F share, texture_pdf;
};

template <typename F>
[[gnu::noinline]] RectPoint<F> sample_textured_rect(const LightView& view,
                                                    const LightReader<F>& light,
                                                    const SphericalRect<F>& r, const F& u,
                                                    const F& v, const Mask<F>& active) {
  F share(0.f);
  const Mask<F> has_image = has_light_texture<F>(light, active);
  for_each_texture<F>(view, light, has_image, [&](const Distribution2D& d, const Mask<F>& lanes) {
    share = select(lanes, texture_share<F>(r, light.area(), d.spread), share);
  });
  const Mask<F> by_texture = has_image & (u < share);
  const F rest = clamp(F((u - share) / F(1.f - share)), F(0.f), F(kOneMinusEpsilon));
  RectPoint<F> point{sample_rect_uniformly<F>(r, select(by_texture, u, rest), v, active), share,
                     F(0.f)};
  const F within = select(by_texture, F(u / select(by_texture, share, F(1.f))), F(0.f));
  for_each_texture<F>(view, light, has_image, [&](const Distribution2D& d, const Mask<F>& lanes) {
    const Mask<F> here = lanes & by_texture, by_area = lanes & not_(by_texture);
    if (any(here)) {
      const ImagePoint<F> p = sample_image<F>(d, within, v, here);
      point.at = {select(here, p.x, point.at.x), select(here, F(1.f - p.y), point.at.y)};
      point.texture_pdf = select(here, p.pdf, point.texture_pdf);
    }
    if (any(by_area)) {
      const F pdf = image_pdf_at<F>(d, point.at.x, F(1.f - point.at.y), by_area);
      point.texture_pdf = select(by_area, pdf, point.texture_pdf);
    }
  });
  return point;
}

/// Returns the solid angle density of the mixture of image and uniform sampling. `even` is the
/// density of uniform sampling.
template <typename F>
inline F textured_rect_pdf(const F& share, const F& texture_pdf, const F& even, const F& distance2,
                           const F& cos_light, const F& area) {
  const F by_texture = texture_pdf * area_to_solid_angle<F>(distance2, cos_light, area);
  return fma(share, by_texture, F(F(1.f - share) * even));
}

/// Samples a point q = p + a u + b v. The rectangle emits only towards n.
template <typename F>
inline KindSample<F> sample_rect(const LightView& view, const LightReader<F>& light,
                                 const Vec3<F>& from, const F& u, const F& v,
                                 const Mask<F>& active) {
  const SphericalRect<F> r = make_spherical_rect<F>(light, from);
  RectPoint<F> point{Vec2<F>{u, v}, F(0.f), F(0.f)};
  const bool has_image = any(has_light_texture<F>(light, active));
  if (has_image) [[unlikely]]
    point = sample_textured_rect<F>(view, light, r, u, v, active);
  else
    point.at = sample_rect_uniformly<F>(r, u, v, active);
  const Vec3<F> q = fma(light.u(), point.at.x, fma(light.v(), point.at.y, light.p()));
  const Direction<F> d = make_direction<F>(q - from);
  const F cos_light = -dot(d.wi, light.n());
  F pdf = rect_pdf<F>(r, d.length2, cos_light, light.area());
  if (has_image) [[unlikely]]
    pdf = textured_rect_pdf<F>(point.share, point.texture_pdf, pdf, d.length2, cos_light,
                               light.area());
  return {d.wi, d.length,
          rect_radiance<F>(light, view.materials.textures, point.at.x, point.at.y,
                           active & (pdf > 0.f)),
          pdf, Mask<F>(false)};
}

/// Returns the position of a point of the rectangle's plane in fractions of its edges: with h = q -
/// p = a u + b v and m = u x v, a = (h x v) . m / m^2 and b = (u x h) . m / m^2.
template <typename F>
inline Vec2<F> rect_uv(const LightReader<F>& light, const Vec3<F>& q) {
  const Vec3<F> h = q - light.p();
  const Vec3<F> edge_u = light.u(), edge_v = light.v();
  const Vec3<F> m = cross(edge_u, edge_v);
  const F m2 = dot(m, m);
  const F inverse = 1.f / select(m2 > 0.f, m2, F(1.f));
  const F a = dot(cross(h, edge_v), m) * inverse;
  const F b = dot(cross(edge_u, h), m) * inverse;
  return {clamp(a, F(0.f), F(1.f)), clamp(b, F(0.f), F(1.f))};
}

/// Returns radiance and sampling density for a ray that hits the rectangle at distance t.
template <typename F>
inline KindHit<F> hit_rect(const LightView& view, const LightReader<F>& light,
                           const Vec3<F>& origin, const Vec3<F>& dir, const F& t,
                           const Mask<F>& active) {
  const F cos_light = -dot(dir, light.n());
  const Mask<F> front = active & (cos_light > 0.f);
  const Vec2<F> at = rect_uv<F>(light, fma(dir, t, origin));
  const Color<F> radiance = rect_radiance<F>(light, view.materials.textures, at.x, at.y, front);
  const SphericalRect<F> r = make_spherical_rect<F>(light, origin);
  F pdf = rect_pdf<F>(r, F(t * t), cos_light, light.area());
  const Mask<F> has_image = has_light_texture<F>(light, front);
  for_each_texture<F>(view, light, has_image, [&](const Distribution2D& d, const Mask<F>& lanes) {
    const F mixed = textured_rect_pdf<F>(texture_share<F>(r, light.area(), d.spread),
                                         image_pdf_at<F>(d, at.x, F(1.f - at.y), lanes), pdf,
                                         F(t * t), cos_light, light.area());
    pdf = select(lanes, mixed, pdf);
  });
  return {select<F>(front, radiance, Color<F>(F(0.f))), pdf};
}

/// Samples a light path that starts at a point on the rectangle, sampled from its image or
/// uniformly.
template <typename F>
inline KindEmission<F> emit_rect(const EmissionQuery<F>& q) {
  const LightReader<F>& light = q.light;
  Vec2<F> at{q.u, q.v};
  F square_pdf(1.f);
  const Mask<F> has_image = has_light_texture<F>(light, q.lanes);
  for_each_texture<F>(q.view, light, has_image, [&](const Distribution2D& d, const Mask<F>& lanes) {
    const ImagePoint<F> point = sample_image<F>(d, q.u, q.v, lanes);
    at = {select(lanes, point.x, at.x), select(lanes, F(1.f - point.y), at.y)};
    square_pdf = select(lanes, point.pdf, square_pdf);
  });
  const Vec3<F> p = fma(light.u(), at.x, fma(light.v(), at.y, light.p()));
  return emit_by_cosine<F>(p, light.n(), q.s, q.t,
                           rect_radiance<F>(light, q.view.materials.textures, at.x, at.y, q.lanes),
                           F(square_pdf * uniform_emission_density<F>(light.area())));
}

/// Returns the emission density (KindEmission::density) of the light path that emit_rect() samples
/// in the reverse direction of a ray that hits the rectangle.
template <typename F>
inline F rect_emission_density(const LightHitQuery<F>& m) {
  const LightReader<F>& light = m.light;
  F density = uniform_emission_density<F>(light.area());
  const Mask<F> has_image = has_light_texture<F>(light, m.lanes);
  if (none(has_image)) return density;
  const Vec2<F> at = rect_uv<F>(light, fma(m.dir, m.t, m.origin));
  for_each_texture<F>(m.view, light, has_image, [&](const Distribution2D& d, const Mask<F>& lanes) {
    density *= select(lanes, image_pdf_at<F>(d, at.x, F(1.f - at.y), lanes), F(1.f));
  });
  return density;
}

}  // namespace wavecomb::detail

namespace wavecomb {

/// Class of rect lights, an entry of WAVECOMB_LIGHT_KINDS (light/kinds/kinds.h).
struct RectKind : FlatKind {
  static LightKindInfo describe();
  template <typename F>
  static detail::KindSample<F> sample(const detail::LightQuery<F>& q) {
    return detail::sample_rect<F>(q.view, q.light, q.from, q.u, q.v, q.lanes);
  }
  template <typename F>
  static detail::KindHit<F> hit(const detail::LightHitQuery<F>& m) {
    return detail::hit_rect<F>(m.view, m.light, m.origin, m.dir, m.t, m.lanes);
  }
  template <typename F>
  static detail::KindEmission<F> emit(const detail::EmissionQuery<F>& q) {
    return detail::emit_rect<F>(q);
  }
  template <typename F>
  static F emission_density(const detail::LightHitQuery<F>& m) {
    return detail::rect_emission_density<F>(m);
  }
};

}  // namespace wavecomb
