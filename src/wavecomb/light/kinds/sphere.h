// SPDX-License-Identifier: Apache-2.0
/// Sphere lights, which emit outwards, and point lights.
#pragma once

#include "wavecomb/core/frame.h"
#include "wavecomb/light/records/record_reader.h"

namespace wavecomb::detail {

/// Cone of directions from a point to a sphere.
template <typename F>
struct SphereCone {
  Vec3<F> axis;           ///< unit vector to the centre
  F distance2, distance;  ///< squared distance and distance to the centre
  F one_minus_cos;        ///< 1 - cos of the half angle, accurate for small angles
  /// Whether the point is outside the sphere; the light emits only outwards.
  Mask<F> outside;
};

/// Computes the cone from sin^2 = r^2 / d^2 and 1 - cos = sin^2 / (1 + cos), which avoids
/// cancellation for small angles.
template <typename F>
inline SphereCone<F> make_sphere_cone(const LightReader<F>& light, const Vec3<F>& from) {
  const Direction<F> d = make_direction<F>(light.p() - from);
  const F radius = light.radius();
  const F r2 = radius * radius;
  const Mask<F> outside = (d.length2 > r2) & (d.length2 > 0.f);
  const F sin2 = r2 / select(outside, d.length2, F(1.f));
  return {d.wi, d.length2, d.length, sin2 / (1.f + safe_sqrt(F(1.f - sin2))), outside};
}

/// Returns the uniform density 1 / (2 pi (1 - cos)) over the cone; 0 for points inside the sphere,
/// and if the sphere is too small.
template <typename F>
inline F sphere_cone_pdf(const SphereCone<F>& cone) {
  const Mask<F> valid = cone.outside & (cone.one_minus_cos > 0.f);
  const F pdf = kInv2Pi / select(valid, cone.one_minus_cos, F(1.f));
  return select(valid & is_finite(pdf), pdf, F(0.f));
}

/// Samples a direction uniformly in the cone that the sphere subtends (P. Shirley, C. Wang, K.
/// Zimmerman, "Monte Carlo Techniques for Direct Lighting Calculations", ACM TOG 15(1) 1996). For a
/// point light (radius 0), returns the direction to the centre.
template <typename F>
inline KindSample<F> sample_sphere(const LightReader<F>& light, const Vec3<F>& from, const F& u,
                                   const F& v) {
  const SphereCone<F> cone = make_sphere_cone<F>(light, from);
  const F radius = light.radius();
  const Mask<F> is_point = radius == 0.f;

  const Vec3<F> local = square_to_cone(u, v, cone.one_minus_cos);
  const Vec3<F> wi = make_frame(cone.axis).to_world(local);
  // The distance to the near side of the sphere is d cos - sqrt(r^2 - d^2 sin^2).
  const F sin2 = fma(local.x, local.x, F(local.y * local.y));
  const F half_chord = safe_sqrt(F(radius * radius - cone.distance2 * sin2));
  const F near = max(fma(cone.distance, local.z, F(-half_chord)), F(0.f));

  const F inverse2 = 1.f / select(cone.distance2 > 0.f, cone.distance2, F(1.f));
  const Color<F> radiance = light.radiance();
  const F point_pdf = select((cone.distance2 > 0.f) & is_finite(inverse2), F(1.f), F(0.f));
  return {select<F>(is_point, cone.axis, wi), select(is_point, cone.distance, near),
          select<F>(is_point, Color<F>(radiance * inverse2), radiance),
          select(is_point, point_pdf, sphere_cone_pdf<F>(cone)), is_point};
}

/// Returns radiance and sampling density for a ray from `origin` that hit the sphere.
template <typename F>
inline KindHit<F> hit_sphere(const LightReader<F>& light, const Vec3<F>& origin) {
  const SphereCone<F> cone = make_sphere_cone<F>(light, origin);
  return {select<F>(cone.outside, light.radiance(), Color<F>(F(0.f))), sphere_cone_pdf<F>(cone)};
}

/// Samples a light path that starts uniformly on the surface of the sphere, or with a uniform
/// direction from a point light.
template <typename F>
inline KindEmission<F> emit_sphere(const EmissionQuery<F>& q) {
  const LightReader<F>& light = q.light;
  const Mask<F> is_point = light.radius() == 0.f;
  const Vec3<F> n = square_to_sphere(q.u, q.v);
  KindEmission<F> e =
      emit_by_cosine<F>(fma(n, light.radius(), light.p()), n, q.s, q.t, light.radiance(),
                        uniform_emission_density<F>(light.area()));
  e.d = select<F>(is_point, square_to_sphere(q.s, q.t), e.d);
  e.n = select<F>(is_point, Vec3<F>(F(0.f)), e.n);
  e.density = select(is_point, F(kInv4Pi), e.density);
  return e;
}

/// Returns the emission density (KindEmission::density) of the light paths that emit_sphere()
/// samples.
template <typename F>
inline F sphere_emission_density(const LightReader<F>& light) {
  return select(light.radius() == 0.f, F(kInv4Pi), uniform_emission_density<F>(light.area()));
}

}  // namespace wavecomb::detail

namespace wavecomb {

/// Class of sphere lights, an entry of WAVECOMB_LIGHT_KINDS (light/kinds/kinds.h).
struct SphereKind : FiniteKind {
  static LightKindInfo describe();
  template <typename F>
  static Vec3<F> emission_normal(const detail::LightReader<F>& light, const Vec3<F>& p) {
    return detail::unit_or_zero<F>(p - light.p());
  }
  /// A sphere of radius 0 is a point light.
  template <typename F>
  static Mask<F> is_delta(const detail::LightReader<F>& light) {
    return light.radius() == 0.f;
  }
  template <typename F>
  static detail::KindSample<F> sample(const detail::LightQuery<F>& q) {
    return detail::sample_sphere<F>(q.light, q.from, q.u, q.v);
  }
  template <typename F>
  static detail::KindHit<F> hit(const detail::LightHitQuery<F>& m) {
    return detail::hit_sphere<F>(m.light, m.origin);
  }
  template <typename F>
  static detail::KindEmission<F> emit(const detail::EmissionQuery<F>& q) {
    return detail::emit_sphere<F>(q);
  }
  template <typename F>
  static F emission_density(const detail::LightHitQuery<F>& m) {
    return detail::sphere_emission_density<F>(m.light);
  }
};

}  // namespace wavecomb
