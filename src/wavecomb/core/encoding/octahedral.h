// SPDX-License-Identifier: Apache-2.0
/// Encoding of unit vectors in 32 bits by octahedral mapping. The vector is projected to the
/// octahedron |x| + |y| + |z| = 1, which is unfolded to a square with 16 bits per axis (Z. Cigolle
/// et al., "A Survey of Efficient Representations for Independent Unit Vectors", JCGT 3(2), 2014).
/// The maximum error of the encoding is 6e-5.
#pragma once

#include <cmath>

#include "wavecomb/core/math.h"
#include "wavecomb/core/vec.h"

namespace wavecomb {

/// Code of a missing direction. No unit vector is encoded with this value.
inline constexpr uint32_t kNoDirection = 0x80008000u;

/// Encodes the direction of `v`. Returns `kNoDirection` if `v` is zero or not finite.
inline uint32_t encode_direction(const Vec3<float>& v) {
  const float size = std::abs(v.x) + std::abs(v.y) + std::abs(v.z);
  if (!(size > 0) || !std::isfinite(size)) return kNoDirection;
  float x = v.x / size, y = v.y / size;
  if (v.z < 0) {
    const float folded = std::copysign(1 - std::abs(y), x);
    y = std::copysign(1 - std::abs(x), y);
    x = folded;
  }
  const auto code = [](float t) {
    const auto whole = static_cast<int32_t>(std::lround(t * 32767.f));
    return static_cast<uint32_t>(whole) & 0xffffu;
  };
  return code(x) | code(y) << 16;
}

/// Returns the unit direction of a code, or the zero vector for kNoDirection.
template <typename F>
inline Vec3<F> decode_direction(const UInt<F>& code) {
  // Reads the lower 16 bits of a code as a signed number.
  const auto number = [](const UInt<F>& bits) {
    return F(F(Int<F>((bits & 0xffffu) ^ 0x8000u)) - 32768.f) * (1.f / 32767.f);
  };
  const F x = number(code), y = number(code >> 16);
  const F z = 1.f - abs(x) - abs(y), fold = max(-z, F(0.f));
  const Vec3<F> v{F(x - copysign(fold, x)), F(y - copysign(fold, y)), z};
  const Mask<F> some = Mask<F>(code != UInt<F>(kNoDirection));
  return v * select(some, F(1.f / length(v)), F(0.f));
}

}  // namespace wavecomb
