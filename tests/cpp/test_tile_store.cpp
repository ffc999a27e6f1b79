// SPDX-License-Identifier: Apache-2.0
/// The tile store, which keeps textures within a memory limit: contents, resident memory, and order
/// of eviction.
#include "wavecomb/texture/tile_store.h"

#include <gtest/gtest.h>
#include <linux/filter.h>
#include <linux/seccomp.h>
#include <linux/userfaultfd.h>
#include <sys/ioctl.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <cerrno>
#include <cstddef>
#include <cstring>
#include <functional>
#include <numeric>
#include <thread>

#include "parts.h"
#include "wavecomb/core/error.h"
#include "wavecomb/texture/texture.h"

namespace wavecomb {
namespace {

constexpr uint64_t kLimit = 2'000'000;
constexpr size_t kSize = 700'001;  ///< size of a texture; not a multiple of the page size

using State = TileQueue::State;

/// Loads an absent tile, as the store does.
void load(TileQueue& queue, uint32_t tile, size_t tile_limit) {
  queue.begin(tile);
  EXPECT_EQ(queue.state(tile), State::kLoading);
  uint32_t gone;
  while (queue.resident() > tile_limit && queue.release(gone)) EXPECT_NE(gone, tile);
  queue.end(tile, tile_limit);
}

TEST(TileQueue, WhatCameFirstGoesFirst) {
  TileQueue queue;
  queue.resize(10);
  for (uint32_t tile : {4u, 2u, 9u}) load(queue, tile, 3);
  EXPECT_EQ(queue.resident(), 3u);
  uint32_t gone;
  for (uint32_t tile : {4u, 2u, 9u}) {
    ASSERT_TRUE(queue.release(gone));
    EXPECT_EQ(gone, tile);
    EXPECT_EQ(queue.state(gone), State::kAbsent);
  }
  EXPECT_FALSE(queue.release(gone));
}

TEST(TileQueue, WhatIsMissedSoonStaysLonger) {
  TileQueue queue;
  queue.resize(100);
  for (uint32_t tile = 0; tile < 9; ++tile) load(queue, tile, 8);
  EXPECT_EQ(queue.state(0), State::kAbsent);
  load(queue, 0, 8);
  EXPECT_EQ(queue.state(0), State::kSecond);
  // A sequential scan does not evict tiles that are in repeated use.
  for (uint32_t tile = 10; tile < 90; ++tile) {
    load(queue, tile, 8);
    ASSERT_EQ(queue.resident(), 8u);
  }
  EXPECT_EQ(queue.state(0), State::kSecond);
  // A tile that was evicted long ago counts as new.
  load(queue, 10, 8);
  EXPECT_EQ(queue.state(10), State::kFirst);
  // The tile store's second queue does not take all memory.
  for (int round = 0; round < 5; ++round)
    for (uint32_t tile = 20; tile < 30; ++tile)
      if (queue.state(tile) == State::kAbsent) load(queue, tile, 8);
  EXPECT_EQ(queue.resident(), 8u);
  uint32_t second = 0;
  for (uint32_t tile = 0; tile < 100; ++tile) second += queue.state(tile) == State::kSecond;
  EXPECT_LE(second, 6u);
  EXPECT_GT(second, 0u);
}

TEST(TileQueue, ForgetsWhatWasDropped) {
  TileQueue queue;
  queue.resize(4);
  for (uint32_t tile = 0; tile < 3; ++tile) load(queue, tile, 2);
  queue.drop(1);
  EXPECT_EQ(queue.resident(), 1u);
  queue.drop(0);
  load(queue, 0, 2);
  EXPECT_EQ(queue.state(0), State::kFirst);
}

std::vector<std::byte> content(uint32_t seed, size_t size = kSize) {
  std::vector<std::byte> bytes(size);
  uint32_t state = seed * 2654435761u + 1;
  for (std::byte& b : bytes) {
    state = state * 1664525u + 1013904223u;
    b = std::byte(state >> 24);
  }
  return bytes;
}

/// Resident bytes of a range, reported by the kernel.
size_t resident(const std::byte* at, size_t bytes) {
  const size_t pages = (bytes + page_bytes() - 1) / page_bytes();
  std::vector<unsigned char> there(pages);
  EXPECT_EQ(::mincore(const_cast<std::byte*>(at), pages * page_bytes(), there.data()), 0);
  size_t sum = 0;
  for (unsigned char page : there) sum += (page & 1u) * page_bytes();
  return sum;
}

class TileStoreTest : public testing::Test {
 protected:
  void SetUp() override {
    WAVECOMB_NEEDS("userfaultfd", UserFaults::unsupported_reason());
    store = std::make_unique<TileStore>(kLimit, testing::TempDir());
  }
  const std::byte* add(uint32_t seed) {
    const auto bytes = content(seed);
    places.push_back(store->add(bytes.data(), bytes.size()));
    seeds.push_back(seed);
    return places.back();
  }
  bool is_intact(size_t i) const {
    return std::memcmp(places[i], content(seeds[i]).data(), kSize) == 0;
  }
  size_t all_resident() const {
    size_t sum = 0;
    for (const std::byte* place : places) sum += resident(place, kSize);
    return sum;
  }

  std::unique_ptr<TileStore> store;
  std::vector<const std::byte*> places;
  std::vector<uint32_t> seeds;
};

TEST_F(TileStoreTest, WhatFitsLiesInMemoryAndNeedsNoFile) {
  for (uint32_t seed : {1u, 2u}) add(seed);
  EXPECT_GE(all_resident(), 2 * kSize);
  for (size_t i = 0; i < 2; ++i) EXPECT_TRUE(is_intact(i));
  const StoreStatistics s = store->statistics();
  EXPECT_EQ(s.file_bytes, 0u);
  EXPECT_EQ(s.loads, 0u);
  EXPECT_EQ(s.texture_bytes, 2 * kSize);
  EXPECT_GE(s.resident_bytes, 2 * kSize);
  EXPECT_LE(s.peak_bytes, kLimit);
}

TEST_F(TileStoreTest, ManyReadersSeeAllOfItWithinTheLimit) {
  for (uint32_t seed = 0; seed < 12; ++seed) add(seed);
  EXPECT_EQ(all_resident(), 0u);
  std::atomic<size_t> wrong = 0, most = 0;
  std::vector<std::thread> readers;
  for (uint32_t r = 0; r < 4; ++r)
    readers.emplace_back([&, r] {
      uint32_t state = r;
      std::vector<std::vector<std::byte>> expected;
      for (uint32_t seed : seeds) expected.push_back(content(seed));
      for (int i = 0; i < 4000; ++i) {
        state = state * 1664525u + 1013904223u;
        const size_t texture = (state >> 8) % places.size(), at = (state >> 4) % kSize;
        wrong += places[texture][at] != expected[texture][at];
        if (i % 100 == 0) most = std::max<size_t>(most, all_resident());
      }
    });
  for (std::thread& reader : readers) reader.join();
  EXPECT_EQ(wrong, 0u);
  for (size_t i = 0; i < places.size(); ++i) EXPECT_TRUE(is_intact(i));
  const StoreStatistics s = store->statistics();
  EXPECT_LE(s.peak_bytes, kLimit);
  EXPECT_GT(s.peak_bytes, kLimit * 95 / 100);
  EXPECT_EQ(s.resident_bytes / 100'000, s.peak_bytes / 100'000);
  // While one thread counts page by page, others may load pages that it has not reached yet, hence
  // the tolerance.
  EXPECT_LE(most, kLimit * 105 / 100);
  EXPECT_LE(all_resident(), kLimit);
  EXPECT_GE(s.file_bytes, 12 * kSize);
  EXPECT_LE(s.file_bytes, 12 * (kSize + TileStore::kTileBytes));
  EXPECT_GT(s.loads, 12 * kSize / TileStore::kTileBytes);
  EXPECT_NEAR(static_cast<double>(s.loads - s.releases) * TileStore::kTileBytes,
              static_cast<double>(all_resident()), 3.0 * TileStore::kTileBytes);
  EXPECT_NO_THROW(store->check());
}

TEST_F(TileStoreTest, GridsLeaveLessForTextures) {
  constexpr size_t kGrid = 900'000;
  const int grid = 0, other = 0;
  store->register_grid(&grid, kGrid);
  store->register_grid(&grid, kGrid);
  add(0);
  EXPECT_EQ(store->statistics().file_bytes, 0u);
  add(1);
  EXPECT_GT(store->statistics().file_bytes, 0u);
  const auto read_all = [&] {
    for (size_t i = 0; i < places.size(); ++i) EXPECT_TRUE(is_intact(i));
  };
  read_all();
  EXPECT_EQ(store->statistics().grid_bytes, kGrid);
  EXPECT_LE(all_resident() + kGrid, kLimit);
  // Registering a grid later evicts textures, down to a few tiles if the grid is larger than the
  // limit.
  store->register_grid(&other, 10 * kLimit);
  EXPECT_LE(all_resident(), 32 * TileStore::kTileBytes);
  read_all();
  store->unregister_grid(&other);
  store->unregister_grid(&grid);
  EXPECT_EQ(store->statistics().grid_bytes, kGrid);
  store->unregister_grid(&grid);
  EXPECT_EQ(store->statistics().grid_bytes, 0u);
  read_all();
  EXPECT_GT(all_resident(), kLimit / 2);
}

TEST_F(TileStoreTest, PlacesOfWhatIsRemovedAreUsedAgain) {
  for (uint32_t seed = 0; seed < 5; ++seed) add(seed);
  for (size_t i = 0; i < 5; ++i) EXPECT_TRUE(is_intact(i));
  const uint64_t file = store->statistics().file_bytes;
  for (uint32_t round = 1; round < 6; ++round) {
    const std::byte* old = places[1];
    store->remove(old);
    EXPECT_EQ(resident(old, kSize), 0u);
    const auto bytes = content(100 + round);
    places[1] = store->add(bytes.data(), bytes.size());
    seeds[1] = 100 + round;
    EXPECT_EQ(places[1], old);
    for (size_t i = 0; i < 5; ++i) EXPECT_TRUE(is_intact(i)) << round;
  }
  EXPECT_EQ(store->statistics().file_bytes, file);
  EXPECT_EQ(store->statistics().texture_bytes, 5 * kSize);
  EXPECT_LE(store->statistics().peak_bytes, kLimit);
}

TEST_F(TileStoreTest, RoomThatIsFreedInMemoryCountsAgain) {
  for (uint32_t seed : {1u, 2u}) add(seed);
  for (uint32_t seed = 3; seed < 9; ++seed) {
    store->remove(places[0]);
    const auto bytes = content(seed);
    places[0] = store->add(bytes.data(), bytes.size());
    seeds[0] = seed;
  }
  EXPECT_TRUE(is_intact(0) && is_intact(1));
  EXPECT_EQ(store->statistics().file_bytes, 0u);
}

TEST_F(TileStoreTest, TexturesAreTheSameInAStore) {
  std::vector<uint8_t> pixels(300 * 200 * 3);
  const auto bytes = content(7, pixels.size());
  std::memcpy(pixels.data(), bytes.data(), pixels.size());
  const TextureDesc desc{"t", pixels.data(), 300, 200, 3, TexelFormat::kU8, true};
  const std::shared_ptr<TileStore> shared = std::move(store);
  const Texture plain(desc);
  std::vector<std::unique_ptr<const Texture>> stored;
  for (int i = 0; i < 9; ++i) stored.push_back(std::make_unique<Texture>(desc, in_order, shared));
  EXPECT_GT(shared->statistics().file_bytes, 0u);
  for (const auto& texture : stored) {
    ASSERT_EQ(texture->bytes(), plain.bytes());
    EXPECT_EQ(std::memcmp(texture->view().texels, plain.view().texels, plain.bytes()), 0);
    EXPECT_EQ(std::memcmp(texture->mean(), plain.mean(), 4 * sizeof(float)), 0);
  }
  stored.clear();
  EXPECT_EQ(shared->statistics().texture_bytes, 0u);
}

TEST_F(TileStoreTest, ATextureThatIsExpectedFindsRoom) {
  add(1);
  store->expect(kSize, 0);
  EXPECT_EQ(store->statistics().file_bytes, 0u);
  store->set_waiting(kLimit - 2 * kSize - 100'000);
  store->expect(kSize, 0);
  EXPECT_EQ(store->statistics().file_bytes, 0u);
  // Decoded data and prefetched tiles count towards the memory limit as well.
  store->expect(kSize, 100'000);
  EXPECT_GT(store->statistics().file_bytes, 0u);
  EXPECT_EQ(all_resident(), 0u);
  EXPECT_TRUE(is_intact(0));
}

std::string message(const std::function<void()>& body) {
  try {
    body();
  } catch (const Error& e) {
    return e.what();
  }
  return "";
}

/// Makes UFFDIO_COPY fail with ENOMEM on this thread and on threads that it starts later.
bool take_memory_away() {
  sock_filter program[] = {
      BPF_STMT(BPF_LD | BPF_W | BPF_ABS, offsetof(seccomp_data, nr)),
      BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, SYS_ioctl, 0, 3),
      BPF_STMT(BPF_LD | BPF_W | BPF_ABS, offsetof(seccomp_data, args[1])),
      BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, static_cast<uint32_t>(UFFDIO_COPY), 0, 1),
      BPF_STMT(BPF_RET | BPF_K, SECCOMP_RET_ERRNO | ENOMEM),
      BPF_STMT(BPF_RET | BPF_K, SECCOMP_RET_ALLOW)};
  const sock_fprog filter{static_cast<unsigned short>(std::size(program)), program};
  return ::prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) == 0 &&
         ::prctl(PR_SET_SECCOMP, SECCOMP_MODE_FILTER, &filter) == 0;
}

TEST_F(TileStoreTest, NoMemoryForATileIsSaidAndReadersGoOn) {
  for (uint32_t seed : {1u, 2u}) add(seed);
  bool filters = false;
  std::string refused;
  std::thread([&] {
    filters = take_memory_away();
    // With storage in memory, the caller of `add` gets the error. After that, the store switches to
    // its file and starts threads.
    const auto small = content(3, 100'000);
    refused = message([&] { store->add(small.data(), small.size()); });
    add(4);
  }).join();
  if (!filters) GTEST_SKIP() << "the system has no seccomp";
  EXPECT_EQ(refused,
            "texture limit: no memory for textures (Cannot allocate memory); give a smaller limit");
  EXPECT_NO_THROW(store->check());
  // If the store's thread did not handle the error, the process would end or the readers would wait
  // forever.
  std::vector<std::thread> readers;
  std::atomic<int> sum = 0;
  for (size_t i = 0; i < 3; ++i)
    readers.emplace_back([&, i] { sum += std::to_integer<int>(places[i][kSize / 2]); });
  for (std::thread& reader : readers) reader.join();
  EXPECT_EQ(sum, 0);
  EXPECT_EQ(message([&] { store->check(); }), refused);
}

TEST_F(TileStoreTest, SaysWhatIsWrongWithALimitOrAFolder) {
  EXPECT_EQ(message([] { TileStore(999'999, "/tmp"); }),
            "texture limit 0.9 MB: give at least 1.0 MB");
  TileStore nowhere(kLimit, "/nowhere");
  const auto bytes = content(1, 3'000'000);
  const std::string m = message([&] { nowhere.add(bytes.data(), bytes.size()); });
  EXPECT_NE(m.find("/nowhere (No such file or directory); set TMPDIR"), std::string::npos) << m;
  // The store continues with textures that fit.
  const std::byte* small = nowhere.add(bytes.data(), 1000);
  EXPECT_EQ(std::memcmp(small, bytes.data(), 1000), 0);
}

}  // namespace
}  // namespace wavecomb
