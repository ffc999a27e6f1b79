// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/texture/tile_store.h"

#include <signal.h>

#include <algorithm>
#include <chrono>
#include <cstring>
#include <system_error>
#include <utility>

#include "wavecomb/core/error.h"

namespace wavecomb {
namespace {

using Clock = std::chrono::steady_clock;

/// Tiles per chunk of address space, unless a texture needs more.
constexpr uint32_t kChunkTiles = 4096;
/// Number of reader threads that one keeper thread (a thread that loads tiles from the file)
/// serves.
constexpr unsigned kReadersPerLoader = 8;
constexpr unsigned kMaxLoaders = 8;

size_t round_up(size_t n, size_t unit) {
  return (n + unit - 1) / unit * unit;
}

std::string megabytes(uint64_t bytes) {
  std::string text = std::to_string(bytes / 100'000);
  if (text.size() < 2) text.insert(0, 1, '0');
  text.insert(text.size() - 1, ".");
  return text + " MB";
}

std::string no_memory(int reason) {
  return std::string("texture limit: no memory for textures (") + std::strerror(reason) +
         "); give a smaller limit";
}

uint64_t checked(uint64_t limit_bytes) {
  if (limit_bytes < TileStore::kMinBytes)
    throw Error("texture limit " + megabytes(limit_bytes) + ": give at least " +
                megabytes(TileStore::kMinBytes));
  return limit_bytes;
}

}  // namespace

TileStore::TileStore(uint64_t limit_bytes, std::string folder)
    : limit_bytes_(checked(limit_bytes)),
      tile_bytes_(round_up(kTileBytes, page_bytes())),
      folder_(std::move(folder)) {
  counts_.limit_bytes = limit_bytes_;
}

TileStore::~TileStore() {
  faults_.stop();
  for (std::thread& loader : loaders_) loader.join();
}

uint64_t TileStore::resident_bytes() const {
  return queue_.bytes() + (file_ ? queue_.resident() * tile_bytes_ : held_bytes_);
}

size_t TileStore::tile_limit() const {
  // Minimum number of tiles in memory, so that concurrent readers do not evict each other's tiles
  // endlessly.
  constexpr size_t kLeast = 32;
  const uint64_t own = std::min(queue_.bytes() + counts_.grid_bytes, limit_bytes_);
  return std::max<size_t>(kLeast, (limit_bytes_ - own) / tile_bytes_);
}

void TileStore::set_waiting(uint64_t bytes) {
  const std::lock_guard lock(mutex_);
  waiting_bytes_ = bytes;
}

void TileStore::expect(uint64_t bytes, uint64_t scratch_bytes) {
  const std::lock_guard lock(mutex_);
  const uint64_t outside = round_up(bytes, page_bytes()) + scratch_bytes + waiting_bytes_;
  spill_before(outside);
}

void TileStore::spill_before(uint64_t more) {
  if (!file_ && resident_bytes() + counts_.grid_bytes + more > limit_bytes_) spill();
}

void TileStore::register_grid(const void* grid, size_t bytes) {
  const std::lock_guard lock(mutex_);
  Grid& entry = grids_.insert({grid, Grid{bytes, 0}}).first->second;
  if (entry.uses++ > 0) return;
  counts_.grid_bytes += entry.bytes;
  if (!ranges_.empty()) spill_before(0);
  evict_tiles();
}

void TileStore::unregister_grid(const void* grid) {
  const std::lock_guard lock(mutex_);
  const auto entry = grids_.find(grid);
  if (entry == grids_.end() || --entry->second.uses > 0) return;
  counts_.grid_bytes -= entry->second.bytes;
  grids_.erase(entry);
}

const std::byte* TileStore::add(const std::byte* data, size_t bytes) {
  std::unique_lock lock(mutex_);
  const auto count = static_cast<uint32_t>(round_up(bytes, tile_bytes_) / tile_bytes_);
  const uint32_t first = allocate(count);
  const std::byte* at = address(first);
  try {
    const size_t pages = round_up(bytes, page_bytes());
    spill_before(pages);
    if (!file_) {
      const size_t whole = pages == bytes ? bytes : pages - page_bytes();
      if (whole > 0) put(at, data, whole);
      if (whole < bytes) {
        std::vector<std::byte> last(page_bytes());
        std::memcpy(last.data(), data + whole, bytes - whole);
        put(at + whole, last.data(), last.size());
      }
      held_bytes_ += pages;
    } else {
      // No thread reads the new range yet, so release the lock: readers need not wait for the disk.
      lock.unlock();
      file_->write(data, bytes, uint64_t{first} * tile_bytes_);
      std::vector<std::byte> rest(size_t{count} * tile_bytes_ - bytes);
      file_->write(rest.data(), rest.size(), uint64_t{first} * tile_bytes_ + bytes);
      lock.lock();
    }
  } catch (...) {
    if (!lock.owns_lock()) lock.lock();
    if (!file_) faults_.release(at, count * tile_bytes_);
    free(first, count);
    throw;
  }
  ranges_[first] = {count, bytes};
  counts_.texture_bytes += bytes;
  counts_.peak_bytes = std::max(counts_.peak_bytes, resident_bytes());
  return at;
}

void TileStore::remove(const std::byte* at) {
  const std::lock_guard lock(mutex_);
  const auto found = ranges_.find(tile_at(at));
  const auto [first, range] = *found;
  ranges_.erase(found);
  for (uint32_t i = 0; i < range.count; ++i) queue_.drop(first + i);
  faults_.release(at, range.count * tile_bytes_);
  if (file_)
    file_->discard(uint64_t{first} * tile_bytes_, range.count * uint64_t{tile_bytes_});
  else
    held_bytes_ -= round_up(range.bytes, page_bytes());
  counts_.texture_bytes -= range.bytes;
  free(first, range.count);
}

StoreStatistics TileStore::statistics() const {
  const std::lock_guard lock(mutex_);
  StoreStatistics s = counts_;
  s.file_bytes = file_ ? file_->bytes() : 0;
  s.resident_bytes = resident_bytes();
  s.load_s = 1e-9 * static_cast<double>(load_ns_);
  return s;
}

void TileStore::check() const {
  const Failure failure = failure_.load(std::memory_order_acquire);
  if (failure == Failure::kFile)
    throw Error("texture limit: textures cannot be read back from the file in " + folder_ +
                "; set TMPDIR to another folder");
  if (failure == Failure::kMemory) throw Error(no_memory(reason_));
}

// ---- address space ----

uint32_t TileStore::allocate(uint32_t count) {
  auto at = std::find_if(free_.begin(), free_.end(),
                         [&](const auto& range) { return range.second >= count; });
  if (at == free_.end()) {
    const auto first = static_cast<uint32_t>(queue_.size());
    const uint32_t size = std::max(count, kChunkTiles);
    const std::byte* base = faults_.map(size_t{size} * tile_bytes_);
    places_[base] = chunks_.size();
    chunks_.push_back({base, first, size});
    queue_.resize(first + size);
    if (file_) evict_tiles();
    at = free_.emplace(first, size).first;
  }
  const auto [first, size] = *at;
  free_.erase(at);
  if (size > count) free_.emplace(first + count, size - count);
  return first;
}

void TileStore::free(uint32_t first, uint32_t count) {
  // Merge the freed range with free neighbouring ranges, but not across chunks, which may not be
  // contiguous in memory.
  const auto joins = [&](uint32_t tile) {
    return std::none_of(chunks_.begin(), chunks_.end(),
                        [&](const Chunk& chunk) { return chunk.first == tile; });
  };
  auto next = free_.lower_bound(first);
  if (next != free_.end() && next->first == first + count && joins(next->first)) {
    count += next->second;
    next = free_.erase(next);
  }
  if (next != free_.begin()) {
    const auto before = std::prev(next);
    if (before->first + before->second == first && joins(first)) {
      before->second += count;
      return;
    }
  }
  free_.emplace(first, count);
}

const std::byte* TileStore::address(uint32_t tile) const {
  const auto after =
      std::upper_bound(chunks_.begin(), chunks_.end(), tile,
                       [](uint32_t t, const Chunk& chunk) { return t < chunk.first; });
  const Chunk& chunk = *std::prev(after);
  return chunk.base + size_t{tile - chunk.first} * tile_bytes_;
}

uint32_t TileStore::tile_at(const std::byte* at) const {
  const auto& [base, index] = *std::prev(places_.upper_bound(at));
  return chunks_[index].first + static_cast<uint32_t>(static_cast<size_t>(at - base) / tile_bytes_);
}

// ---- memory and file ----

void TileStore::spill() {
  auto file = std::make_unique<TileFile>(folder_);
  const std::vector<std::byte> nothing(tile_bytes_);
  for (const auto& [first, range] : ranges_) {
    const uint64_t offset = uint64_t{first} * tile_bytes_;
    const size_t bytes = round_up(range.bytes, page_bytes());
    file->write(address(first), bytes, offset);
    file->write(nothing.data(), range.count * tile_bytes_ - bytes, offset + bytes);
  }
  // Start the threads before memory is released, since only these threads can load tiles again.
  start_loaders();
  for (const auto& [first, range] : ranges_)
    faults_.release(address(first), range.count * tile_bytes_);
  held_bytes_ = 0;
  file_ = std::move(file);
}

void TileStore::start_loaders() {
  const unsigned readers = std::max(1u, std::thread::hardware_concurrency());
  const unsigned count = std::clamp(readers / kReadersPerLoader, 1u, kMaxLoaders);
  if (!loaders_.empty()) return;
  buffers_.resize(count * tile_bytes_);
  loaders_.reserve(count);
  // Block signals in the new threads, so that the existing threads handle all signals.
  sigset_t all, before;
  sigfillset(&all);
  pthread_sigmask(SIG_SETMASK, &all, &before);
  int reason = 0;
  try {
    for (unsigned i = 0; i < count; ++i)
      loaders_.emplace_back([this, buffer = &buffers_[i * tile_bytes_]] { keep(buffer); });
  } catch (const std::system_error& error) {
    reason = error.code().value();
  }
  pthread_sigmask(SIG_SETMASK, &before, nullptr);
  // Continue with fewer threads if not all could be started.
  if (loaders_.empty()) throw Error(no_memory(reason));
}

void TileStore::put(const std::byte* at, const std::byte* from, size_t bytes) {
  if (const int reason = faults_.fill(at, from, bytes)) throw Error(no_memory(reason));
}

void TileStore::evict_tiles() {
  uint32_t tile;
  while (queue_.resident() > tile_limit() && queue_.release(tile)) {
    // Keep the lock during the call, so that the recorded state of a tile always matches its
    // memory.
    faults_.release(address(tile), tile_bytes_);
    ++counts_.releases;
  }
}

void TileStore::keep(std::byte* buffer) noexcept {
  const std::byte* addresses[UserFaults::kMaxAddresses];
  while (const size_t count = faults_.wait(addresses))
    for (size_t i = 0; i < count; ++i) serve(addresses[i], buffer);
}

void TileStore::serve(const std::byte* at, std::byte* buffer) {
  const Clock::time_point start = Clock::now();
  std::unique_lock lock(mutex_);
  const uint32_t tile = tile_at(at);
  const std::byte* tile_address = address(tile);
  if (queue_.state(tile) == TileQueue::State::kLoading)
    return;  // The loading thread wakes the readers.
  if (queue_.state(tile) != TileQueue::State::kAbsent)
    return faults_.wake(tile_address, tile_bytes_);
  queue_.begin(tile);
  evict_tiles();
  counts_.peak_bytes = std::max(counts_.peak_bytes, resident_bytes());
  lock.unlock();
  // Resume the readers even if the tile could not be read; check() reports the failure to the
  // render later.
  Failure failure = Failure::kNone;
  if (!file_->read(buffer, tile_bytes_, uint64_t{tile} * tile_bytes_)) {
    std::fill_n(buffer, tile_bytes_, std::byte{0});
    failure = Failure::kFile;
  }
  const int reason = faults_.fill(tile_address, buffer, tile_bytes_);
  if (reason != 0) {
    faults_.abandon(tile_address, tile_bytes_);
    failure = Failure::kMemory;
  }
  lock.lock();
  queue_.end(tile, tile_limit());
  ++counts_.loads;
  if (failure != Failure::kNone && failure_.load(std::memory_order_relaxed) == Failure::kNone) {
    reason_ = reason;
    failure_.store(failure, std::memory_order_release);
  }
  load_ns_ += static_cast<uint64_t>(
      std::chrono::duration_cast<std::chrono::nanoseconds>(Clock::now() - start).count());
}

}  // namespace wavecomb
