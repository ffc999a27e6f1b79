// SPDX-License-Identifier: Apache-2.0
/// Real spherical harmonics for view-dependent colour.
#pragma once

#include <array>

#include "wavecomb/core/vec.h"

namespace wavecomb {

/// Maximum number of harmonics per Gaussian splat, up to degree 3.
inline constexpr uint32_t kMaxHarmonics = 16;

/// Returns the degree l of the spherical harmonic with index k.
constexpr uint32_t harmonic_degree(uint32_t k) {
  return k < 1 ? 0 : (k < 4 ? 1 : (k < 9 ? 2 : 3));
}

/// Evaluates the real spherical harmonics Y_l^m(d) up to degree 3 at a unit vector d, ordered by
/// degree l, then m = -l to l. The harmonics are orthonormal over the sphere and include the
/// Condon-Shortley phase (-1)^m, as in Kerbl et al. (2023).
template <typename F>
inline std::array<F, kMaxHarmonics> harmonics(const Vec3<F>& d) {
  const F xx = d.x * d.x, yy = d.y * d.y, zz = d.z * d.z;
  const F xy = d.x * d.y, xz = d.x * d.z, yz = d.y * d.z, across = xx - yy;
  const F high = 4.f * zz - xx - yy;
  return {F(0.28209479f),
          F(-0.48860251f * d.y),
          F(0.48860251f * d.z),
          F(-0.48860251f * d.x),
          F(1.09254843f * xy),
          F(-1.09254843f * yz),
          F(0.31539157f * (2.f * zz - xx - yy)),
          F(-1.09254843f * xz),
          F(0.54627422f * across),
          F(-0.59004359f * d.y * (3.f * xx - yy)),
          F(2.89061144f * xy * d.z),
          F(-0.45704580f * d.y * high),
          F(0.37317633f * d.z * (2.f * zz - 3.f * (xx + yy))),
          F(-0.45704580f * d.x * high),
          F(1.44530572f * d.z * across),
          F(-0.59004359f * d.x * (xx - 3.f * yy))};
}

}  // namespace wavecomb
