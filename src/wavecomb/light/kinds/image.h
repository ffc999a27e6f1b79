// SPDX-License-Identifier: Apache-2.0
/// Sampling of image points with a Distribution2D, and the density of these points. The functions
/// are used by all lights with an image over the unit square.
///
/// The image coordinate x equals s and points to the right; y points down from the top row, so y =
/// 1 - t.
#pragma once

#include <algorithm>
#include <bit>

#include "wavecomb/light/records/record_reader.h"

namespace wavecomb::detail {

/// Interval with index `index` of a row of a Distribution2D: its start, and its number of counts
/// out of the row's 65536.
template <typename F>
struct Interval {
  UInt<F> index, begin, count;
};

/// Returns interval `index` of a row of n intervals. Reads the two adjacent cumulative values as
/// one 32-bit word.
template <typename F>
inline Interval<F> interval_at(const Distribution2D& d, const UInt<F>& row, uint32_t n,
                               const UInt<F>& index, const Mask<F>& active) {
  using U = UInt<F>;
  const auto value = [&](const U& i, const Mask<F>& lanes) {
    const U word = gather<U>(d.cumulative.data(), i >> 1, Mask<U>(lanes));
    return U((word >> ((i & 1u) << 4)) & 0xffffu);
  };
  const U at = row * (d.row_lines * Distribution2D::kLine) + index;
  const Mask<F> inner = active & Mask<F>(index + 1u < U(n));
  const U begin = value(at, active);
  const U end = select(Mask<U>(inner), value(at + 1u, inner), U(Distribution2D::kCounts));
  return {index, begin, end - begin};
}

/// Returns the index of the last of the `n` ascending values in a cache line that is at most x. The
/// first value must be at most x. The loop compares all values of the line, which fit in one or two
/// registers.
inline uint32_t last_at_most(const Distribution2D::Line& line, uint32_t n, uint16_t x) {
  uint16_t at_most = 0;
  for (const uint16_t value : line.value) at_most = static_cast<uint16_t>(at_most + (value <= x));
  return std::min<uint32_t>(at_most, n) - 1;
}

/// Returns the interval to which the sample value x in [0, kCounts) belongs, in a row of n
/// intervals.
template <typename F>
inline Interval<F> find_interval(const Distribution2D& d, const UInt<F>& row, uint32_t n,
                                 const UInt<F>& x, const Mask<F>& active) {
  using U = UInt<F>;
  constexpr uint32_t kLine = Distribution2D::kLine;
  const InMemory<U> rows(row), counts(x);
  InMemory<U> index, begin, count;
  for (uint64_t bits = lane_bits<F>(active); bits != 0; bits &= bits - 1) {
    const auto i = static_cast<size_t>(std::countr_zero(bits));
    const auto one = static_cast<uint16_t>(counts.value[i]);
    const uint32_t line = last_at_most(d.coarse[rows.value[i]], (n + kLine - 1) / kLine, one);
    const Distribution2D::Line* const at =
        &d.cumulative[size_t{rows.value[i]} * d.row_lines + line];
    const uint32_t in_row = line * kLine + last_at_most(*at, n - line * kLine, one);
    const uint16_t* const value = at->value + in_row % kLine;
    index.value[i] = in_row;
    begin.value[i] = value[0];
    count.value[i] = (in_row + 1 == n ? Distribution2D::kCounts : value[1]) - value[0];
  }
  return {load<U>(index.value), load<U>(begin.value), load<U>(count.value)};
}

/// Returns the density over the unit square in a cell, which is the product of the densities of its
/// row and its column. Each of these is count / 65536 * (number of intervals).
template <typename F>
inline F image_pdf(const Distribution2D& d, const UInt<F>& row_count, const UInt<F>& column_count) {
  const float scale = static_cast<float>(d.width) * static_cast<float>(d.height) * 0x1p-32f;
  return F(Int<F>(row_count)) * F(Int<F>(column_count)) * scale;
}

template <typename F>
struct ImagePoint {
  F x, y;
  F pdf;  ///< density of the point over the unit square
};

/// Samples an image point: first the row by the marginal distribution, then the column, both by
/// inversion. u and v are multiples of 2^-24, or of 2^-20 / n with n up to 16, so that u and v
/// times kCounts are exact.
template <typename F>
inline ImagePoint<F> sample_image(const Distribution2D& d, const F& u, const F& v,
                                  const Mask<F>& active) {
  using U = UInt<F>;
  const F scaled_u = u * float{Distribution2D::kCounts},
          scaled_v = v * float{Distribution2D::kCounts};
  const auto inside = [](const F& scaled, const Interval<F>& i) {
    const F part = (scaled - F(Int<F>(i.begin))) / max(F(Int<F>(i.count)), F(1.f));
    return min(max(part, F(0.f)), F(kOneMinusEpsilon));
  };
  const Interval<F> y = find_interval<F>(d, U(d.height), d.height, U(to_int<F>(scaled_v)), active);
  const Interval<F> x = find_interval<F>(d, y.index, d.width, U(to_int<F>(scaled_u)), active);
  return {(F(Int<F>(x.index)) + inside(scaled_u, x)) * (1.f / static_cast<float>(d.width)),
          (F(Int<F>(y.index)) + inside(scaled_v, y)) * (1.f / static_cast<float>(d.height)),
          image_pdf<F>(d, y.count, x.count)};
}

/// Returns the density of sample_image() at point (x, y) of the unit square. Points outside the
/// square use the nearest cell.
template <typename F>
inline F image_pdf_at(const Distribution2D& d, const F& x, const F& y, const Mask<F>& active) {
  const auto cell = [](const F& at, uint32_t size) {
    const F i =
        clamp(floor(F(at * static_cast<float>(size))), F(0.f), F(static_cast<float>(size - 1)));
    return UInt<F>(to_int<F>(i));
  };
  const UInt<F> row_index = cell(y, d.height);
  const Interval<F> row = interval_at<F>(d, UInt<F>(d.height), d.height, row_index, active);
  const Interval<F> column = interval_at<F>(d, row_index, d.width, cell(x, d.width), active);
  return image_pdf<F>(d, row.count, column.count);
}

}  // namespace wavecomb::detail
