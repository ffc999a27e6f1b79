// SPDX-License-Identifier: Apache-2.0
/// Rows of 32-bit words with named fields. A row type is a struct template whose parameter is the
/// float type. `Row<float>` is the layout of a row in memory, and `Row<F>` with a packet type `F`
/// contains one row per lane. The macro WAVECOMB_FIELDS lists the fields of a row. Loads, stores
/// and field offsets are derived from this list.
///
///   template <typename F>
///   struct Ray {
///     Vec3<F> o, d;
///     UInt<F> slot;
///     WAVECOMB_FIELDS(o, d, slot)
///   };
///   Ray<F> ray = load_row<Ray, F>(rows, index, active);
///
/// A field is F, UInt<F>, Vec2<F>, Vec3<F>, or a struct with fields. The distance between rows in
/// memory is `kRowWords<Row>` words, a power of two, so that no row crosses a cache line boundary.
#pragma once

#include <array>
#include <bit>
#include <cstddef>
#include <tuple>
#include <type_traits>

#include "wavecomb/core/rows/rows.h"
#include "wavecomb/core/vec3.h"

/// Macro that lists all fields of a row in order.
#define WAVECOMB_FIELDS(...)                      \
  WAVECOMB_INLINE constexpr auto fields() {       \
    return std::tie(__VA_ARGS__);                 \
  }                                               \
  WAVECOMB_INLINE constexpr auto fields() const { \
    return std::tie(__VA_ARGS__);                 \
  }

namespace wavecomb {

namespace detail {

template <typename T>
concept HasFields = requires(T& t) { t.fields(); };

template <typename T>
struct WordsOf;
template <typename Tuple>
struct WordsOfTuple;
template <typename... T>
struct WordsOfTuple<std::tuple<T&...>> {
  static constexpr size_t value = (WordsOf<std::remove_const_t<T>>::value + ... + 0);
};
template <typename T>
struct WordsOf {
  static constexpr size_t count() {
    if constexpr (HasFields<T>)
      return WordsOfTuple<decltype(std::declval<T&>().fields())>::value;
    else
      return 1;
  }
  static constexpr size_t value = count();
};
template <typename F>
struct WordsOf<Vec2<F>> {
  static constexpr size_t value = 2;
};
template <typename F>
struct WordsOf<Vec3<F>> {
  static constexpr size_t value = 3;
};

/// Convert a field of a row to F, the type of loaded and stored words, and back.
template <typename F, typename T>
WAVECOMB_INLINE F to_word(const T& field) {
  if constexpr (std::is_same_v<T, F>)
    return field;
  else
    return bits_float<F>(field);
}
template <typename F, typename T>
WAVECOMB_INLINE void from_word(const F& word, T& field) {
  if constexpr (std::is_same_v<T, F>)
    field = word;
  else
    field = float_bits<F>(word);
}

/// Calls `one(word, value)` for each word of the field `value`, with the index and the value of the
/// word. The first word has the index `At`.
template <size_t At, typename F, typename T, typename One>
WAVECOMB_INLINE void for_each_word(T& value, const One& one);

template <size_t At, typename F, typename One>
WAVECOMB_INLINE void for_each_field(const One&) {}
template <size_t At, typename F, typename One, typename First, typename... Rest>
WAVECOMB_INLINE void for_each_field(const One& one, First& first, Rest&... rest) {
  for_each_word<At, F>(first, one);
  for_each_field<At + WordsOf<std::remove_const_t<First>>::value, F>(one, rest...);
}
template <size_t At, typename F, typename T, typename One>
WAVECOMB_INLINE void for_each_word(T& value, const One& one) {
  using Plain = std::remove_const_t<T>;
  if constexpr (std::is_same_v<Plain, F> || std::is_same_v<Plain, UInt<F>>)
    one(std::integral_constant<size_t, At>(), value);
  else if constexpr (std::is_same_v<Plain, Vec2<F>>)
    for_each_field<At, F>(one, value.x, value.y);
  else if constexpr (std::is_same_v<Plain, Vec3<F>>)
    for_each_field<At, F>(one, value.x, value.y, value.z);
  else
    std::apply([&](auto&... field) WAVECOMB_INLINE_LAMBDA { for_each_field<At, F>(one, field...); },
               value.fields());
}

}  // namespace detail

/// Number of 32-bit words in the fields of a row.
template <template <typename> class Row>
inline constexpr size_t kFieldWords = detail::WordsOf<Row<float>>::value;
/// Distance between the starts of two consecutive rows, in 32-bit words.
template <template <typename> class Row>
inline constexpr size_t kRowWords = std::bit_ceil(kFieldWords<Row>);

/// Returns the word index of a member in a row or record, for example `word_of(&Row<float>::slot)`.
/// Compilers replace the call by a constant.
template <typename Record, typename Member>
WAVECOMB_INLINE uint32_t word_of(Member Record::* member) {
  static_assert(std::is_trivially_copyable_v<Record>);
  static constexpr Record kRecord{};
  const auto address = [](const auto& of) { return reinterpret_cast<const std::byte*>(&of); };
  return static_cast<uint32_t>((address(kRecord.*member) - address(kRecord)) / 4);
}

/// Returns the words of the rows in all lanes as an array, for `store_rows`. Words after the last
/// field are 0.
template <template <typename> class Row, typename F>
WAVECOMB_INLINE std::array<F, kRowWords<Row>> words_of_row(const Row<F>& row) {
  static_assert(sizeof(Row<float>) == 4 * kFieldWords<Row>, "WAVECOMB_FIELDS lists all fields");
  std::array<F, kRowWords<Row>> words;
  detail::for_each_word<0, F>(row, [&](auto at, const auto& value) WAVECOMB_INLINE_LAMBDA {
    words[at] = detail::to_word<F>(value);
  });
  for (size_t i = kFieldWords<Row>; i < kRowWords<Row>; ++i) words[i] = F(0.f);
  return words;
}

namespace detail {

template <typename Head, typename Row>
struct IsHead;
template <typename... H, typename... R>
struct IsHead<std::tuple<H&...>, std::tuple<R&...>> {
  template <size_t... I>
  static constexpr bool same(std::index_sequence<I...>) {
    return (std::is_same_v<std::tuple_element_t<I, std::tuple<H...>>,
                           std::tuple_element_t<I, std::tuple<R...>>> &&
            ...);
  }
  static constexpr bool value =
      sizeof...(H) <= sizeof...(R) && same(std::make_index_sequence<sizeof...(H)>());
};

}  // namespace detail

/// Whether the row type Row begins with the fields of the row type Head.
template <template <typename> class Head, template <typename> class Row>
inline constexpr bool kIsHead =
    detail::IsHead<decltype(std::declval<Head<float>&>().fields()),
                   decltype(std::declval<Row<float>&>().fields())>::value;

/// Loads the first fields of row `index` in the array of rows at `base`, for each active lane;
/// other lanes get 0. `Head` is a row type with only these fields. The number of words that are
/// read is rounded up to a power of two.
template <template <typename> class Head, template <typename> class Row, typename F>
WAVECOMB_INLINE Head<F> load_head(const void* base, const UInt<F>& index, const Mask<F>& active) {
  static_assert(sizeof(Head<float>) == 4 * kFieldWords<Head>, "WAVECOMB_FIELDS lists all fields");
  static_assert(kIsHead<Head, Row>);
  const auto words =
      load_rows<kRowWords<Head>, F>(base, index * static_cast<uint32_t>(kRowWords<Row>), active);
  Head<F> head;
  detail::for_each_word<0, F>(head, [&](auto at, auto& value) WAVECOMB_INLINE_LAMBDA {
    detail::from_word<F>(words[at], value);
  });
  return head;
}

/// Loads row `index` of the array at `base` for each active lane; other lanes get 0.
template <template <typename> class Row, typename F>
WAVECOMB_INLINE Row<F> load_row(const void* base, const UInt<F>& index, const Mask<F>& active) {
  return load_head<Row, Row, F>(base, index, active);
}

/// Stores the row of each active lane as row `index` of the array at `base`. The indices of active
/// lanes must be distinct.
template <template <typename> class Row, typename F>
WAVECOMB_INLINE void store_row(void* base, const UInt<F>& index, const Row<F>& row,
                               const Mask<F>& active) {
  constexpr auto kWords = static_cast<uint32_t>(kRowWords<Row>);
  store_rows<kWords, F>(base, index * kWords, words_of_row<Row, F>(row), active);
}

/// Stores the rows of the active lanes contiguously at `to`, and returns the number of rows.
template <template <typename> class Row, typename F>
WAVECOMB_INLINE uint32_t compress_row(float* to, const Row<F>& row, const Mask<F>& active) {
  return compress_rows<kRowWords<Row>, F>(to, words_of_row<Row, F>(row), active);
}

/// Loads one field of row `index` at `base` for each active lane; other lanes get 0. Use load_row()
/// if most fields are needed, since whole rows are faster.
template <typename F, template <typename> class Row>
WAVECOMB_INLINE F gather_field(const void* base, float Row<float>::* field, const UInt<F>& index,
                               const Mask<F>& active) {
  return gather<F>(base, index * static_cast<uint32_t>(kRowWords<Row>) + word_of(field), active);
}
template <typename F, template <typename> class Row>
WAVECOMB_INLINE UInt<F> gather_field(const void* base, uint32_t Row<float>::* field,
                                     const UInt<F>& index, const Mask<F>& active) {
  return gather<UInt<F>>(base, index * static_cast<uint32_t>(kRowWords<Row>) + word_of(field),
                         Mask<UInt<F>>(active));
}
template <typename F, template <typename> class Row>
WAVECOMB_INLINE void scatter_field(void* base, float Row<float>::* field, const UInt<F>& index,
                                   const F& value, const Mask<F>& active) {
  scatter<F>(base, value, index * static_cast<uint32_t>(kRowWords<Row>) + word_of(field), active);
}
template <typename F, template <typename> class Row>
WAVECOMB_INLINE void scatter_field(void* base, uint32_t Row<float>::* field, const UInt<F>& index,
                                   const UInt<F>& value, const Mask<F>& active) {
  scatter<UInt<F>>(base, value, index * static_cast<uint32_t>(kRowWords<Row>) + word_of(field),
                   Mask<UInt<F>>(active));
}

/// Loads a member of record `index` at `base` for each active lane; other lanes get 0.
template <typename F, typename Record>
WAVECOMB_INLINE UInt<F> gather_member(const Record* base, uint32_t Record::* member,
                                      const UInt<F>& index, const Mask<F>& active) {
  constexpr auto kWords = static_cast<uint32_t>(sizeof(Record) / 4);
  return gather<UInt<F>>(base, index * kWords + word_of(member), Mask<UInt<F>>(active));
}
template <typename F, typename Record>
WAVECOMB_INLINE F gather_member(const Record* base, float Record::* member, const UInt<F>& index,
                                const Mask<F>& active) {
  constexpr auto kWords = static_cast<uint32_t>(sizeof(Record) / 4);
  return gather<F>(base, index * kWords + word_of(member), active);
}

template <typename F, typename Record>
WAVECOMB_INLINE Vec3<F> gather_member(const Record* base, float (Record::*member)[3],
                                      const UInt<F>& index, const Mask<F>& active) {
  constexpr auto kWords = static_cast<uint32_t>(sizeof(Record) / 4);
  const UInt<F> first = index * kWords + word_of(member);
  return {gather<F>(base, first, active), gather<F>(base, first + 1u, active),
          gather<F>(base, first + 2u, active)};
}

/// Stores the fields of `head` as one array per word: word k of all lanes is stored at `columns[k]
/// + at`.
template <template <typename> class Head, typename F, size_t C>
WAVECOMB_INLINE void store_columns(const Head<F>& head, float* const (&columns)[C], size_t at) {
  static_assert(C == kFieldWords<Head>);
  detail::for_each_word<0, F>(head, [&](auto word, const auto& value) WAVECOMB_INLINE_LAMBDA {
    store(columns[word] + at, detail::to_word<F>(value));
  });
}

}  // namespace wavecomb
