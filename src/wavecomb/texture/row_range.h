// SPDX-License-Identifier: Apache-2.0
/// Value range of a row of texels, computed while the row is stored.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <type_traits>

#include "wavecomb/texture/pyramid.h"

namespace wavecomb {

/// Minimum and maximum of values that are stored as T, with C interleaved channels. Values are
/// added in rows of up to `kRow` values, and each position in a row has a separate range, so that
/// the comparisons vectorise.
///
/// 8-bit values are compared as stored codes, since the codes have the same order as the values and
/// take less memory. Half values are compared as floats, since the order of their codes differs
/// from the order of the values.
template <typename T, size_t C, size_t kRow>
class RowRange {
  static constexpr bool kByCode = std::is_same_v<T, uint8_t>;
  using Value = std::conditional_t<kByCode, T, float>;

 public:
  RowRange() {
    std::fill(low_, low_ + kRow, std::numeric_limits<Value>::max());
    std::fill(high_, high_ + kRow, std::numeric_limits<Value>::lowest());
  }

  /// Adds a row of `n` values (C <= n <= kRow), given as floats and as stored codes.
  void extend(const float* values, const T* codes, size_t n) {
    const Value* row_values;
    if constexpr (kByCode)
      row_values = codes;
    else
      row_values = values;
    // Local copies of the ranges have no aliases and a fixed length, so that the loops compile to a
    // few comparisons.
    Value all[kRow];
    if (n == kRow) {
      std::copy_n(row_values, kRow, all);
    } else {
      for (size_t i = 0; i < kRow; ++i) all[i] = row_values[i < n ? i : i % C];
    }
    for (size_t i = 0; i < kRow; ++i) low_[i] = std::min(low_[i], all[i]);
    for (size_t i = 0; i < kRow; ++i) high_[i] = std::max(high_[i], all[i]);
  }

  /// Adds the range of the stored values to `totals`. encode(value, channel) returns the stored
  /// code of a value; decode(code, channel) returns its linear value.
  template <typename Encode, typename Decode>
  void add_to(PyramidTotals& totals, const Encode& encode, const Decode& decode) const {
    const auto stored = [&](Value value, size_t c) {
      if constexpr (kByCode)
        return decode(value, c);
      else
        return decode(T(encode(value, c)), c);
    };
    for (size_t i = 0; i < kRow; ++i) {
      totals.low[i % C] = std::min(totals.low[i % C], stored(low_[i], i % C));
      totals.high[i % C] = std::max(totals.high[i % C], stored(high_[i], i % C));
    }
  }

 private:
  Value low_[kRow], high_[kRow];
};

}  // namespace wavecomb
