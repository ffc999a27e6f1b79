// SPDX-License-Identifier: Apache-2.0
/// Scattering by a hair fibre: M. Chiang, B. Bitterli, C. Tappan, B. Burley, "A Practical and
/// Controllable Hair and Fur Model for Production Path Tracing", Eurographics 2016, after E. d'Eon
/// et al., "An Energy-Conserving Hair Reflectance Model", EGSR 2011.
///
///   f(wo, wi) |cos theta_i| = sum over p of  M_p(theta_o, theta_i)  A_p(theta_o, h)  N_p(phi)
///
/// p = 0 is reflection (R), 1 transmission (TT), 2 one internal reflection (TRT), and 3 all further
/// internal reflections, as one lobe that is uniform in azimuth. theta is the inclination to the
/// plane normal to the fibre, phi the azimuth around it.
///
/// Directions are local: x lies along the fibre from root to tip, and z is the normal of the round
/// fibre at the hit. wo therefore determines the offset of the hit from the fibre's centre line, in
/// radii: h = sin gamma_o = wo.y / |(wo.y, wo.z)|.
#pragma once

#include <array>

#include "wavecomb/core/math.h"
#include "wavecomb/core/vec.h"
#include "wavecomb/material/lobes/fresnel.h"

namespace wavecomb {

/// e^-x I0(x) for x >= 0, with I0 the modified Bessel function (Abramowitz and Stegun, "Handbook of
/// Mathematical Functions", 9.8.1 and 9.8.2); relative error below 5e-7.
template <typename F>
inline F scaled_bessel_i0(const F& x) {
  const F t = min(sqr(F(x * (1.f / 3.75f))), F(1.f));
  F near = fma(t, F(0.0045813f), F(0.0360768f));
  near = fma(near, t, F(0.2659732f));
  near = fma(near, t, F(1.2067492f));
  near = fma(near, t, F(3.0899424f));
  near = fma(near, t, F(3.5156229f));
  near = fma(near, t, F(1.f));
  const F large = max(x, F(3.75f)), s = 3.75f / large;
  F far = fma(s, F(0.00392377f), F(-0.01647633f));
  far = fma(far, s, F(0.02635537f));
  far = fma(far, s, F(-0.02057706f));
  far = fma(far, s, F(0.00916281f));
  far = fma(far, s, F(-0.00157565f));
  far = fma(far, s, F(0.00225319f));
  far = fma(far, s, F(0.01328592f));
  far = fma(far, s, F(0.39894228f));
  return select(x < 3.75f, F(near * exp(F(-x))), F(far / sqrt(large)));
}

/// M_p, the longitudinal lobe of variance v (d'Eon et al. 2011, eq. 7),
///   M = csch(1 / v) / (2 v)  exp(-sin_i sin_o / v)  I0(cos_i cos_o / v),
/// as a density over sin theta_i. The exponents are combined as
///   -sin sin + cos cos - 1 = -((cos_i - cos_o)^2 + (sin_i + sin_o)^2) / 2,
/// which avoids cancellation in narrow lobes.
template <typename F>
class LongitudinalLobe {
 public:
  explicit LongitudinalLobe(const F& variance)
      : v_(max(variance, F(kLeast))), inverse_(1.f / v_), tail_(exp(F(-2.f * inverse_))) {}

  F density(const F& sin_i, const F& cos_i, const F& sin_o, const F& cos_o) const {
    const F separation2 = fma(F(cos_i - cos_o), F(cos_i - cos_o), sqr(F(sin_i + sin_o)));
    return exp(F(-0.5f * separation2 * inverse_)) * scaled_bessel_i0(F(cos_i * cos_o * inverse_)) *
           inverse_ / F(1.f - tail_);
  }
  /// Samples sin theta_i from two sample values in [0, 1) (d'Eon, "Importance Sampling for
  /// Physically-Based Hair Fiber Models", SIGGRAPH Asia 2013 technical briefs).
  F sample(const F& sin_o, const F& cos_o, const F& u, const F& turn) const {
    const F below = -v_ * log(max(fma(F(1.f - u), tail_, u), F(1e-30f)));  // 1 - cos
    const F d = clamp(below, F(0.f), F(2.f));
    const F sine = safe_sqrt(F(d * (2.f - d)));
    const F along = fma(F(sine * sincos_2pi(turn).cos), cos_o, F(F(d - 1.f) * sin_o));
    return clamp(along, F(-1.f), F(1.f));
  }

 private:
  static constexpr float kLeast = 1e-5f;
  F v_, inverse_, tail_;
};

/// N_p, the azimuthal lobe: a logistic density of scale s, truncated to [-pi, pi] (Chiang et al.
/// 2016, eq. 11 and 12).
template <typename F>
class AzimuthalLobe {
 public:
  explicit AzimuthalLobe(const F& scale)
      : s_(max(scale, F(1e-3f))), inverse_(1.f / s_), tail_(exp(F(-kPi * inverse_))) {}

  /// Density at x in [-pi, pi].
  F density(const F& x) const {
    const F e = exp(F(-abs(x) * inverse_));
    return e * inverse_ * F(1.f + tail_) / F(sqr(F(1.f + e)) * F(1.f - tail_));
  }
  F sample(const F& u) const {
    const F part = u * F(1.f - tail_);
    const F x = s_ * F(log(max(F(tail_ + part), F(1e-30f))) - log(max(F(1.f - part), F(1e-30f))));
    return clamp(x, F(-kPi), F(kPi));
  }

 private:
  F s_, inverse_, tail_;
};

/// Wraps the angle x to [-pi, pi].
template <typename F>
inline F wrapped_angle(const F& x) {
  const F turns = floor(fma(x, F(kInv2Pi), F(0.5f)));
  return clamp(fma(turns, F(-2.f * kPi), x), F(-kPi), F(kPi));
}

/// Longitudinal variance for longitudinal roughness r, and azimuthal scale for azimuthal roughness
/// r (Chiang et al. 2016, eq. 7 and 8).
template <typename F>
inline F fibre_variance(const F& r) {
  const F r2 = r * r, r4 = r2 * r2, r8 = r4 * r4, r20 = r8 * r8 * r4;
  return sqr(fma(F(3.7f), r20, fma(F(0.812f), r2, F(0.726f * r))));
}
template <typename F>
inline F fibre_scale(const F& r) {
  constexpr float kRootOfPiOver8 = 0.62665706866f;
  const F r2 = r * r, r4 = r2 * r2, r8 = r4 * r4, r22 = r8 * r8 * r4 * r2;
  return kRootOfPiOver8 * fma(F(5.372f), r22, fma(F(1.194f), r2, F(0.265f * r)));
}

/// Divisor in the conversion of hair colour C to absorption, sigma = (ln C / divisor)^2, for
/// azimuthal roughness r (Chiang et al. 2016, eq. 9).
template <typename F>
inline F fibre_color_divisor(const F& r) {
  F p = fma(r, F(0.245f), F(5.574f));
  p = fma(p, r, F(-10.73f));
  p = fma(p, r, F(2.532f));
  p = fma(p, r, F(-0.215f));
  return fma(p, r, F(5.969f));
}

/// Scattering parameters of a fibre.
template <typename F>
struct Fibre {
  F ior;
  Color<F> absorption;  ///< per fibre radius
  /// Longitudinal variance of R, of TT, and of TRT with all further lobes.
  std::array<F, 3> variance;
  F scale;                ///< azimuthal scale
  F tilt;                 ///< angle of the cuticle scales towards the root, in turns (1 = 360
                          ///< degrees)
  std::array<F, 3> tint;  ///< tint of R, of TT, and of TRT with all further lobes

  static constexpr size_t kLobes = 4;

  /// Values that depend on wo only.
  struct View {
    F sin_o, cos_o, y, z;  ///< sine and cosine of theta_o; y and z of the unit
                           ///< azimuthal direction of wo
    /// `share` is the sampling probability of each lobe.
    std::array<F, kLobes> sin_tilted, cos_tilted, share;
    std::array<Color<F>, kLobes> passed;  ///< A_p including the tint
    std::array<F, 3> turn;                ///< azimuth of the centre of N_p
  };

  View view(const Vec3<F>& wo) const;
  /// Computes f |cos theta_i| and the density of `sample`.
  void eval(const View& v, const Vec3<F>& wi, Color<F>& f_cos, F& pdf) const;
  Vec3<F> sample(const View& v, const F& u_lobe, const F& u, const F& u_turn) const;

 private:
  const F& variance_of(size_t lobe) const { return variance[lobe < 3 ? lobe : 2]; }
  void tilt_view(View& v) const;
};

/// Rotates the lobes for cuticle scales that are tilted towards the root by an angle a: R by 2 a,
/// TT by -a and TRT by -4 a (Chiang et al. 2016, 4.1.2; Marschner et al. 2003).
template <typename F>
inline void Fibre<F>::tilt_view(View& v) const {
  constexpr float kTurns[3] = {-2.f, 1.f, 4.f};
  for (size_t p = 0; p < 3; ++p) {
    const SinCos<F> a = sincos_2pi(F(kTurns[p] * tilt));
    v.sin_tilted[p] = fma(v.sin_o, a.cos, F(v.cos_o * a.sin));
    v.cos_tilted[p] = abs(fma(v.cos_o, a.cos, F(-v.sin_o * a.sin)));
  }
  v.sin_tilted[3] = v.sin_o;
  v.cos_tilted[3] = v.cos_o;
}

/// Computes the attenuations. With F the Fresnel reflectance and T the transmittance of one
/// crossing of the fibre,
///   A_0 = F,  A_1 = (1 - F)^2 T,  A_2 = A_1 F T,  A_3 = A_2 F T / (1 - F T).
template <typename F>
inline typename Fibre<F>::View Fibre<F>::view(const Vec3<F>& wo) const {
  View v;
  const F across = sqrt(fma(wo.y, wo.y, F(wo.z * wo.z)));
  const Mask<F> off_axis = across > 1e-12f;
  const F inverse = 1.f / select(off_axis, across, F(1.f));
  v.sin_o = clamp(wo.x, F(-1.f), F(1.f));
  v.cos_o = min(across, F(1.f));
  v.y = select(off_axis, F(wo.y * inverse), F(0.f));
  v.z = select(off_axis, F(wo.z * inverse), F(1.f));
  tilt_view(v);

  const F sin_t = v.sin_o / ior, cos_t = max(safe_sqrt(F(1.f - sin_t * sin_t)), F(1e-3f));
  const F root = safe_sqrt(F(ior * ior - v.sin_o * v.sin_o));
  const F sin_gamma = clamp(F(wo.y / max(root, F(1e-6f))), F(-1.f), F(1.f));
  const F cos_gamma = safe_sqrt(F(1.f - sin_gamma * sin_gamma));
  const F gamma_o = atan2(wo.y, F(abs(wo.z))), gamma_t = atan2(sin_gamma, cos_gamma);
  for (size_t p = 0; p < 3; ++p)
    v.turn[p] = fma(gamma_t, F(2.f * static_cast<float>(p)),
                    fma(gamma_o, F(-2.f), F(kPi * static_cast<float>(p))));

  const F length = 2.f * cos_gamma / cos_t;
  const Color<F> left{exp(F(-absorption.x * length)), exp(F(-absorption.y * length)),
                      exp(F(-absorption.z * length))};
  const F reflected = fresnel_dielectric(F(abs(wo.z)), ior).reflectance;
  const Color<F> again = left * reflected;
  const Color<F> through = left * sqr(F(1.f - reflected)), back = through * again;
  const auto rest = [](const F& a, const F& t) { return F(a * t / max(F(1.f - t), F(1e-6f))); };
  v.passed = {
      Color<F>(reflected * tint[0]), through * tint[1], back * tint[2],
      Color<F>(rest(back.x, again.x), rest(back.y, again.y), rest(back.z, again.z)) * tint[2]};
  F sum(0.f);
  for (size_t p = 0; p < kLobes; ++p) sum += v.share[p] = luminance(v.passed[p]);
  const F over = 1.f / select(sum > 0.f, sum, F(1.f));
  for (F& share : v.share) share *= over;
  return v;
}

template <typename F>
inline void Fibre<F>::eval(const View& v, const Vec3<F>& wi, Color<F>& f_cos, F& pdf) const {
  const F cos_i = sqrt(fma(wi.y, wi.y, F(wi.z * wi.z)));
  const F phi = atan2(fma(wi.y, v.z, F(-wi.z * v.y)), fma(wi.z, v.z, F(wi.y * v.y)));
  const AzimuthalLobe<F> about(scale);
  f_cos = Color<F>(F(0.f));
  pdf = F(0.f);
  for (size_t p = 0; p < kLobes; ++p) {
    const F along =
        LongitudinalLobe<F>(variance_of(p)).density(wi.x, cos_i, v.sin_tilted[p], v.cos_tilted[p]);
    const F d =
        p < 3 ? F(along * about.density(wrapped_angle(F(phi - v.turn[p])))) : F(along * kInv2Pi);
    f_cos = fma(v.passed[p], d, f_cos);
    pdf = fma(v.share[p], d, pdf);
  }
}

/// `u_lobe` selects the lobe. The position of `u_lobe` within the lobe's probability interval,
/// rescaled to [0, 1), serves as another sample value.
template <typename F>
inline Vec3<F> Fibre<F>::sample(const View& v, const F& u_lobe, const F& u, const F& u_turn) const {
  F below(0.f), share = v.share[0], sin_o = v.sin_tilted[0], cos_o = v.cos_tilted[0];
  F spread = variance[0], turn = v.turn[0], sum = v.share[0];
  Mask<F> is_rest(false);
  for (size_t p = 1; p < kLobes; ++p) {
    const Mask<F> beyond = (u_lobe >= sum) & (v.share[p] > 0.f);
    below = select(beyond, sum, below);
    share = select(beyond, v.share[p], share);
    sin_o = select(beyond, v.sin_tilted[p], sin_o);
    cos_o = select(beyond, v.cos_tilted[p], cos_o);
    spread = select(beyond, variance_of(p), spread);
    if (p < 3)
      turn = select(beyond, v.turn[p], turn);
    else
      is_rest = beyond;
    sum += v.share[p];
  }
  const F again = clamp(F(F(u_lobe - below) / max(share, F(1e-20f))), F(0.f), F(kOneMinusEpsilon));
  const F sin_i = LongitudinalLobe<F>(spread).sample(sin_o, cos_o, u, again);
  const F cos_i = safe_sqrt(fma(F(-sin_i), sin_i, F(1.f)));
  const F offset = AzimuthalLobe<F>(scale).sample(u_turn);
  const SinCos<F> a = sincos_2pi(F(select(is_rest, u_turn, F(F(turn + offset) * kInv2Pi))));
  return {sin_i, cos_i * fma(v.y, a.cos, F(v.z * a.sin)), cos_i * fma(v.z, a.cos, F(-v.y * a.sin))};
}

}  // namespace wavecomb
