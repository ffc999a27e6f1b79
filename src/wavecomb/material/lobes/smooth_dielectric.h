// SPDX-License-Identifier: Apache-2.0
/// Reflection and refraction at a smooth dielectric interface: two delta lobes.
#pragma once

#include "wavecomb/material/bsdf.h"
#include "wavecomb/material/lobes/fresnel.h"

namespace wavecomb {

/// Relative index for a ray from the side of wo: `ior` from above (outside), 1 / ior from below.
template <typename F>
inline F relative_ior(const Vec3<F>& wo, const F& ior) {
  return select(wo.z > 0.f, ior, F(1.f / ior));
}

/// Refracts wo at the unit normal h; cos_o = wo . h > 0 (Walter et al. 2007, eq. 40).
template <typename F>
inline Vec3<F> refract(const Vec3<F>& wo, const Vec3<F>& h, const F& cos_o, const F& cos_t,
                       const F& eta) {
  const F inv = 1.f / eta;
  return fma(h, fma(cos_o, inv, F(-cos_t)), Vec3<F>(wo * F(-inv)));
}

/// Samples reflection with probability R. A transmitted sample has the weight tint / eta^2, since
/// refraction scales radiance (Veach, "Robust Monte Carlo Methods", 1997, section 5.2).
template <typename F>
inline BsdfSample<F> sample_smooth_dielectric(const Vec3<F>& wo, const F& ior, const Color<F>& tint,
                                              bool schlick, const F& u_lobe) {
  const F eta = relative_ior(wo, ior);
  const F cos_o = abs(wo.z);
  const auto [r, cos_t] = fresnel_dielectric(cos_o, eta, schlick);
  const Mask<F> reflects = u_lobe < r;
  const F side = copysign(F(1.f), wo.z);
  const F inv = 1.f / eta;
  const Vec3<F> down(-wo.x * inv, -wo.y * inv, -side * cos_t);
  const Vec3<F> up(-wo.x, -wo.y, wo.z);
  const Mask<F> valid = (cos_o > 0.f) & (reflects | (cos_t > 0.f));
  BsdfSample<F> s;
  s.wi = select<F>(reflects, up, normalize(down));
  s.wi = select<F>(valid, s.wi, Vec3<F>(F(0.f), F(0.f), F(1.f)));
  s.weight = select<F>(reflects, Color<F>(F(1.f)), tint * F(inv * inv));
  s.weight = select<F>(valid, s.weight, Color<F>(F(0.f)));
  s.pdf = select(valid, select(reflects, r, F(1.f - r)), F(0.f));
  s.is_delta = valid;
  s.eta = select(reflects | not_(valid), F(1.f), eta);
  s.roughness = F(0.f);
  return s;
}

}  // namespace wavecomb
