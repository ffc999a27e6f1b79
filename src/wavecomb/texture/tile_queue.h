// SPDX-License-Identifier: Apache-2.0
/// Replacement policy for texture tiles in memory.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace wavecomb {

/// Order in which resident tiles are evicted, kept as two queues of tiles. Only cache misses change
/// the order, because reads of resident tiles cannot be observed. The second queue is for
/// frequently read tiles. A loaded tile enters the second queue if, since its last eviction, fewer
/// tiles were evicted than fit in memory. Tiles of the first queue are evicted first. The policy
/// follows 2Q (Johnson and Shasha, VLDB 1994) and the refault distance of the Linux kernel.
class TileQueue {
 public:
  enum class State : uint8_t { kAbsent, kLoading, kFirst, kSecond };

  /// Extends the set of tiles to `count` tiles; new tiles are absent.
  void resize(size_t count) { tiles_.resize(count); }
  size_t size() const { return tiles_.size(); }
  size_t bytes() const { return tiles_.capacity() * sizeof(Tile); }
  State state(uint32_t tile) const { return tiles_[tile].state; }
  /// Returns the number of tiles that are loading or resident.
  size_t resident() const { return loading_ + queues_[0].size + queues_[1].size; }

  /// Marks an absent tile as loading.
  void begin(uint32_t tile);
  /// Marks a loading tile as resident. `tile_limit` is the number of tiles that fit in memory.
  void end(uint32_t tile, size_t tile_limit);
  /// Forgets a tile whose contents will be replaced.
  void drop(uint32_t tile);
  /// Removes the next tile to evict and writes it to `tile`; returns false if no tile is resident.
  bool release(uint32_t& tile);

 private:
  static constexpr uint32_t kNone = 0xffffffffu;
  /// Maximum size of the second queue, in eighths of `tile_limit`.
  static constexpr size_t kSecondEighths = 6;
  struct Tile {
    uint32_t older = kNone, newer = kNone;
    uint32_t left_at = 0;  ///< value of releases_ when the tile was last evicted; 0 if never
    State state = State::kAbsent;
  };
  struct Queue {
    uint32_t oldest = kNone, newest = kNone;
    size_t size = 0;
  };

  Queue& queue(State state) { return queues_[state == State::kSecond ? 1 : 0]; }
  void append(uint32_t tile, State state);
  void unlink(uint32_t tile);

  std::vector<Tile> tiles_;
  Queue queues_[2];
  size_t loading_ = 0;
  uint32_t releases_ = 0;
};

}  // namespace wavecomb
