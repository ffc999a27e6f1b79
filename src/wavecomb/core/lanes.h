// SPDX-License-Identifier: Apache-2.0
/// Lanes: the float types that every kernel is a template on, and the few operations they share.
///
/// A kernel takes `F`, which is `float` in the reference integrator and `FloatP<W>` in the wave.
/// Each operation below rounds in the same way for both, so a kernel gives the same bits at any
/// width. That is why minimum, maximum and fma are ours: Dr.Jit's differ between scalar and packet
/// for NaN and contraction. This is the only file that includes Dr.Jit.
#pragma once

#include <drjit/packet.h>

#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <type_traits>

/// For kernels that are called once or twice a packet: what they return then stays in registers,
/// and what the caller does not use is not worked out. Compilers alone stop at the size of the
/// caller.
#define WAVECOMB_INLINE inline __attribute__((always_inline))

namespace wavecomb {

/// A packet of `W` floats.
template <size_t W>
using FloatP = drjit::Packet<float, W>;

/// The lane type of width `W`: a plain float for one lane, a packet otherwise.
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

/// Unsigned, signed, 64-bit and mask companions of a lane type, and its width.
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
// The halves of a packet that is wider than a register.
template <typename T, size_t W>
struct Width<drjit::Array<T, W>> : Width<drjit::Packet<T, W>> {};
}  // namespace detail

template <typename T>
inline constexpr size_t kWidth = detail::Width<T>::value;
template <typename T>
inline constexpr bool kIsScalar = kWidth<T> == 1;
template <typename F>
using UInt64 = typename detail::Width<F>::U64;

/// What lanes are made of. Argument-dependent lookup finds Dr.Jit's functions of the same name
/// beside ours; theirs are not constrained, so that this constraint makes ours the better match.
template <typename T>
concept LaneValue = std::is_arithmetic_v<T> || drjit::is_array_v<T>;

using drjit::select;

#if defined(__AVX512F__)
// Dr.Jit 1.x compares unsigned lanes as signed ones at width 16 alone; these are a better match.
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

/// Logical not that is right for `bool` too (`~true` is not `false`).
template <typename M>
inline M not_(const M& m) {
  if constexpr (std::is_same_v<M, bool>)
    return !m;
  else
    return ~m;
}

/// a < b ? a : b in every lane (b when either is NaN).
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

/// a > b ? a : b in every lane (b when either is NaN).
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

/// a b + c, rounded once where the target has FMA, twice where it has not; alike for scalar and
/// packet.
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

/// -(a b) + c.
template <LaneValue F>
inline F fnma(const F& a, const std::type_identity_t<F>& b, const std::type_identity_t<F>& c) {
  return fma(F(-a), b, c);
}

/// Correctly rounded square root.
template <LaneValue F>
inline F sqrt(const F& x) {
  if constexpr (kIsScalar<F>)
    return std::sqrt(x);
  else
    return drjit::sqrt(x);
}

/// sqrt(max(x, 0)).
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

/// Bits of a float, and back.
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

/// |x| with the sign of `sign` (signed zero counts as its sign).
template <LaneValue F>
WAVECOMB_INLINE F copysign(const F& x, const F& sign) {
  return bits_float<F>((float_bits<F>(x) & 0x7fffffffu) | (float_bits<F>(sign) & 0x80000000u));
}

/// Truncation to integer; the argument must lie within the range of int32.
template <typename F>
inline Int<F> to_int(const F& x) {
  return Int<F>(x);
}

/// True where x is neither infinite nor NaN.
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
  } else if constexpr (requires { m.a1; }) {  // made of two halves
    return mask_bits(m.a1) | (mask_bits(m.a2) << M::Size1);
  } else {
#if defined(__aarch64__)
    // Dr.Jit has no bitmask_() here. A lane of a mask is all ones or all zeros.
    static_assert(M::Size == 4 && sizeof(m.m) == 16);
    constexpr uint32_t kBits[4] = {1, 2, 4, 8};
    return vaddvq_u32(vandq_u32(std::bit_cast<uint32x4_t>(m.m), vld1q_u32(kBits)));
#else
    return m.bitmask_();
#endif
  }
}
}  // namespace detail

/// One bit per lane, lane 0 lowest.
template <typename F>
inline uint32_t lane_bits(const Mask<F>& m) {
  if constexpr (kIsScalar<F>)
    return m ? 1u : 0u;
  else
    return detail::mask_bits(m);
}

/// Number of lanes set.
template <typename F>
inline uint32_t count(const Mask<F>& m) {
  return static_cast<uint32_t>(std::popcount(lane_bits<F>(m)));
}

/// 0, 1, 2, ... in the lanes.
template <typename F>
inline UInt<F> lane_index() {
  if constexpr (kIsScalar<F>)
    return 0u;
  else
    return drjit::arange<UInt<F>>();
}

/// Lanes whose index is below `n`.
template <typename F>
inline Mask<F> first_lanes(size_t n) {
  if constexpr (kIsScalar<F>)
    return n > 0;
  else
    return Mask<F>(lane_index<F>() < UInt<F>(static_cast<uint32_t>(n)));
}

/// W consecutive values at `p` (any alignment).
template <typename T>
inline T load(const void* p) {
  if constexpr (kIsScalar<T>) {
    T value;
    std::memcpy(&value, p, sizeof(T));
    return value;
  } else {
    return drjit::load<T>(p);
  }
}
template <LaneValue T>
inline void store(void* p, const T& value) {
  if constexpr (kIsScalar<T>)
    std::memcpy(p, &value, sizeof(T));
  else
    drjit::store(p, value);
}

namespace detail {
/// A packet's lanes in memory. Dr.Jit's entry() is not used: it reads integer registers through a
/// pointer that may not alias them, which GCC 12 miscompiles.
template <typename T>
struct InMemory {
  using Value = std::conditional_t<
      std::is_same_v<T, FloatP<kWidth<T>>>, float,
      std::conditional_t<std::is_same_v<T, Int<T>>, int32_t,
                         std::conditional_t<std::is_same_v<T, UInt<T>>, uint32_t, uint64_t>>>;
  alignas(64) Value value[kWidth<T>];

  InMemory() : value{} {}
  explicit InMemory(const T& lanes) { store(value, lanes); }
};

/// Words at base + 4 * index, where the index may have 64 bits.
template <typename T, typename Index, typename M>
inline T gather_words(const void* base, const Index& index, const M& active) {
#if defined(__AVX2__)
  if constexpr (requires { active.a1; })  // made of two halves
    return T(gather_words<typename T::Array1>(base, drjit::low(index), active.a1),
             gather_words<typename T::Array2>(base, drjit::high(index), active.a2));
  else
    return T::gather_(base, index, active, ReduceMode::Auto);
#else
  const InMemory<Index> at(index);
  InMemory<T> result;
  for (uint32_t bits = mask_bits(active); bits != 0; bits &= bits - 1) {
    const auto i = static_cast<size_t>(std::countr_zero(bits));
    const uint64_t address =
        reinterpret_cast<uint64_t>(base) + 4 * static_cast<uint64_t>(at.value[i]);
    std::memcpy(result.value + i, reinterpret_cast<const void*>(address), 4);
  }
  return load<T>(result.value);
#endif
}
}  // namespace detail

/// base[index] in each active lane, 0 elsewhere. `T` is a float or uint lane type; indices of
/// active lanes are below 2^31.
template <typename T>
inline T gather(const void* base, const UInt<T>& index, const Mask<T>& active) {
  if constexpr (kIsScalar<T>)
    return active ? static_cast<const T*>(base)[index] : T(0);
  else
    return detail::gather_words<T>(base, index, active);
}

/// The 32-bit value at each lane's own address plus 4 * index bytes, in active lanes; 0 elsewhere.
/// Contract: addresses are multiples of 4.
template <typename T>
inline T gather_at(const UInt64<T>& address, const UInt<T>& index, const Mask<T>& active) {
  if constexpr (kIsScalar<T>)
    return active ? reinterpret_cast<const T*>(address)[index] : T(0);
  else
    return detail::gather_words<T>(nullptr, UInt64<T>((address >> 2) + UInt64<T>(index)), active);
}

/// base[index] = value in each active lane; indices of active lanes are distinct and below 2^31.
template <typename T>
inline void scatter(void* base, const T& value, const UInt<T>& index, const Mask<T>& active) {
  if constexpr (kIsScalar<T>) {
    if (active) static_cast<T*>(base)[index] = value;
  } else {
#if defined(__AVX512VL__)
    value.scatter_(base, index, active, ReduceMode::Auto);
#else
    const detail::InMemory<T> from(value);
    const detail::InMemory<UInt<T>> at(index);
    for (uint32_t bits = detail::mask_bits(active); bits != 0; bits &= bits - 1) {
      const auto i = static_cast<size_t>(std::countr_zero(bits));
      std::memcpy(static_cast<char*>(base) + 4 * size_t{at.value[i]}, from.value + i, 4);
    }
#endif
  }
}

/// Writes the active lanes of `value` side by side at `p`, in lane order; returns how many.
/// Contract: `p` has room for a whole packet, since the tail of the store is unspecified.
template <typename T>
inline uint32_t compress_store(void* p, const T& value, const Mask<T>& active) {
  const uint32_t bits = lane_bits<T>(active);
  if constexpr (kIsScalar<T>) {
    if (bits) std::memcpy(p, &value, sizeof(T));
#if defined(__AVX512F__)
  } else if constexpr (kWidth<T> == 16) {
    // Compress in the register, then store whole: a compressing store to memory is far slower on
    // Zen 4.
    const __m512i v = std::bit_cast<__m512i>(value.m);
    _mm512_storeu_si512(p, _mm512_maskz_compress_epi32(static_cast<__mmask16>(bits), v));
#endif
#if defined(__AVX512VL__)
  } else if constexpr (kWidth<T> == 8) {
    const __m256i v = std::bit_cast<__m256i>(value.m);
    _mm256_storeu_si256(static_cast<__m256i*>(p),
                        _mm256_maskz_compress_epi32(static_cast<__mmask8>(bits), v));
#endif
  } else {
    const detail::InMemory<T> lanes(value);
    auto* out = static_cast<char*>(p);
    for (uint32_t rest = bits; rest != 0; rest &= rest - 1, out += 4)
      std::memcpy(out, lanes.value + std::countr_zero(rest), 4);
  }
  return static_cast<uint32_t>(std::popcount(bits));
}

/// table[index] of 16 words in each lane; index < 16.
template <typename U>
inline U lookup16(const uint32_t* table, const U& index) {
  if constexpr (kIsScalar<U>) {
    return table[index];
#if defined(__AVX512F__)
  } else if constexpr (kWidth<U> == 16) {
    return U(_mm512_permutexvar_epi32(index.m, _mm512_loadu_si512(table)));
#endif
#if defined(__AVX2__)
  } else if constexpr (kWidth<U> == 8) {
    const auto half = [&](const uint32_t* p) {
      return _mm256_permutevar8x32_epi32(_mm256_loadu_si256(reinterpret_cast<const __m256i*>(p)),
                                         index.m);
    };
    return select(index > 7u, U(half(table + 8)), U(half(table)));
#endif
  } else {
    detail::InMemory<U> at(index);
    for (uint32_t& value : at.value) value = table[value];
    return load<U>(at.value);
  }
}

/// Bits in reverse order, lane by lane.
template <typename U>
inline U reverse_bits(U x) {
#if defined(__AVX512BW__) && defined(__GFNI__)
  if constexpr (kWidth<U> == 16) {
    // A byte's bits by a matrix product over GF(2), then the bytes.
    const __m512i matrix = _mm512_set1_epi64(static_cast<long long>(0x8040201008040201ull));
    const __m512i order =
        _mm512_broadcast_i32x4(_mm_setr_epi8(3, 2, 1, 0, 7, 6, 5, 4, 11, 10, 9, 8, 15, 14, 13, 12));
    return U(_mm512_shuffle_epi8(_mm512_gf2p8affine_epi64_epi8(x.m, matrix, 0), order));
  } else
#endif
  {
    x = ((x >> 1) & 0x55555555u) | ((x & 0x55555555u) << 1);
    x = ((x >> 2) & 0x33333333u) | ((x & 0x33333333u) << 2);
    x = ((x >> 4) & 0x0f0f0f0fu) | ((x & 0x0f0f0f0fu) << 4);
    x = ((x >> 8) & 0x00ff00ffu) | ((x & 0x00ff00ffu) << 8);
    return (x >> 16) | (x << 16);
  }
}

/// Value of lane `i`.
template <typename T>
inline auto lane(const T& value, size_t i) {
  if constexpr (kIsScalar<T>) {
    (void)i;
    return value;
  } else {
    return detail::InMemory<T>(value).value[i];
  }
}

/// Value of the first active lane. Contract: at least one lane is active.
template <typename T>
inline auto first_active(const T& value, const Mask<T>& active) {
  return lane(value, static_cast<size_t>(std::countr_zero(lane_bits<T>(active))));
}

/// True when every active lane holds the same value (true when none is active).
template <typename F>
inline bool is_uniform(const UInt<F>& value, const Mask<F>& active) {
  if constexpr (kIsScalar<F>) {
    return true;
  } else {
    const uint32_t bits = lane_bits<F>(active);
    if (bits == 0) return true;
    const UInt<F> first(lane(value, static_cast<size_t>(std::countr_zero(bits))));
    return none(Mask<F>(value != first) & active);
  }
}

}  // namespace wavecomb
