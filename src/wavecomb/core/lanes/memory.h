// SPDX-License-Identifier: Apache-2.0
/// Loads and stores of packets, and access to single lanes. Include core/lanes/lanes.h instead of
/// this file.
#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <type_traits>

#include "wavecomb/core/lanes/arithmetic.h"

namespace wavecomb {

/// Loads W consecutive values at `p`, which needs no alignment.
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
/// Copy of a packet in memory, for reading single lanes. Dr.Jit's function `entry` is not used,
/// because it violates strict aliasing when it reads integer registers, and GCC 12 miscompiles it.
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

/// Loads 32-bit words at the addresses base + 4 * index, where the index may have 64 bits.
template <typename T, typename Index, typename M>
inline T gather_words(const void* base, const Index& index, const M& active) {
#if defined(__AVX2__)
  if constexpr (requires { active.a1; })  // Dr.Jit stores a wide packet as two halves
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

/// Loads base[index] in each active lane; other lanes get 0. `T` is a float or uint lane type.
/// The indices of active lanes must be below 2^31.
template <typename T>
inline T gather(const void* base, const UInt<T>& index, const Mask<T>& active) {
  if constexpr (kIsScalar<T>)
    return active ? static_cast<const T*>(base)[index] : T(0);
  else
    return detail::gather_words<T>(base, index, active);
}

/// Loads the 32-bit value at each active lane's address plus 4 * index bytes; other lanes get 0.
///
/// Contract: addresses are multiples of 4.
template <typename T>
inline T gather_at(const UInt64<T>& address, const UInt<T>& index, const Mask<T>& active) {
  if constexpr (kIsScalar<T>)
    return active ? reinterpret_cast<const T*>(address)[index] : T(0);
  else
    return detail::gather_words<T>(nullptr, UInt64<T>((address >> 2) + UInt64<T>(index)), active);
}

/// Stores base[index] = value in each active lane. Indices of active lanes must be distinct and
/// below 2^31.
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

/// Stores the active lanes of `value` contiguously at `p`, in lane order; returns their number.
///
/// Contract: `p` has room for a whole packet, since unspecified values follow the values of the
/// active lanes.
template <typename T>
inline uint32_t compress_store(void* p, const T& value, const Mask<T>& active) {
  const uint32_t bits = lane_bits<T>(active);
  if constexpr (kIsScalar<T>) {
    if (bits) std::memcpy(p, &value, sizeof(T));
#if defined(__AVX512F__)
  } else if constexpr (kWidth<T> == 16) {
    // Compress the lanes in a register and store the whole register, since the instruction that
    // compresses to memory is far slower on Zen 4.
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

/// Returns `table[index]` in each lane, for a table of 16 words.
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

/// Returns `table[index]` in each lane, for a table of 256 floats. With AVX-512, the function
/// permutes registers, which takes a third of the time of a gather instruction on Zen 4.
template <typename F>
inline F lookup256(const float* table, const UInt<F>& index) {
#if defined(__AVX512F__)
  if constexpr (!kIsScalar<F> && kWidth<F> == 16) {
    // Each permutation selects one of 32 entries by the low five bits of the index. The upper bits
    // select the group of 32 entries.
    const __m512i part = _mm512_srli_epi32(index.m, 5);
    __m512 value =
        _mm512_permutex2var_ps(_mm512_loadu_ps(table), index.m, _mm512_loadu_ps(table + 16));
    for (int k = 1; k < 8; ++k) {
      const float* at = table + 32 * k;
      const __m512 here =
          _mm512_permutex2var_ps(_mm512_loadu_ps(at), index.m, _mm512_loadu_ps(at + 16));
      value = _mm512_mask_mov_ps(value, _mm512_cmpeq_epi32_mask(part, _mm512_set1_epi32(k)), here);
    }
    return F(value);
  } else
#endif
  {
    return gather<F>(table, index, Mask<F>(true));
  }
}

/// Reverses the bits of each lane.
template <typename U>
inline U reverse_bits(U x) {
#if defined(__AVX512BW__) && defined(__GFNI__)
  if constexpr (kWidth<U> == 16) {
    // Reverse the bits of each byte by a matrix product over GF(2), and then reverse the order of
    // the bytes.
    const __m512i matrix = _mm512_set1_epi64(static_cast<long long>(0x8040201008040201ull));
    const __m512i order =
        _mm512_broadcast_i32x4(_mm_setr_epi8(3, 2, 1, 0, 7, 6, 5, 4, 11, 10, 9, 8, 15, 14, 13, 12));
    return U(_mm512_shuffle_epi8(_mm512_gf2p8affine_epi64_epi8(x.m, matrix, 0), order));
  } else
#elif defined(__AVX2__)
  if constexpr (kWidth<U> == 8) {
    // Reverse the order of the bytes, and then reverse the bits of each byte with a table of
    // four-bit values.
    const __m256i order = _mm256_broadcastsi128_si256(
        _mm_setr_epi8(3, 2, 1, 0, 7, 6, 5, 4, 11, 10, 9, 8, 15, 14, 13, 12));
    const __m256i reversed = _mm256_broadcastsi128_si256(
        _mm_setr_epi8(0, 8, 4, 12, 2, 10, 6, 14, 1, 9, 5, 13, 3, 11, 7, 15));
    const __m256i half = _mm256_set1_epi8(15);
    const __m256i bytes = _mm256_shuffle_epi8(x.m, order);
    const __m256i low = _mm256_shuffle_epi8(reversed, _mm256_and_si256(bytes, half));
    const __m256i top =
        _mm256_shuffle_epi8(reversed, _mm256_and_si256(_mm256_srli_epi32(bytes, 4), half));
    return U(_mm256_or_si256(_mm256_slli_epi32(low, 4), top));
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

/// Returns the value of lane `i`.
template <typename T>
inline auto lane(const T& value, size_t i) {
  if constexpr (kIsScalar<T>) {
    (void)i;
    return value;
  } else {
    return detail::InMemory<T>(value).value[i];
  }
}

/// Returns the value of the first active lane.
///
/// Contract: at least one lane is active.
template <typename T>
inline auto first_active(const T& value, const Mask<T>& active) {
  return lane(value, static_cast<size_t>(std::countr_zero(lane_bits<T>(active))));
}

/// Returns whether all active lanes hold the same value; true if no lane is active.
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
