// SPDX-License-Identifier: Apache-2.0
/// Storage of textures within a memory limit that textures share with volume grids. Textures that
/// do not fit are stored in a temporary file.
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

/// Statistics of a TileStore.
struct StoreStatistics {
  /// Memory limit.
  uint64_t limit_bytes = 0;
  uint64_t texture_bytes = 0;   ///< size of all stored textures
  uint64_t file_bytes = 0;      ///< size of the temporary file; 0 if everything fits in memory
  uint64_t resident_bytes = 0;  ///< memory in use, including the store's own tables
  uint64_t peak_bytes = 0;      ///< maximum of resident_bytes
  uint64_t grid_bytes = 0;      ///< memory of volume grids; textures get less memory by this amount
  uint64_t loads = 0;           ///< number of tiles read back from the file
  uint64_t releases = 0;        ///< number of tiles evicted
  double load_s = 0;            ///< seconds spent reading back, summed over threads
};

/// Texture memory with at most `limit_bytes` resident bytes, including volume grids. Grids stay in
/// memory as a whole; their size reduces the room for textures, down to a few tiles.
///
/// Readers use plain pointers. While all textures fit, they stay in memory. When a texture does not
/// fit, the store writes all textures to a temporary file. From then on, reading an absent tile of
/// kTileBytes loads the tile, and evicts another tile if needed. Threads of the store load and
/// evict tiles while the reader waits in a page fault, so that readers notice only the delay.
///
/// Contract: all members may be called concurrently. A caller of remove() must ensure that no
/// thread reads the memory. Only user code may read textures: the operating system cannot resolve
/// page faults in its own code, so never pass texture memory to a system call.
class TileStore {
 public:
  /// Size of a store tile, the unit of transfer between memory and file. If texels have four 8-bit
  /// channels, a store tile holds 64 of the texel tiles of a TextureView.
  static constexpr size_t kTileBytes = 16384;
  /// Smallest memory limit, which leaves room for a few tiles of each reader.
  static constexpr uint64_t kMinBytes = 1'000'000;

  /// `folder` is the folder of the temporary file, which may grow to the size of all textures.
  /// Throws Error if the limit is below kMinBytes or the system lacks support
  /// (UserFaults::unsupported_reason).
  TileStore(uint64_t limit_bytes, std::string folder);
  ~TileStore();
  TileStore(const TileStore&) = delete;
  TileStore& operator=(const TileStore&) = delete;

  /// Sets the size of the images from which textures will be built. These images are in memory
  /// outside the store.
  void set_waiting(uint64_t bytes);
  /// Announces that a texture is being built, which uses `bytes` and `scratch_bytes` outside the
  /// store, in addition to set_waiting(). Throws Error if textures must move to the file but this
  /// fails.
  void expect(uint64_t bytes, uint64_t scratch_bytes);
  /// Stores a copy of `data` and returns its address, valid until remove(). Throws Error if there
  /// is no room.
  const std::byte* add(const std::byte* data, size_t bytes);
  /// Frees memory returned by add().
  void remove(const std::byte* at);

  /// Registers a grid of `bytes` bytes in memory and evicts textures to make room. Each
  /// unregister_grid() undoes one call; the last one unregisters the grid. Throws Error like
  /// expect().
  void register_grid(const void* grid, size_t bytes);
  void unregister_grid(const void* grid);

  uint64_t limit_bytes() const { return limit_bytes_; }
  StoreStatistics statistics() const;
  /// Throws Error if a tile could not be read from the file, or if there was no memory for a tile.
  /// Such tiles are black.
  void check() const;

 private:
  struct Chunk {
    const std::byte* base;
    uint32_t first, count;  ///< range of tiles
  };
  struct Range {
    uint32_t count;  ///< number of tiles
    size_t bytes;
  };

  // The functions below require that the caller holds the lock.
  uint32_t allocate(uint32_t count);
  void free(uint32_t first, uint32_t count);
  const std::byte* address(uint32_t tile) const;
  uint32_t tile_at(const std::byte* at) const;
  uint64_t resident_bytes() const;
  /// Calls spill() if textures, grids and `more` bytes would exceed the limit in memory.
  void spill_before(uint64_t more);
  /// Number of tiles that fit within the limit.
  size_t tile_limit() const;
  /// Evicts tiles until the resident tiles fit within the limit.
  void evict_tiles();
  /// Moves all textures to the temporary file. Throws Error on failure.
  void spill();
  void start_loaders();
  void put(const std::byte* at, const std::byte* from, size_t bytes);

  // The functions below run on threads of the store and must not throw, because nothing would catch
  // the exception.
  /// Serves page faults until stopped.
  void keep(std::byte* buffer) noexcept;
  /// Loads the tile of address `at` and wakes its readers.
  void serve(const std::byte* at, std::byte* buffer);

  const uint64_t limit_bytes_;
  const size_t tile_bytes_;
  const std::string folder_;
  UserFaults faults_;
  mutable std::mutex mutex_;
  std::unique_ptr<TileFile> file_;             ///< null while everything fits in memory
  std::vector<Chunk> chunks_;                  ///< stored textures, sorted by first tile
  std::map<const std::byte*, size_t> places_;  ///< index into chunks_ by base address
  std::map<uint32_t, Range> ranges_;           ///< tile ranges in use, by first tile
  std::map<uint32_t, uint32_t> free_;          ///< free tile ranges: first tile and count
  TileQueue queue_;
  uint64_t held_bytes_ = 0;  ///< size of textures in memory while there is no file
  uint64_t waiting_bytes_ = 0;
  struct Grid {
    size_t bytes;
    uint32_t uses;
  };
  std::map<const void*, Grid> grids_;
  StoreStatistics counts_;
  uint64_t load_ns_ = 0;
  /// Cause of the first failure to load a tile.
  enum class Failure : uint8_t { kNone, kFile, kMemory };
  std::atomic<Failure> failure_{Failure::kNone};
  int reason_ = 0;                  ///< errno of a failed allocation
  std::vector<std::byte> buffers_;  ///< buffer of one tile per keeper thread
  std::vector<std::thread> loaders_;
};

}  // namespace wavecomb
