// SPDX-License-Identifier: Apache-2.0
/// Multiple scattering between the microfacets of a rough metal, which single scattering omits.
#pragma once

#include "wavecomb/core/math.h"
#include "wavecomb/core/vec.h"

namespace wavecomb {

/// Lobe of multiple scattering, f = F_ms L(o) L(i) / (pi L_avg), where L(w) = 1 - E(w) is the
/// energy that a white GGX surface loses for direction w, and L_avg = 2 int L c dc. With F_ms = 1
/// the lobe has the albedo L(o), so a white metal keeps all energy. The lobe is reciprocal for any
/// roughness (Kulla and Conty, "Revisiting Physically Based Shading at Imageworks", SIGGRAPH course
/// 2017).
///
/// L is a polynomial in x = z / (z + alpha / 2) and alpha, fitted to integrals of G2 / G1 over
/// visible normals. The fit stays below the true loss: the albedo of a white metal, multiple
/// scattering included, is 0.98 to 1.001 for alpha >= 0.1. L_avg has a lower limit, so that grazing
/// samples do not get large weights. For alpha < 0.1, this limit loses up to 10 % of the energy at
/// grazing angles, but never adds energy.
template <typename F>
struct LostEnergy {
  F half_alpha, c1, c2, c3, c4;
  F mean;     ///< L_avg
  F average;  ///< L_avg, clamped to its lower limit

  LostEnergy() = default;
  explicit LostEnergy(const F& alpha) : half_alpha(0.5f * alpha) {
    const auto cubic = [&alpha](float a0, float a1, float a2, float a3) {
      return fma(fma(fma(F(a3), alpha, F(a2)), alpha, F(a1)), alpha, F(a0));
    };
    c1 = cubic(-0.45960089f, 4.67164754f, -6.97144547f, 4.78577009f);
    c2 = cubic(2.91318431f, -21.98678962f, 36.45356626f, -21.42995145f);
    c3 = cubic(-3.98879693f, 32.49001236f, -46.35642476f, 23.46134996f);
    c4 = cubic(1.52192087f, -15.33641364f, 17.03522607f, -5.79982176f);
    mean = max(cubic(-0.02480907f, 0.43841556f, 0.60527856f, -0.43734199f), F(0.f));
    average = max(mean, F(0.02f));
  }

  /// L for a direction of cosine z >= 0.
  F operator()(const F& z) const {
    const F x = z / max(F(z + half_alpha), F(1e-20f));
    const F p = fma(fma(fma(fma(c4, x, c3), x, c2), x, c1), x, F(-0.0085f));
    return clamp(p, F(0.f), F(1.f));
  }

  /// F_ms for a mean reflectance f: the sum of a geometric series over further bounces. After each
  /// bounce, light leaves the surface with probability 1 - L_avg.
  F tint(const F& f) const { return F(F(f * f) * F(1.f - average)) / F(1.f - F(f * average)); }
  Color<F> tint(const Color<F>& f) const { return {tint(f.x), tint(f.y), tint(f.z)}; }
};

}  // namespace wavecomb
