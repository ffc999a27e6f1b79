// SPDX-License-Identifier: Apache-2.0
/// Distant lights, which emit from a cone of directions or from a single direction.
#pragma once

#include "wavecomb/core/frame.h"
#include "wavecomb/light/records/record_reader.h"

namespace wavecomb::detail {

/// Returns the uniform density 1 / (2 pi (1 - cos)) over the light's cone of directions.
template <typename F>
inline F distant_pdf(const F& one_minus_cos) {
  const F pdf = kInv2Pi / select(one_minus_cos > 0.f, one_minus_cos, F(1.f));
  return select((one_minus_cos > 0.f) & is_finite(pdf), pdf, F(0.f));
}

/// Samples a direction in the cone around -n. If the angle is 0, the direction is -n and `radiance`
/// is the irradiance.
template <typename F>
inline KindSample<F> sample_distant(const LightReader<F>& light, const F& u, const F& v) {
  const Vec3<F> axis = -light.n();
  const F one_minus_cos = light.one_minus_cos();
  const Mask<F> is_delta = one_minus_cos == 0.f;
  const Vec3<F> wi = make_frame(axis).to_world(square_to_cone(u, v, one_minus_cos));
  return {select<F>(is_delta, axis, wi), F(kFarAway), light.radiance(),
          select(is_delta, F(1.f), distant_pdf<F>(one_minus_cos)), is_delta};
}

/// Returns radiance and sampling density for a ray that left the scene. For unit vectors 1 -
/// cos(angle) = |dir - axis|^2 / 2, which is accurate for small angles, unlike 1 - dot(dir, axis).
template <typename F>
inline KindHit<F> hit_distant(const LightReader<F>& light, const Vec3<F>& dir) {
  const F one_minus_cos = light.one_minus_cos();
  const Vec3<F> difference = dir + light.n();
  const Mask<F> inside =
      (one_minus_cos > 0.f) & (length_squared(difference) * 0.5f <= one_minus_cos);
  return {select<F>(inside, light.radiance(), Color<F>(F(0.f))),
          select(inside, distant_pdf<F>(one_minus_cos), F(0.f))};
}

/// Returns the emission density (KindEmission::density) of light paths along -dir. See
/// hit_distant().
template <typename F>
inline F distant_emission_density(const LightView& view, const LightReader<F>& light,
                                  const Vec3<F>& dir) {
  const F direction_pdf =
      select(light.one_minus_cos() == 0.f, F(1.f), hit_distant<F>(light, dir).pdf);
  return infinite_emission_pdf<F>(view, direction_pdf);
}

/// Samples a light path with a direction in the light's cone.
template <typename F>
inline KindEmission<F> emit_distant(const EmissionQuery<F>& q) {
  const KindSample<F> direction = sample_distant<F>(q.light, q.s, q.t);
  return emit_infinite<F>(q.view, -direction.wi, q.u, q.v, direction.radiance, direction.pdf);
}

}  // namespace wavecomb::detail

namespace wavecomb {

/// Class of distant lights, an entry of WAVECOMB_LIGHT_KINDS (light/kinds/kinds.h).
struct DistantKind : InfiniteKind {
  static LightKindInfo describe();
  template <typename F>
  static Mask<F> is_delta(const detail::LightReader<F>& light) {
    return light.one_minus_cos() == 0.f;
  }
  template <typename F>
  static detail::KindSample<F> sample(const detail::LightQuery<F>& q) {
    return detail::sample_distant<F>(q.light, q.u, q.v);
  }
  template <typename F>
  static detail::KindHit<F> escape(const detail::LightEscape<F>& e) {
    return detail::hit_distant<F>(detail::LightReader<F>(e.light, e.lanes), e.dir);
  }
  template <typename F>
  static detail::KindEmission<F> emit(const detail::EmissionQuery<F>& q) {
    return detail::emit_distant<F>(q);
  }
  template <typename F>
  static F emission_density(const detail::LightHitQuery<F>& m) {
    return detail::distant_emission_density<F>(m.view, m.light, m.dir);
  }
};

}  // namespace wavecomb
