// SPDX-License-Identifier: Apache-2.0
/// Loads and stores of rows. A row consists of N consecutive 32-bit words in memory. Each lane
/// accesses its own row: lane i of packet k holds word k of the row of lane i.
///
/// Gather and scatter instructions access memory once per lane and word. The functions of this file
/// load and store whole rows and transpose them in registers. Loading 16 rows of 16 words in this
/// way takes a fifth of the time of 16 gather instructions (docs/decisions/path-rows.md).
#pragma once

#include <array>
#include <bit>
#include <utility>

#include "wavecomb/core/lanes/lanes.h"

namespace wavecomb {

namespace detail {

template <size_t W>
struct VectorOf {
  typedef float type __attribute__((vector_size(4 * W)));
};
/// Register of W untyped 32-bit words.
template <size_t W>
using Vector = typename VectorOf<W>::type;

/// Calls `f(i)` for each `i` below `N`, where `i` is a compile-time constant. Compilers keep arrays
/// in registers if all indices are compile-time constants.
template <size_t N, typename Function>
WAVECOMB_INLINE void unrolled(const Function& f) {
  [&]<size_t... I>(std::index_sequence<I...>) WAVECOMB_INLINE_LAMBDA {
    (f(std::integral_constant<size_t, I>()), ...);
  }(std::make_index_sequence<N>());
}

/// Performs one step of a transposition, which swaps blocks of S words between the registers `a`
/// and `b`.
template <size_t W, size_t S, size_t... I>
WAVECOMB_INLINE void swap_blocks(Vector<W>& a, Vector<W>& b, std::index_sequence<I...>) {
  const Vector<W> low = __builtin_shufflevector(a, b, ((I & S) == 0 ? I : W + I - S)...);
  const Vector<W> high = __builtin_shufflevector(a, b, ((I & S) == 0 ? I + S : W + I)...);
  a = low;
  b = high;
}

/// Transposes each of the adjacent N x N blocks in N registers of W words (Eklundh 1972). Calling
/// the function twice restores the registers.
template <size_t N, size_t W, size_t S = N / 2>
WAVECOMB_INLINE void transpose_blocks(std::array<Vector<W>, N>& r) {
  unrolled<N>([&](auto i) WAVECOMB_INLINE_LAMBDA {
    if constexpr ((i & S) == 0) swap_blocks<W, S>(r[i], r[i + S], std::make_index_sequence<W>());
  });
  if constexpr (S > 1) transpose_blocks<N, W, S / 2>(r);
}

/// Smallest power of two that is at least N.
template <size_t N>
inline constexpr size_t kRowBlock = std::bit_ceil(N);

/// Loads N words at `p` into a register of B words, where N <= B, and sets the other words to 0.
/// Does not read memory beyond the N words.
template <size_t N, size_t B>
WAVECOMB_INLINE Vector<B> load_words(const float* p) {
  if constexpr (N == B) {
    Vector<B> v;
    std::memcpy(&v, p, 4 * B);
    return v;
#if defined(__AVX512VL__)
  } else if constexpr (B == 4) {
    return std::bit_cast<Vector<4>>(_mm_maskz_loadu_ps((1 << N) - 1, p));
#elif defined(__AVX__)
  } else if constexpr (B == 4) {
    const __m128i there = _mm_setr_epi32(-1, N > 1 ? -1 : 0, N > 2 ? -1 : 0, 0);
    return std::bit_cast<Vector<4>>(_mm_maskload_ps(p, there));
#endif
  } else {
    Vector<B> v{};
    unrolled<N>([&](auto i) WAVECOMB_INLINE_LAMBDA { v[i()] = p[i()]; });
    return v;
  }
}

template <size_t B, size_t... I>
WAVECOMB_INLINE Vector<2 * B> join_two(const Vector<B>& a, const Vector<B>& b,
                                       std::index_sequence<I...>) {
  return __builtin_shufflevector(a, b, I...);
}
/// Concatenates several vectors to a wider vector.
template <size_t B, size_t W>
WAVECOMB_INLINE Vector<W> join(const Vector<B>* parts) {
  if constexpr (B == W) return parts[0];
#if defined(__AVX__)
  // For two vectors of four words, the general code below compiles to needless moves.
  else if constexpr (B == 4 && W == 8)
    return std::bit_cast<Vector<8>>(
        _mm256_set_m128(std::bit_cast<__m128>(parts[1]), std::bit_cast<__m128>(parts[0])));
#endif
  else
    return join_two<W / 2>(join<B, W / 2>(parts), join<B, W / 2>(parts + W / B / 2),
                           std::make_index_sequence<W>());
}
/// Returns `sizeof...(I)` consecutive elements of a vector, starting with the element `Start`.
template <size_t Start, size_t W, size_t... I>
WAVECOMB_INLINE Vector<sizeof...(I)> part(const Vector<W>& v, std::index_sequence<I...>) {
  return __builtin_shufflevector(v, v, (Start + I)...);
}
/// Splits `v` into parts of N words and stores part j at the address `at[j * N]`, for all j >= J.
template <size_t N, size_t W, size_t J = 0>
WAVECOMB_INLINE void store_parts(const Vector<W>& v, float* const* at) {
  const Vector<N> one = part<J * N, W>(v, std::make_index_sequence<N>());
  std::memcpy(at[J * N], &one, 4 * N);
  if constexpr ((J + 1) * N < W) store_parts<N, W, J + 1>(v, at);
}

template <typename F>
concept InOneRegister = !kIsScalar<F> && !requires(const F& f) { f.a1; };

/// Loads N words at each lane's address.
template <size_t N, typename F>
WAVECOMB_INLINE std::array<F, N> rows_at(const float* const* at) {
  constexpr size_t W = kWidth<F>, B = kRowBlock<N>;
  std::array<F, N> out;
  if constexpr (kIsScalar<F>) {
    std::memcpy(out.data(), at[0], 4 * N);
  } else if constexpr (!InOneRegister<F>) {  // Dr.Jit stores a wide packet as two halves
    const auto low = rows_at<N, typename F::Array1>(at);
    const auto high = rows_at<N, typename F::Array2>(at + F::Size1);
    unrolled<N>([&](auto k) WAVECOMB_INLINE_LAMBDA { out[k] = F(low[k], high[k]); });
  } else if constexpr (B <= W) {
    std::array<Vector<W>, B> r;
    unrolled<B>([&](auto k) WAVECOMB_INLINE_LAMBDA {
      Vector<B> parts[W / B];
      unrolled<W / B>([&](auto j)
                          WAVECOMB_INLINE_LAMBDA { parts[j] = load_words<N, B>(at[k + j * B]); });
      r[k] = join<B, W>(parts);
    });
    transpose_blocks<B, W>(r);
    unrolled<N>([&](auto k)
                    WAVECOMB_INLINE_LAMBDA { out[k].m = std::bit_cast<decltype(F::m)>(r[k]); });
  } else {  // the rows are longer than a register, so load W words of each row at a time
    static_assert(N % W == 0);
    unrolled<N / W>([&](auto block) WAVECOMB_INLINE_LAMBDA {
      constexpr size_t c = block * W;
      const float* part[W];
      unrolled<W>([&](auto i) WAVECOMB_INLINE_LAMBDA { part[i] = at[i] + c; });
      const auto columns = rows_at<W, F>(part);
      unrolled<W>([&](auto k) WAVECOMB_INLINE_LAMBDA { out[c + k] = columns[k]; });
    });
  }
  return out;
}

/// Stores N words at each lane's address.
template <size_t N, typename F>
WAVECOMB_INLINE void rows_to(float* const* at, const std::array<F, N>& values) {
  constexpr size_t W = kWidth<F>;
  static_assert(std::has_single_bit(N));
  if constexpr (kIsScalar<F>) {
    std::memcpy(at[0], values.data(), 4 * N);
  } else if constexpr (!InOneRegister<F>) {
    std::array<typename F::Array1, N> low;
    std::array<typename F::Array2, N> high;
    unrolled<N>([&](auto k) WAVECOMB_INLINE_LAMBDA {
      low[k] = drjit::low(values[k]);
      high[k] = drjit::high(values[k]);
    });
    rows_to<N, typename F::Array1>(at, low);
    rows_to<N, typename F::Array2>(at + F::Size1, high);
  } else if constexpr (N <= W) {
    std::array<Vector<W>, N> r;
    unrolled<N>([&](auto k)
                    WAVECOMB_INLINE_LAMBDA { r[k] = std::bit_cast<Vector<W>>(values[k].m); });
    transpose_blocks<N, W>(r);
    unrolled<N>([&](auto k) WAVECOMB_INLINE_LAMBDA { store_parts<N, W>(r[k], at + k); });
  } else {
    unrolled<N / W>([&](auto block) WAVECOMB_INLINE_LAMBDA {
      constexpr size_t c = block * W;
      float* part[W];
      std::array<F, W> columns;
      unrolled<W>([&](auto i) WAVECOMB_INLINE_LAMBDA { part[i] = at[i] + c; });
      unrolled<W>([&](auto k) WAVECOMB_INLINE_LAMBDA { columns[k] = values[c + k]; });
      rows_to<W, F>(part, columns);
    });
  }
}

/// Row of zeros that inactive lanes read.
alignas(64) inline constexpr float kNoRow[16] = {};

}  // namespace detail

/// Loads the words [word, word + N) of an array at `base` for each active lane, where `word` may
/// differ between lanes. Other lanes get 0. N is 2 to 16. Reads only the words [word, word + N) of
/// each row.
template <size_t N, typename F>
WAVECOMB_INLINE std::array<F, N> load_rows(const void* base, const UInt<F>& word,
                                           const Mask<F>& active) {
  constexpr size_t W = kWidth<F>;
  const detail::InMemory<UInt<F>> index(word);
  const auto* from = static_cast<const float*>(base);
  const float* at[W];
  const uint32_t bits = lane_bits<F>(active);
  if (bits == (uint64_t{1} << W) - 1) {
    detail::unrolled<W>([&](auto i) WAVECOMB_INLINE_LAMBDA { at[i] = from + index.value[i]; });
  } else {
    detail::unrolled<W>([&](auto i) WAVECOMB_INLINE_LAMBDA {
      at[i] = (bits >> i & 1u) != 0 ? from + index.value[i] : detail::kNoRow;
    });
  }
  return detail::rows_at<N, F>(at);
}

/// Loads rows of N words from a separate array in each lane. The function `array(i)` returns the
/// array of lane i. `array` is called only for active lanes.
template <size_t N, typename F, typename Array>
WAVECOMB_INLINE std::array<F, N> load_rows_of(const Array& array, const UInt<F>& word,
                                              const Mask<F>& active) {
  constexpr size_t W = kWidth<F>;
  const detail::InMemory<UInt<F>> index(word);
  const float* at[W];
  const uint32_t bits = lane_bits<F>(active);
  detail::unrolled<W>([&](auto i) WAVECOMB_INLINE_LAMBDA {
    at[i] = (bits >> i & 1u) != 0 ? static_cast<const float*>(array(i)) + index.value[i]
                                  : detail::kNoRow;
  });
  return detail::rows_at<N, F>(at);
}

/// Variant of `load_rows_of` without branches, for packets in which all lanes are active.
template <size_t N, typename F, typename Array>
WAVECOMB_INLINE std::array<F, N> load_all_rows_of(const Array& array, const UInt<F>& word) {
  constexpr size_t W = kWidth<F>;
  const detail::InMemory<UInt<F>> index(word);
  const float* at[W];
  detail::unrolled<W>([&](auto i) WAVECOMB_INLINE_LAMBDA {
    at[i] = static_cast<const float*>(array(i)) + index.value[i];
  });
  return detail::rows_at<N, F>(at);
}

/// Stores a row of N words for each active lane. The rows of active lanes must not overlap, and N
/// must be a power of two.
template <size_t N, typename F>
WAVECOMB_INLINE void store_rows(void* base, const UInt<F>& word, const std::array<F, N>& values,
                                const Mask<F>& active) {
  constexpr size_t W = kWidth<F>;
  const detail::InMemory<UInt<F>> index(word);
  auto* to = static_cast<float*>(base);
  alignas(64) float none[N];
  float* at[W];
  const uint32_t bits = lane_bits<F>(active);
  detail::unrolled<W>([&](auto i) WAVECOMB_INLINE_LAMBDA {
    at[i] = (bits >> i & 1u) != 0 ? to + index.value[i] : none;
  });
  detail::rows_to<N, F>(at, values);
}

/// Stores the rows of the active lanes contiguously at `to`, and returns the number of rows.
template <size_t N, typename F>
WAVECOMB_INLINE uint32_t compress_rows(float* to, const std::array<F, N>& values,
                                       const Mask<F>& active) {
  constexpr size_t W = kWidth<F>;
  alignas(64) float none[N];
  float* at[W];
  const uint32_t bits = lane_bits<F>(active);
  uint32_t n = 0;
  for (size_t i = 0; i < W; ++i) {
    const uint32_t one = bits >> i & 1u;
    at[i] = one != 0 ? to + N * n : none;
    n += one;
  }
  detail::rows_to<N, F>(at, values);
  return n;
}

}  // namespace wavecomb
