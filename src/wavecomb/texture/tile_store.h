// SPDX-License-Identifier: Apache-2.0
/// Keeps textures within a limit of memory, beside grids of volumes, and the rest of them in a
/// file.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "wavecomb/texture/tile_file.h"
#include "wavecomb/texture/tile_queue.h"
#include "wavecomb/texture/user_faults.h"

namespace wavecomb {

/// What a store holds and did.
struct StoreStatistics {
  uint64_t limit_bytes = 0;
  uint64_t texture_bytes = 0;   ///< of all textures that are there
  uint64_t file_bytes = 0;      ///< of the temporary file; 0: all fits in memory
  uint64_t resident_bytes = 0;  ///< memory in use, with that of the store itself
  uint64_t peak_bytes = 0;      ///< the most that resident_bytes ever was
  uint64_t grid_bytes = 0;      ///< of grids of volumes, which leave less for textures
  uint64_t loads = 0;           ///< tiles read back from the file
  uint64_t releases = 0;        ///< tiles that made way for others
  double load_s = 0;            ///< seconds that reading back took, summed over threads
};

/// Memory of textures, of which at most `limit_bytes` are there at a time, with grids of volumes.
/// Grids are in memory as a whole: what they take is taken from the textures, down to a few tiles.
///
/// Readers use plain pointers. While all textures fit they lie in memory. The first one that does
/// not fit makes the store write all to a temporary file; from then on a tile of kTileBytes comes
/// into memory when it is read, and another one goes. Threads of the store do that while the reader
/// waits in the kernel, so that readers see nothing of it but time.
///
/// Contract: any thread may call any function at any time. Who removes sees to it that nobody reads
/// any more. Only user code may read textures: the kernel cannot, so they are passed to no system
/// call.
class TileStore {
 public:
  /// What moves between memory and the file: 64 of the squares that a TextureView is made of, where
  /// texels are four values of 8 bits.
  static constexpr size_t kTileBytes = 16384;
  /// The least limit: some tiles for each reader.
  static constexpr uint64_t kLeastBytes = 1'000'000;

  /// `folder`: for the temporary file, which may take as much as all textures. Throws Error for a
  /// limit below kLeastBytes, and where the system cannot do it (UserFaults::obstacle).
  TileStore(uint64_t limit_bytes, std::string folder);
  ~TileStore();
  TileStore(const TileStore&) = delete;
  TileStore& operator=(const TileStore&) = delete;

  /// Says that `bytes` of images that textures will be made of lie ready outside of the store.
  void set_waiting(uint64_t bytes);
  /// Says that a texture is being made: from here on `bytes` and `scratch_bytes` beside them are
  /// used outside of the store, and count with what waits. Throws Error where all must go to the
  /// file and cannot.
  void expect(uint64_t bytes, uint64_t scratch_bytes);
  /// Keeps a copy; it stays where it is until it is removed. Throws Error where there is no room.
  const std::byte* add(const std::byte* data, size_t bytes);
  /// Frees what `add` gave.
  void remove(const std::byte* at);

  /// Says that a grid of `bytes` is in memory, which makes way for it; each `drop_grid` undoes one
  /// call, the last one for all. Throws Error as `expect`.
  void keep_grid(const void* grid, size_t bytes);
  void drop_grid(const void* grid);

  uint64_t limit_bytes() const { return limit_bytes_; }
  StoreStatistics statistics() const;
  /// Throws Error where a tile could not be read back, or there was no memory for it: what was read
  /// there since is black.
  void check() const;

 private:
  struct Chunk {
    const std::byte* base;
    uint32_t first, count;  ///< tiles
  };
  struct Range {
    uint32_t count;  ///< tiles
    size_t bytes;
  };

  // All with the lock held.
  uint32_t allocate(uint32_t count);
  void free(uint32_t first, uint32_t count);
  const std::byte* address(uint32_t tile) const;
  uint32_t tile_at(const std::byte* at) const;
  uint64_t resident_bytes() const;
  /// Throws as `spill` where textures, grids and `more` bytes are above the limit in memory.
  void spill_before(uint64_t more);
  size_t room() const;
  void make_room();
  void spill();
  void start_keepers();
  void put(const std::byte* at, const std::byte* from, size_t bytes);

  // On threads of the store, where nobody would catch what is thrown.
  void keep(std::byte* buffer) noexcept;
  void serve(const std::byte* at, std::byte* buffer);

  const uint64_t limit_bytes_;
  const size_t tile_bytes_;
  const std::string folder_;
  UserFaults faults_;
  mutable std::mutex mutex_;
  std::unique_ptr<TileFile> file_;             ///< there once not all fits
  std::vector<Chunk> chunks_;                  ///< by first tile
  std::map<const std::byte*, size_t> places_;  ///< index into chunks_ by base
  std::map<uint32_t, Range> ranges_;           ///< in use, by first tile
  std::map<uint32_t, uint32_t> free_;          ///< first tile and count
  TileQueue queue_;
  uint64_t held_bytes_ = 0;  ///< in memory, while there is no file
  uint64_t waiting_bytes_ = 0;
  struct Grid {
    size_t bytes;
    uint32_t uses;
  };
  std::map<const void*, Grid> grids_;
  StoreStatistics counts_;
  uint64_t load_ns_ = 0;
  /// Of the first tile that could not be had.
  enum class Failure : uint8_t { kNone, kFile, kMemory };
  std::atomic<Failure> failure_{Failure::kNone};
  int reason_ = 0;                  ///< of kMemory: the number of the system's error
  std::vector<std::byte> buffers_;  ///< a tile for each keeper
  std::vector<std::thread> keepers_;
};

}  // namespace wavecomb
