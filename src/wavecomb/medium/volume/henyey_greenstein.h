// SPDX-License-Identifier: Apache-2.0
/// Phase function of Henyey and Greenstein ("Diffuse radiation in the Galaxy", 1941).
#pragma once

#include "wavecomb/core/math.h"
#include "wavecomb/core/vec.h"

namespace wavecomb {

/// Mean cosines of smaller magnitude are treated as 0, both in densities and in samples.
inline constexpr float kMinMeanCosine = 1e-3f;

/// Returns the solid angle density for the cosine `c` between the propagation directions before and
/// after scattering, with mean cosine g:
///   p = (1 - g^2) / (4 pi (1 + g^2 - 2 g c)^(3/2))
template <typename F>
inline F henyey_greenstein(const F& g, const F& c) {
  const F g2 = g * g;
  const F s = max(F(fma(F(-2.f * g), c, F(1.f + g2))), F(1e-12f));
  return kInv4Pi * (1.f - g2) / (s * sqrt(s));
}

/// Samples the cosine by inverting the cumulative distribution at u in [0, 1).
template <typename F>
inline F sample_henyey_greenstein(const F& g, const F& u) {
  const Mask<F> even = g == F(0.f);
  const F some = select(even, F(1.f), g);
  const F root = (1.f - some * some) / max(F(fma(F(2.f * some), u, F(1.f - some))), F(1e-6f));
  const F c = (1.f + some * some - root * root) / F(2.f * some);
  return clamp(select(even, F(fma(F(-2.f), u, F(1.f))), c), F(-1.f), F(1.f));
}

}  // namespace wavecomb
