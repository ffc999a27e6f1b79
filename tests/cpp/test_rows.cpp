// SPDX-License-Identifier: Apache-2.0
/// Loads and stores of rows at every lane width, compared with scalar loops. Rows end at the end of
/// accessible memory, so that any access beyond crashes.
#include "wavecomb/core/rows/rows.h"

#include <sys/mman.h>
#include <unistd.h>

#include <algorithm>
#include <cstring>
#include <memory>
#include <new>
#include <numeric>

#include "lane_testing.h"

namespace wavecomb {
namespace {

using namespace lane_testing;

/// Memory between two inaccessible pages: `begin()` is the first 32-bit word of a page and `end()`
/// is just past the last one.
class GuardedWords {
 public:
  GuardedWords() : page_(static_cast<size_t>(sysconf(_SC_PAGESIZE))) {
    void* const all =
        mmap(nullptr, 3 * page_, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
    if (all == MAP_FAILED) throw std::bad_alloc();
    all_ = static_cast<char*>(all);
    if (mprotect(all_, page_, PROT_NONE) != 0 || mprotect(all_ + 2 * page_, page_, PROT_NONE) != 0)
      throw std::bad_alloc();
  }
  ~GuardedWords() { munmap(all_, 3 * page_); }
  GuardedWords(const GuardedWords&) = delete;
  GuardedWords& operator=(const GuardedWords&) = delete;

  uint32_t* begin() const { return reinterpret_cast<uint32_t*>(all_ + page_); }
  uint32_t* end() const { return reinterpret_cast<uint32_t*>(all_ + 2 * page_); }
  uint32_t size() const { return static_cast<uint32_t>(page_ / 4); }

 private:
  size_t page_;
  char* all_;
};

/// Random bits; every fourth word is a NaN with a payload, quiet or signalling.
uint32_t random_word(std::mt19937& rng) {
  const auto word = static_cast<uint32_t>(rng());
  return word % 4 == 0 ? word | 0x7f800001u : word;
}

/// Start of a row of n words: the first and last possible position in `size` words, and others.
uint32_t random_place(std::mt19937& rng, uint32_t size, uint32_t n) {
  switch (rng() % 4) {
    case 0:
      return 0;
    case 1:
      return size - n;
    default:
      return static_cast<uint32_t>(rng()) % (size - n + 1);
  }
}

/// Invalid index of inactive lanes.
constexpr uint32_t kWild = 0x7fffff00u;

/// Calls f.operator()<F, N>() for every lane type and row length.
template <size_t... N, typename Function>
void for_each_row(const Function& f) {
  for_each_lane_type([&]<typename F>() { (f.template operator()<F, N>(), ...); });
}

/// N random values per lane, and the same 32-bit words by lane.
template <typename F, size_t N>
struct RandomRows {
  std::array<F, N> values;
  uint32_t words[kWidth<F>][N];

  explicit RandomRows(std::mt19937& rng) {
    for (size_t k = 0; k < N; ++k) {
      uint32_t column[kWidth<F>];
      for (size_t i = 0; i < kWidth<F>; ++i) column[i] = words[i][k] = random_word(rng);
      values[k] = load<F>(column);
    }
  }
};

/// Expects word k of lane i to equal `expected(i, k)` bitwise.
template <typename F, size_t N, typename Expected>
void expect_words(const std::array<F, N>& rows, const Expected& expected) {
  for (size_t k = 0; k < N; ++k) {
    uint32_t column[kWidth<F>];
    store(column, rows[k]);
    for (size_t i = 0; i < kWidth<F>; ++i)
      ASSERT_EQ(column[i], expected(i, k))
          << kWidth<F> << " lanes, rows of " << N << ", lane " << i << ", word " << k;
  }
}

TEST(Rows, LoadRowsReadsActiveRowsAndNothingElse) {
  const GuardedWords memory;
  std::mt19937 rng(1);
  for (uint32_t* w = memory.begin(); w != memory.end(); ++w) *w = random_word(rng);
  for_each_row<2, 3, 4, 8, 16>([&]<typename F, size_t N>() {
    for (const uint32_t bits : mask_patterns<F>()) {
      uint32_t at[kWidth<F>];
      for (size_t i = 0; i < kWidth<F>; ++i)
        at[i] = (bits >> i & 1u) != 0 ? random_place(rng, memory.size(), N) : kWild;
      const auto rows = load_rows<N, F>(memory.begin(), load<UInt<F>>(at), make_mask<F>(bits));
      expect_words<F, N>(rows, [&](size_t i, size_t k) {
        return (bits >> i & 1u) != 0 ? memory.begin()[at[i] + k] : 0u;
      });
      if (testing::Test::HasFatalFailure()) return;
    }
  });
}

TEST(Rows, LoadRowsOfReadsEachLanesOwnArray) {
  std::vector<std::unique_ptr<GuardedWords>> memory;
  std::mt19937 rng(2);
  for (int i = 0; i < 5; ++i) {
    memory.push_back(std::make_unique<GuardedWords>());
    for (uint32_t* w = memory.back()->begin(); w != memory.back()->end(); ++w)
      *w = random_word(rng);
  }
  for_each_row<2, 3, 4, 8, 16>([&]<typename F, size_t N>() {
    for (const uint32_t bits : mask_patterns<F>()) {
      const uint32_t* base[kWidth<F>];
      uint32_t at[kWidth<F>];
      for (size_t i = 0; i < kWidth<F>; ++i) {
        const auto length = static_cast<uint32_t>(N + rng() % 40);
        base[i] = memory[rng() % memory.size()]->end() - length;
        at[i] = (bits >> i & 1u) != 0 ? random_place(rng, length, N) : kWild;
      }
      uint32_t asked = 0;
      const auto array = [&](size_t i) -> const void* {
        asked |= 1u << i;
        return base[i];
      };
      const auto rows = load_rows_of<N, F>(array, load<UInt<F>>(at), make_mask<F>(bits));
      ASSERT_EQ(asked, bits) << "active lanes have an array, others may have none";
      expect_words<F, N>(rows, [&](size_t i, size_t k) {
        return (bits >> i & 1u) != 0 ? base[i][at[i] + k] : 0u;
      });
      if (testing::Test::HasFatalFailure()) return;
    }
  });
}

TEST(Rows, StoreRowsWritesActiveRowsAndNothingElse) {
  const GuardedWords memory;
  std::mt19937 rng(3);
  for_each_row<2, 4, 8, 16>([&]<typename F, size_t N>() {
    // Leaves room for one row per lane plus one row in between, up to the end of the page.
    constexpr uint32_t kPlaces = kWidth<F> + 1;
    uint32_t* const base = memory.end() - kPlaces * N;
    for (const uint32_t bits : mask_patterns<F>()) {
      std::vector<uint32_t> expected(kPlaces * N);
      for (uint32_t& w : expected) w = random_word(rng);
      std::copy(expected.begin(), expected.end(), base);
      uint32_t place[kPlaces], at[kWidth<F>];
      std::iota(place, place + kPlaces, 0u);
      std::shuffle(place, place + kPlaces, rng);
      const RandomRows<F, N> rows(rng);
      for (size_t i = 0; i < kWidth<F>; ++i) {
        const bool active = (bits >> i & 1u) != 0;
        at[i] = active ? place[i] * static_cast<uint32_t>(N) : kWild;
        if (active) std::copy_n(rows.words[i], N, expected.data() + at[i]);
      }
      store_rows<N, F>(base, load<UInt<F>>(at), rows.values, make_mask<F>(bits));
      ASSERT_EQ(std::memcmp(base, expected.data(), 4 * expected.size()), 0)
          << kWidth<F> << " lanes, rows of " << N << ", lanes " << bits;
    }
  });
}

TEST(Rows, CompressRowsKeepsOrderAndNeedsNoRoomBehind) {
  const GuardedWords memory;
  std::mt19937 rng(4);
  for_each_row<2, 4, 8, 16>([&]<typename F, size_t N>() {
    for (const uint32_t bits : mask_patterns<F>()) {
      const auto n = static_cast<size_t>(std::popcount(bits));
      uint32_t* const to = memory.end() - n * N;
      const uint32_t before = to[-1];
      const RandomRows<F, N> rows(rng);
      std::vector<uint32_t> expected;
      for (size_t i = 0; i < kWidth<F>; ++i)
        if ((bits >> i & 1u) != 0)
          expected.insert(expected.end(), rows.words[i], rows.words[i] + N);
      ASSERT_EQ(
          (compress_rows<N, F>(reinterpret_cast<float*>(to), rows.values, make_mask<F>(bits))), n);
      ASSERT_TRUE(std::equal(expected.begin(), expected.end(), to))
          << kWidth<F> << " lanes, rows of " << N << ", lanes " << bits;
      ASSERT_EQ(to[-1], before);
    }
  });
}

}  // namespace
}  // namespace wavecomb
