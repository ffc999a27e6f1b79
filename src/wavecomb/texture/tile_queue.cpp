// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/texture/tile_queue.h"

namespace wavecomb {

void TileQueue::append(uint32_t tile, State state) {
  Queue& q = queue(state);
  Tile& t = tiles_[tile];
  t.state = state;
  t.older = q.newest;
  t.newer = kNone;
  (q.newest == kNone ? q.oldest : tiles_[q.newest].newer) = tile;
  q.newest = tile;
  ++q.size;
}

void TileQueue::unlink(uint32_t tile) {
  Tile& t = tiles_[tile];
  Queue& q = queue(t.state);
  (t.older == kNone ? q.oldest : tiles_[t.older].newer) = t.newer;
  (t.newer == kNone ? q.newest : tiles_[t.newer].older) = t.older;
  --q.size;
  t.state = State::kAbsent;
}

void TileQueue::begin(uint32_t tile) {
  tiles_[tile].state = State::kLoading;
  ++loading_;
}

void TileQueue::end(uint32_t tile, size_t tile_limit) {
  --loading_;
  const uint32_t left = tiles_[tile].left_at;
  const bool soon = left != 0 && releases_ - left < tile_limit;
  append(tile, soon ? State::kSecond : State::kFirst);
  if (queues_[1].size * 8 > tile_limit * kSecondEighths) {
    const uint32_t oldest = queues_[1].oldest;
    unlink(oldest);
    append(oldest, State::kFirst);
  }
}

void TileQueue::drop(uint32_t tile) {
  if (state(tile) == State::kFirst || state(tile) == State::kSecond) unlink(tile);
  tiles_[tile].left_at = 0;
}

bool TileQueue::release(uint32_t& tile) {
  tile = queues_[0].size > 0 ? queues_[0].oldest : queues_[1].oldest;
  if (tile == kNone) return false;
  unlink(tile);
  if (++releases_ == 0) releases_ = 1;
  tiles_[tile].left_at = releases_;
  return true;
}

}  // namespace wavecomb
