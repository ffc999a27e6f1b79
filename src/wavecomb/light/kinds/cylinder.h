// SPDX-License-Identifier: Apache-2.0
/// Cylinder lights, which are open at both ends and emit outwards.
#pragma once

#include "wavecomb/light/records/record_reader.h"

namespace wavecomb::detail {

/// Cylinder as seen from a point outside. The orthonormal frame consists of the cylinder's axis a,
/// the unit vector e from the point perpendicularly towards the axis, and f. A direction
///   cos(gamma) (cos(alpha) e + sin(alpha) f) + sin(gamma) a
/// hits the near side of the infinite cylinder at the perpendicular distance s(alpha). For a given
/// alpha, the visible part of the finite cylinder is an interval of sin(gamma). Directions that are
/// uniform in alpha and, for a given alpha, uniform in sin(gamma) therefore have the density 1 / (2
/// alpha_max (sin(gamma_1) - sin(gamma_0))). The density would be uniform over the visible solid
/// angle if the interval of sin(gamma) had the same size for all alpha.
template <typename F>
struct CylinderFrame {
  Vec3<F> a, e, f;
  F distance;        ///< perpendicular distance to the axis
  F radius, length;  ///< of the cylinder
  F begin;           ///< start of the cylinder along its axis a, relative to the point
  F alpha;           ///< largest visible alpha, in radians
  Mask<F> outside;
};

template <typename F>
inline CylinderFrame<F> make_cylinder_frame(const LightReader<F>& light, const Vec3<F>& from) {
  CylinderFrame<F> c;
  const Direction<F> axis = make_direction<F>(light.u());
  c.a = axis.wi;
  c.length = axis.length;
  c.radius = light.radius();
  const Vec3<F> to_end = light.p() - from;
  c.begin = dot(to_end, c.a);
  const Direction<F> across = make_direction<F>(to_end - c.a * c.begin);
  c.e = across.wi;
  c.f = cross(c.a, c.e);
  c.distance = across.length;
  c.outside = (c.length > 0.f) & (c.radius > 0.f) & (c.distance > c.radius);
  const F r = min(c.radius, c.distance);
  c.alpha = atan2(r, safe_sqrt(F((c.distance - r) * (c.distance + r))));
  return c;
}

/// Returns s(alpha) = d cos(alpha) - sqrt(r^2 - d^2 sin^2(alpha)).
template <typename F>
inline F cylinder_across(const CylinderFrame<F>& c, const F& sin_alpha, const F& cos_alpha) {
  const F off = c.distance * sin_alpha;
  const F half_chord = safe_sqrt(F((c.radius - off) * (c.radius + off)));
  return max(fma(c.distance, cos_alpha, F(-half_chord)), F(0.f));
}

/// Visible interval of sin(gamma) = z / h for one alpha, where z is the position along the axis, s
/// the perpendicular distance, and h = sqrt(z^2 + s^2).
template <typename F>
struct CylinderSpan {
  F begin, size;     ///< z_0 / h_0, and z_1 / h_1 - z_0 / h_0
  F rest;            ///< 1 - |begin|
  Mask<F> one_side;  ///< whether both ends of the cylinder lie on the same side of the point along
                     ///< the axis
};
/// Computes the visible interval without cancellation. If both ends are on one side, the numerator
/// of the size, z_1 h_0 - z_0 h_1, equals s^2 (z_1^2 - z_0^2) / (z_1 h_0 + z_0 h_1), and the member
/// `rest` equals s^2 / (h_0 (h_0 + |z_0|)).
template <typename F>
inline CylinderSpan<F> cylinder_span(const CylinderFrame<F>& c, const F& s) {
  const F z0 = c.begin, z1 = c.begin + c.length;
  const F s2 = s * s;
  const F h0 = sqrt(fma(z0, z0, s2)), h1 = sqrt(fma(z1, z1, s2));
  const Mask<F> valid = (h0 > 0.f) & (h1 > 0.f);
  const F x = z1 * h0, y = z0 * h1;
  const F sum = x + y;
  const Mask<F> one_side = z0 * z1 > 0.f;
  const F numerator =
      select(one_side, F(s2 * c.length * F(z0 + z1) / select(one_side, sum, F(1.f))), F(x - y));
  return {z0 / select(h0 > 0.f, h0, F(1.f)),
          select(valid, F(numerator / select(valid, F(h0 * h1), F(1.f))), F(0.f)),
          s2 / select(h0 > 0.f, F(h0 * F(h0 + abs(z0))), F(1.f)), one_side};
}

template <typename F>
struct CylinderSlope {
  F sin_gamma, cos_gamma;
};
/// Returns sin(gamma) and cos(gamma) at the fraction v of the visible interval. Far along the
/// cylinder, all sines are within a millionth of 1. Since the hit distance depends on the cosine,
/// the difference of the sine from 1 is computed separately.
template <typename F>
inline CylinderSlope<F> cylinder_slope(const CylinderSpan<F>& span, const F& v) {
  const F step = v * span.size;
  const F sign = select(span.begin < 0.f, F(-1.f), F(1.f));
  const F missing_length = clamp(fma(-sign, step, span.rest), F(0.f), F(1.f));
  const F sine = clamp(F(span.begin + step), F(-1.f), F(1.f));
  const F rest = select(span.one_side, missing_length, F(1.f - abs(sine)));
  return {select(span.one_side, F(sign * F(1.f - missing_length)), sine),
          safe_sqrt(F(rest * F(2.f - rest)))};
}

/// Returns the solid angle density of a direction that hits the near side; `size` is the size of
/// the visible interval of sin(gamma) at the direction's alpha.
template <typename F>
inline F cylinder_pdf(const CylinderFrame<F>& c, const F& size) {
  const F area = 2.f * c.alpha * size;
  const Mask<F> valid = c.outside & (area > 0.f);
  const F pdf = 1.f / select(valid, area, F(1.f));
  return select(valid & is_finite(pdf), pdf, F(0.f));
}

template <typename F>
inline KindSample<F> sample_cylinder(const LightReader<F>& light, const Vec3<F>& from, const F& u,
                                     const F& v) {
  const CylinderFrame<F> c = make_cylinder_frame<F>(light, from);
  const F alpha = fma(F(2.f), u, F(-1.f)) * c.alpha;
  const auto [sin_alpha, cos_alpha] = sincos_2pi(F(alpha * kInv2Pi));
  const F s = cylinder_across<F>(c, sin_alpha, cos_alpha);
  const CylinderSpan<F> span = cylinder_span<F>(c, s);
  const auto [sin_gamma, cos_gamma] = cylinder_slope<F>(span, v);
  const Vec3<F> across = fma(c.e, cos_alpha, c.f * sin_alpha);
  const Vec3<F> wi = fma(across, cos_gamma, c.a * sin_gamma);
  const Mask<F> valid = cos_gamma > 0.f;
  return {wi, s / select(valid, cos_gamma, F(1.f)), light.radiance(),
          select(valid, cylinder_pdf<F>(c, span.size), F(0.f)), Mask<F>(false)};
}

/// Returns radiance and sampling density for a ray from `origin` that hit the cylinder at distance
/// t. A cylinder light emits no light inwards.
template <typename F>
inline KindHit<F> hit_cylinder(const LightReader<F>& light, const Vec3<F>& origin,
                               const Vec3<F>& dir, const F& t) {
  const CylinderFrame<F> c = make_cylinder_frame<F>(light, origin);
  const F x = dot(dir, c.e), y = dot(dir, c.f);
  const F flat2 = fma(x, x, F(y * y));
  const Mask<F> valid = c.outside & (flat2 > 0.f);
  const F inverse = 1.f / sqrt(select(valid, flat2, F(1.f)));
  // A ray hits the near side before it reaches its closest point to the axis.
  const Mask<F> front = valid & (F(t * flat2) <= F(c.distance * x));
  const F s = cylinder_across<F>(c, F(y * inverse), F(x * inverse));
  const F size = cylinder_span<F>(c, s).size;
  return {select<F>(front, light.radiance(), Color<F>(F(0.f))),
          select(front, cylinder_pdf<F>(c, size), F(0.f))};
}

/// Samples a light path that starts uniformly on the outer surface of the cylinder.
template <typename F>
inline KindEmission<F> emit_cylinder(const EmissionQuery<F>& q) {
  const LightReader<F>& light = q.light;
  const Frame<F> frame = make_frame(make_direction<F>(light.u()).wi);
  const auto [sine, cosine] = sincos_2pi(q.u);
  const Vec3<F> n = fma(frame.s, cosine, Vec3<F>(frame.t * sine));
  const Vec3<F> p = fma(n, light.radius(), fma(light.u(), q.v, light.p()));
  return emit_by_cosine<F>(p, n, q.s, q.t, light.radiance(),
                           uniform_emission_density<F>(light.area()));
}

}  // namespace wavecomb::detail

namespace wavecomb {

/// Class of cylinder lights, an entry of WAVECOMB_LIGHT_KINDS (light/kinds/kinds.h).
struct CylinderKind : FiniteKind {
  static LightKindInfo describe();
  template <typename F>
  static Vec3<F> emission_normal(const detail::LightReader<F>& light, const Vec3<F>& p) {
    const Vec3<F> axis = light.u();
    const Vec3<F> n = p - light.p();
    return detail::unit_or_zero<F>(n - axis * F(dot(n, axis) / length_squared(axis)));
  }
  template <typename F>
  static Mask<F> is_delta(const detail::LightReader<F>& /*light*/) {
    return Mask<F>(false);
  }
  template <typename F>
  static detail::KindSample<F> sample(const detail::LightQuery<F>& q) {
    return detail::sample_cylinder<F>(q.light, q.from, q.u, q.v);
  }
  template <typename F>
  static detail::KindHit<F> hit(const detail::LightHitQuery<F>& m) {
    return detail::hit_cylinder<F>(m.light, m.origin, m.dir, m.t);
  }
  template <typename F>
  static detail::KindEmission<F> emit(const detail::EmissionQuery<F>& q) {
    return detail::emit_cylinder<F>(q);
  }
  template <typename F>
  static F emission_density(const detail::LightHitQuery<F>& m) {
    return detail::uniform_emission_density<F>(m.light.area());
  }
};

}  // namespace wavecomb
