// SPDX-License-Identifier: Apache-2.0
/// Definitions of the lane types. Include core/lanes/lanes.h instead of this file. No other file
/// includes Dr.Jit.
#pragma once

#include <drjit/packet.h>

#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <type_traits>

/// Forces inlining of functions that are called once or twice per packet. Inlining keeps the
/// functions' results in registers and removes unused results. Without this attribute, compilers do
/// not inline the functions, because the calling kernel is large.
#define WAVECOMB_INLINE inline __attribute__((always_inline))
/// Forces inlining of a lambda.
#define WAVECOMB_INLINE_LAMBDA __attribute__((always_inline))

namespace wavecomb {

/// Packet of `W` floats.
template <size_t W>
using FloatP = drjit::Packet<float, W>;

/// Lane type of width `W`: a plain float for one lane, a packet otherwise.
template <size_t W>
struct LaneType {
  using type = FloatP<W>;
};
template <>
struct LaneType<1> {
  using type = float;
};
template <size_t W>
using Lanes = typename LaneType<W>::type;

/// Types with the same number of lanes as the lane type `F`: unsigned and signed integers, masks
/// and 64-bit integers. `kWidth` is the number of lanes.
template <typename F>
using UInt = drjit::uint32_array_t<F>;
template <typename F>
using Int = drjit::int32_array_t<F>;
template <typename F>
using Mask = drjit::mask_t<F>;

namespace detail {
template <typename T>
struct Width {
  static constexpr size_t value = 1;
  using U64 = uint64_t;
};
template <typename T, size_t W>
struct Width<drjit::Packet<T, W>> {
  static constexpr size_t value = W;
  using U64 = drjit::Packet<uint64_t, W>;
};
// Dr.Jit splits a packet that is wider than a register into two halves of the type drjit::Array.
template <typename T, size_t W>
struct Width<drjit::Array<T, W>> : Width<drjit::Packet<T, W>> {};
}  // namespace detail

template <typename T>
inline constexpr size_t kWidth = detail::Width<T>::value;
template <typename T>
inline constexpr bool kIsScalar = kWidth<T> == 1;
template <typename F>
using UInt64 = typename detail::Width<F>::U64;

/// Concept of scalars and packets. Functions of Wavecomb that have the same name as a function of
/// Dr.Jit require this concept. Argument-dependent lookup finds both functions, and the compiler
/// prefers Wavecomb's function because Dr.Jit's function has no constraint.
template <typename T>
concept LaneValue = std::is_arithmetic_v<T> || drjit::is_array_v<T>;

using drjit::select;

/// These operators are deleted because Dr.Jit implements division of a packet by a scalar as
/// multiplication by the reciprocal, which may differ from scalar division in the last bit. Divide
/// by a packet instead: `x / F(number)`.
template <template <typename, size_t> typename P, typename T, size_t W, typename Number>
  requires std::is_floating_point_v<T> && std::is_arithmetic_v<Number>
void operator/(const P<T, W>&, const Number&) = delete;
template <template <typename, size_t> typename P, typename T, size_t W, typename Number>
  requires std::is_floating_point_v<T> && std::is_arithmetic_v<Number>
void operator/=(P<T, W>&, const Number&) = delete;

#if defined(__AVX512F__)
// Comparison operators for 16 unsigned lanes, since Dr.Jit 1.x compares unsigned lanes as signed
// integers.
namespace detail {
using U16 = UInt<FloatP<16>>;
using U16Mask = drjit::mask_t<U16>;
}  // namespace detail
#define WAVECOMB_COMPARE_U16(op, predicate)                                        \
  inline detail::U16Mask operator op(const detail::U16& a, const detail::U16& b) { \
    return detail::U16Mask::from_k(_mm512_cmp_epu32_mask(a.m, b.m, predicate));    \
  }                                                                                \
  template <typename T>                                                            \
    requires std::is_integral_v<T>                                                 \
  inline detail::U16Mask operator op(const detail::U16& a, const T& b) {           \
    return a op detail::U16(static_cast<uint32_t>(b));                             \
  }
WAVECOMB_COMPARE_U16(<, _MM_CMPINT_LT)
WAVECOMB_COMPARE_U16(<=, _MM_CMPINT_LE)
WAVECOMB_COMPARE_U16(>, _MM_CMPINT_NLE)
WAVECOMB_COMPARE_U16(>=, _MM_CMPINT_NLT)
#undef WAVECOMB_COMPARE_U16
#endif

}  // namespace wavecomb
