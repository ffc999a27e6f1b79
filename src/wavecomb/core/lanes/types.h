// SPDX-License-Identifier: Apache-2.0
/// Lane types; part of core/lanes/lanes.h. Only core/lanes/types.h includes Dr.Jit.
#pragma once

#include <drjit/packet.h>

#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <type_traits>

/// Forces inlining of kernels that are called once or twice per packet. Inlining keeps the results
/// of kernels in registers and removes unused results. Without the attribute, compilers do not
/// inline kernels, because their caller is large.
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

/// Unsigned, signed, mask and 64-bit types that match a lane type, and its width.
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
// Types for half of a packet that is wider than a register.
template <typename T, size_t W>
struct Width<drjit::Array<T, W>> : Width<drjit::Packet<T, W>> {};
}  // namespace detail

template <typename T>
inline constexpr size_t kWidth = detail::Width<T>::value;
template <typename T>
inline constexpr bool kIsScalar = kWidth<T> == 1;
template <typename F>
using UInt64 = typename detail::Width<F>::U64;

/// Concept of the types of lane values. Argument-dependent lookup also finds Dr.Jit's functions of
/// the same names. Dr.Jit's functions have no constraint, so this constraint makes Wavecomb's
/// functions the better match.
template <typename T>
concept LaneValue = std::is_arithmetic_v<T> || drjit::is_array_v<T>;

using drjit::select;

/// Dr.Jit divides a packet by a number by multiplying with its reciprocal, which differs in the
/// last bit from scalar division. Divide by a packet instead: `x / F(number)`.
template <template <typename, size_t> typename P, typename T, size_t W, typename Number>
  requires std::is_floating_point_v<T> && std::is_arithmetic_v<Number>
void operator/(const P<T, W>&, const Number&) = delete;
template <template <typename, size_t> typename P, typename T, size_t W, typename Number>
  requires std::is_floating_point_v<T> && std::is_arithmetic_v<Number>
void operator/=(P<T, W>&, const Number&) = delete;

#if defined(__AVX512F__)
// Dr.Jit 1.x compares unsigned lanes as signed at width 16 only; these overloads are better
// matches.
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
