// SPDX-License-Identifier: Apache-2.0
/// Between what the values of a row of texels lie, while the row is stored.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <type_traits>

#include "wavecomb/texture/pyramid.h"

namespace wavecomb {

/// The least and the largest of values that are stored as T, of C interleaved channels. They are
/// noted `kRow` at a time, each place of those apart, so that they are compared in lanes.
///
/// Codes of halfs are not in the order of what they stand for, so that these are noted as they are
/// before they are stored; those of bytes are, and are less to go through.
template <typename T, size_t C, size_t kRow>
class RowRange {
  static constexpr bool kByCode = std::is_same_v<T, uint8_t>;
  using Value = std::conditional_t<kByCode, T, float>;

 public:
  RowRange() {
    std::fill(low_, low_ + kRow, std::numeric_limits<Value>::max());
    std::fill(high_, high_ + kRow, std::numeric_limits<Value>::lowest());
  }

  /// `n` values, at least C and kRow at most, and what they are stored as.
  void note(const float* values, const T* codes, size_t n) {
    const Value* noted;
    if constexpr (kByCode)
      noted = codes;
    else
      noted = values;
    // Copies, which alias nothing: the loops are of a known length, and become a few comparisons.
    Value all[kRow];
    if (n == kRow) {
      std::copy_n(noted, kRow, all);
    } else {
      for (size_t i = 0; i < kRow; ++i) all[i] = noted[i < n ? i : i % C];
    }
    for (size_t i = 0; i < kRow; ++i) low_[i] = std::min(low_[i], all[i]);
    for (size_t i = 0; i < kRow; ++i) high_[i] = std::max(high_[i], all[i]);
  }

  /// Adds the range of what was stored to `totals`: encode(value, channel) is what a value is
  /// stored as, decode(code, channel) what that stands for.
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
