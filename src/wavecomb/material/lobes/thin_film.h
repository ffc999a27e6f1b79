// SPDX-License-Identifier: Apache-2.0
/// Thin-film iridescence (Belcour and Barla, "A Practical Extension to Microfacet Theory for the
/// Modeling of Varying Iridescence", SIGGRAPH 2017).
#pragma once

#include "wavecomb/material/lobes/fresnel.h"

namespace wavecomb {
namespace detail {

/// Sensor response to the interference term cos(2 pi opd / lambda), with the optical path
/// difference in nanometres: the Fourier transform of Gaussian fits to the colour matching
/// functions. The response is in linear Rec.709, normalised to 1 for opd = 0.
template <typename F>
inline Color<F> film_sensitivity(const F& opd) {
  // Amplitude, position (1 / m) and variance of the lobes of x, y and z, and of the second lobe of
  // x. The amplitudes come from the paper's code, multiplied by sqrt(2 pi variance) and normalised.
  const auto lobe = [&opd](float value, float turns_per_nm, float variance) {
    const F phase = opd * (2.f * kPi * 1e-9f);
    return F(value * sincos_2pi(F(opd * (turns_per_nm * 1e-9f))).cos *
             exp(F(-variance * phase * phase)));
  };
  const F x = lobe(0.846590f, 1.6810e6f, 4.3278e9f) + lobe(0.153868f, 2.2399e6f, 4.5282e9f);
  const F y = lobe(1.000222f, 1.7953e6f, 9.3046e9f);
  const F z = lobe(1.001122f, 2.2084e6f, 6.6121e9f);
  // XYZ to linear Rec.709, with each channel normalised to 1 for x = y = z = 1.
  const Color<F> rgb(fma(F(3.2404542f), x, fma(F(-1.5371385f), y, F(-0.4985314f * z))),
                     fma(F(-0.9692660f), x, fma(F(1.8760108f), y, F(0.0415560f * z))),
                     fma(F(0.0556434f), x, fma(F(-0.2040259f), y, F(1.0572252f * z))));
  return {rgb.x * 0.829601f, rgb.y * 1.054526f, rgb.z * 1.098878f};
}

}  // namespace detail

/// Thin film of index `ior` and `thickness` (nm) in vacuum over a base. Reflectance is the Airy sum
/// of orders 0 to 3 per RGB channel. Reflection phases are 0 or pi, which approximates metals. A
/// weight of 0 disables the film.
template <typename F>
struct ThinFilm {
  F weight, thickness, ior;

  /// Effective index of the film; tends to 1 for thicknesses below 30 nm.
  F index() const {
    const F grown = clamp(F(thickness * (1.f / 30.f)), F(0.f), F(1.f));
    return fma(F(ior - 1.f), F(grown * grown * fma(grown, F(-2.f), F(3.f))), F(1.f));
  }

  /// Airy reflectance at cosine c. `base_s` and `base_p` are the signed amplitudes of the base at
  /// the lower side of the film.
  Color<F> airy(const F& c, const Color<F>& base_s, const Color<F>& base_p) const {
    const F eta = index(), t = refracted_cos(c, eta);
    const F opd = 2.f * eta * thickness * t;
    const Mask<F> total = not_(Mask<F>(t > 0.f));
    Color<F> sum;
    const F a = eta * c, b = eta * t;
    const F top_s = F(c - b) / max(F(c + b), F(1e-12f));
    const F top_p = F(a - t) / max(F(a + t), F(1e-12f));
    const Color<F> order[3] = {detail::film_sensitivity<F>(opd),
                               detail::film_sensitivity<F>(F(2.f * opd)),
                               detail::film_sensitivity<F>(F(3.f * opd))};
    const auto channel = [&](const F& r12, const F& r23, const F& s1, const F& s2, const F& s3) {
      const F top = r12 * r12, bottom = r23 * r23, through = 1.f - top;
      const F rs = through * through * bottom / max(F(1.f - top * bottom), F(1e-6f));
      // product r21 r23 of the amplitudes; a negative sign is a phase shift of pi
      const F turn = -r12 * r23;
      F term = (rs - through) * turn;
      F r = top + rs + 2.f * term * s1;
      term = term * turn;
      r = r + 2.f * term * s2;
      term = term * turn;
      return F(r + 2.f * term * s3);
    };
    const auto both = [&](const F& s, const F& p, const F& s1, const F& s2, const F& s3) {
      return clamp(F(0.5f * F(channel(top_s, s, s1, s2, s3) + channel(top_p, p, s1, s2, s3))),
                   F(0.f), F(1.f));
    };
    sum.x = both(base_s.x, base_p.x, order[0].x, order[1].x, order[2].x);
    sum.y = both(base_s.y, base_p.y, order[0].y, order[1].y, order[2].y);
    sum.z = both(base_s.z, base_p.z, order[0].z, order[1].z, order[2].z);
    return select<F>(total, Color<F>(F(1.f)), sum);
  }

  /// Reflectance of the film on a dielectric of index `base`, at cosine `c`.
  Color<F> over_dielectric(const F& c, const F& base) const {
    const F eta = index(), t = refracted_cos(c, eta), relative = base / eta;
    const F below = refracted_cos(t, relative);
    const F s = F(t - relative * below) / max(F(t + relative * below), F(1e-12f));
    const F p = F(relative * t - below) / max(F(relative * t + below), F(1e-12f));
    const Mask<F> total = not_(Mask<F>(below > 0.f));
    return airy(c, Color<F>(select(total, F(1.f), s)), Color<F>(select(total, F(1.f), p)));
  }

  /// Reflectance of the film on a metal whose reflectance without film is `f`, at cosine `c`.
  Color<F> over_metal(const F& c, const Color<F>& f) const {
    const Color<F> root(safe_sqrt(f.x), safe_sqrt(f.y), safe_sqrt(f.z));
    return airy(c, -root, root);
  }
};

}  // namespace wavecomb
