// SPDX-License-Identifier: Apache-2.0
/// Which tiles are in memory, and which of them goes next.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace wavecomb {

/// Two queues of tiles. Nothing tells when a tile that is there is read, only when one is missed.
/// So one that is missed soon after it went (before as many others went as there is room for) is
/// taken for one that is read often, and goes to the second queue; the first one goes first. After
/// 2Q (Johnson and Shasha, VLDB 1994) and the kernel's refault distance.
class TileQueue {
 public:
  enum class State : uint8_t { kAbsent, kLoading, kFirst, kSecond };

  /// Makes room for tiles up to `count`, absent at first.
  void resize(size_t count) { tiles_.resize(count); }
  size_t size() const { return tiles_.size(); }
  size_t bytes() const { return tiles_.capacity() * sizeof(Tile); }
  State state(uint32_t tile) const { return tiles_[tile].state; }
  /// Tiles that are loading or there.
  size_t resident() const { return loading_ + queues_[0].size + queues_[1].size; }

  /// Says that an absent tile is being loaded.
  void begin(uint32_t tile);
  /// Says that it is there; `room`: for how many there is.
  void end(uint32_t tile, size_t room);
  /// Forgets a tile, of which there will be another content.
  void drop(uint32_t tile);
  /// Takes out the tile that goes next; false where none is there.
  bool release(uint32_t& tile);

 private:
  static constexpr uint32_t kNone = 0xffffffffu;
  /// The part of the room that the second queue may have, in eighths.
  static constexpr size_t kSecondEighths = 6;
  struct Tile {
    uint32_t older = kNone, newer = kNone;
    uint32_t left_at = 0;  ///< releases when it went; 0: it never did
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
