// SPDX-License-Identifier: Apache-2.0
/// Reader of records of 32-bit words. Each lane may read a different record. The reader uses scalar
/// loads if all active lanes read the same record, and gather instructions otherwise.
#pragma once

#include <bit>
#include <cstddef>
#include <cstring>
#include <type_traits>

#include "wavecomb/core/math.h"
#include "wavecomb/core/rows/fields.h"
#include "wavecomb/core/vec.h"

namespace wavecomb::detail {

/// Accessor for the members of a record in each lane. Inactive lanes read 0 or the values of other
/// lanes.
template <typename F>
struct RecordReader {
  const void* base;
  UInt<F> first_word;
  /// The record that all active lanes read, or null if they read different records.
  const std::byte* shared;
  Mask<F> active;

  /// Reads a member of the record, for example `reader[&MaterialRecord::roughness]`.
  template <typename Record>
  F operator[](float Record::* member) const {
    return word<F, float>(word_of(member));
  }
  template <typename Record>
  UInt<F> operator[](uint32_t Record::* member) const {
    return word<UInt<F>, uint32_t>(word_of(member));
  }
  template <typename Record>
  Vec3<F> operator[](float (Record::*member)[3]) const {
    const uint32_t first = word_of(member);
    return {word<F, float>(first), word<F, float>(first + 1), word<F, float>(first + 2)};
  }
  /// Reads element `i` of an array member of the record.
  template <typename Record, size_t N>
  F at(float (Record::*member)[N], size_t i) const {
    return word<F, float>(word_of(member) + static_cast<uint32_t>(i));
  }
  /// Reads a row of fields that is stored at the start of the record.
  template <template <typename> class Row>
  Row<F> row() const {
    Row<F> row;
    for_each_word<0, F>(row, [&](auto at, auto& value) WAVECOMB_INLINE_LAMBDA {
      value = word<std::remove_cvref_t<decltype(value)>,
                   std::conditional_t<std::is_same_v<std::remove_cvref_t<decltype(value)>, F>,
                                      float, uint32_t>>(at);
    });
    return row;
  }

 private:
  template <typename T, typename Scalar>
  T word(uint32_t at) const {
    if (shared) {
      Scalar value;
      std::memcpy(&value, shared + size_t{at} * 4, sizeof(value));
      return T(value);
    }
    if constexpr (kIsScalar<F>)
      return T(0);  // with a single lane, null means that the lane is inactive
    else
      return gather<T>(base, first_word + at, Mask<T>(active));
  }
};

/// Returns a reader of record `index` in the array at `base`. Pass `uniform` = true if the indices
/// of all active lanes are known to be equal.
template <typename Record, typename F>
inline RecordReader<F> make_reader(const Record* base, const UInt<F>& index, bool uniform,
                                   const Mask<F>& active) {
  constexpr uint32_t kWords = sizeof(Record) / 4;
  const std::byte* shared = nullptr;
  if (uniform) shared = reinterpret_cast<const std::byte*>(base + first_active(index, active));
  return {base, index * kWords, shared, active};
}

/// Returns a reader that checks whether the indices of the active lanes are equal.
template <typename Record, typename F>
inline RecordReader<F> make_reader(const Record* base, const UInt<F>& index,
                                   const Mask<F>& active) {
  return make_reader<Record, F>(base, index, any(active) && is_uniform<F>(index, active), active);
}

/// Returns a reader of the same record in all lanes.
template <typename Record, typename F>
inline RecordReader<F> make_reader(const Record& record, const Mask<F>& active) {
  return {&record, UInt<F>(0u), reinterpret_cast<const std::byte*>(&record), active};
}

}  // namespace wavecomb::detail
