// SPDX-License-Identifier: Apache-2.0
/// Arithmetic and masks for lane types. Include core/lanes/lanes.h instead of this file.
#pragma once

#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "wavecomb/core/lanes/types.h"

namespace wavecomb {

/// Returns the negation of a mask. For a single lane, the mask is a `bool`, or an `int` if it
/// results from `bool & bool`, so the operator ~ would give a wrong result.
template <typename M>
inline auto not_(const M& m) {
  if constexpr (std::is_same_v<M, bool> || std::is_same_v<M, int>)
    return !m;
  else
    return ~m;
}

/// Returns `a < b ? a : b` in every lane, which is b if a or b is NaN.
template <LaneValue F>
inline F min(const F& a, const std::type_identity_t<F>& b) {
  if constexpr (kIsScalar<F>) {
    return a < b ? a : b;
#if defined(__AVX512F__)
  } else if constexpr (std::is_same_v<F, FloatP<16>>) {
    return F(_mm512_min_ps(a.m, b.m));
#endif
#if defined(__AVX__)
  } else if constexpr (std::is_same_v<F, FloatP<8>>) {
    return F(_mm256_min_ps(a.m, b.m));
#endif
  } else {
    return select(a < b, a, b);
  }
}

/// Returns `a > b ? a : b` in every lane, which is b if a or b is NaN.
template <LaneValue F>
inline F max(const F& a, const std::type_identity_t<F>& b) {
  if constexpr (kIsScalar<F>) {
    return a > b ? a : b;
#if defined(__AVX512F__)
  } else if constexpr (std::is_same_v<F, FloatP<16>>) {
    return F(_mm512_max_ps(a.m, b.m));
#endif
#if defined(__AVX__)
  } else if constexpr (std::is_same_v<F, FloatP<8>>) {
    return F(_mm256_max_ps(a.m, b.m));
#endif
  } else {
    return select(a > b, a, b);
  }
}

template <LaneValue F>
inline F clamp(const F& x, const F& lo, const F& hi) {
  return min(max(x, lo), hi);
}

/// Returns a b + c. The result is rounded once if the target CPU has fused multiply-add
/// instructions, and twice otherwise, both for scalars and for packets.
template <LaneValue F>
inline F fma(const F& a, const std::type_identity_t<F>& b, const std::type_identity_t<F>& c) {
#if defined(__FMA__) || defined(__ARM_FEATURE_FMA)
  if constexpr (kIsScalar<F>)
    return __builtin_fmaf(a, b, c);
  else
    return drjit::fmadd(a, b, c);
#else
  return a * b + c;
#endif
}

/// Returns -(a b) + c.
template <LaneValue F>
inline F fnma(const F& a, const std::type_identity_t<F>& b, const std::type_identity_t<F>& c) {
  return fma(F(-a), b, c);
}

/// Returns the correctly rounded square root.
template <LaneValue F>
inline F sqrt(const F& x) {
  if constexpr (kIsScalar<F>)
    return std::sqrt(x);
  else
    return drjit::sqrt(x);
}

/// Returns sqrt(max(x, 0)).
template <LaneValue F>
inline F safe_sqrt(const F& x) {
  return sqrt(max(x, F(0.f)));
}

template <LaneValue F>
inline F abs(const F& x) {
  return drjit::abs(x);
}
template <LaneValue F>
inline F floor(const F& x) {
  return drjit::floor(x);
}
template <LaneValue F>
inline F sqr(const F& x) {
  return x * x;
}

/// Reinterpret the bits of floats as unsigned integers, and vice versa.
template <typename F>
inline UInt<F> float_bits(const F& x) {
  if constexpr (kIsScalar<F>)
    return std::bit_cast<uint32_t>(x);
  else
    return drjit::reinterpret_array<UInt<F>>(x);
}
template <typename F>
inline F bits_float(const UInt<F>& x) {
  if constexpr (kIsScalar<F>)
    return std::bit_cast<float>(x);
  else
    return drjit::reinterpret_array<F>(x);
}

/// Returns the magnitude of x with the sign bit of `sign`.
template <LaneValue F>
WAVECOMB_INLINE F copysign(const F& x, const F& sign) {
  return bits_float<F>((float_bits<F>(x) & 0x7fffffffu) | (float_bits<F>(sign) & 0x80000000u));
}

/// Truncates to integer; x must be within the range of int32.
template <typename F>
inline Int<F> to_int(const F& x) {
  return Int<F>(x);
}

/// Returns whether x is neither infinite nor NaN.
template <typename F>
inline Mask<F> is_finite(const F& x) {
  return Mask<F>((float_bits<F>(x) & 0x7f800000u) != UInt<F>(0x7f800000u));
}

template <LaneValue M>
inline bool any(const M& m) {
  if constexpr (std::is_same_v<M, bool>)
    return m;
  else
    return drjit::any(m);
}
template <LaneValue M>
inline bool all(const M& m) {
  if constexpr (std::is_same_v<M, bool>)
    return m;
  else
    return drjit::all(m);
}
template <LaneValue M>
inline bool none(const M& m) {
  return !any(m);
}

namespace detail {
template <typename M>
inline uint32_t mask_bits(const M& m) {
  if constexpr (requires { m.k; }) {
    return static_cast<uint32_t>(m.k) & ((1u << M::Size) - 1u);
  } else if constexpr (requires { m.a1; }) {  // Dr.Jit stores a wide packet as two halves
    return mask_bits(m.a1) | (mask_bits(m.a2) << M::Size1);
  } else {
#if defined(__aarch64__)
    // Dr.Jit has no function `bitmask_` for this CPU. In each lane of a mask, all bits are equal.
    static_assert(M::Size == 4 && sizeof(m.m) == 16);
    constexpr uint32_t kBits[4] = {1, 2, 4, 8};
    return vaddvq_u32(vandq_u32(std::bit_cast<uint32x4_t>(m.m), vld1q_u32(kBits)));
#else
    return m.bitmask_();
#endif
  }
}
}  // namespace detail

/// Converts a mask to an integer with one bit per lane. Lane 0 is the lowest bit.
template <typename F>
inline uint32_t lane_bits(const Mask<F>& m) {
  if constexpr (kIsScalar<F>)
    return m ? 1u : 0u;
  else
    return detail::mask_bits(m);
}

/// Returns the number of lanes in which the mask is true.
template <typename F>
inline uint32_t count(const Mask<F>& m) {
  return static_cast<uint32_t>(std::popcount(lane_bits<F>(m)));
}

/// Returns the lane index (0, 1, 2, ...) in each lane.
template <typename F>
inline UInt<F> lane_index() {
  if constexpr (kIsScalar<F>)
    return 0u;
  else
    return drjit::arange<UInt<F>>();
}

/// Returns a mask of the lanes with an index below `n`.
template <typename F>
inline Mask<F> first_lanes(size_t n) {
  if constexpr (kIsScalar<F>)
    return n > 0;
  else
    return Mask<F>(lane_index<F>() < UInt<F>(static_cast<uint32_t>(n)));
}

}  // namespace wavecomb
