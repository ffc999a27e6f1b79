// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/light_paths/merge_grid.h"

#include <algorithm>
#include <atomic>
#include <bit>
#include <cmath>
#include <numeric>

#include "wavecomb/core/encoding/hash.h"
#include "wavecomb/scene/parallel.h"

namespace wavecomb {
namespace {

/// Range of the binary exponents of merge radii. The cells for radii with exponent e have the size
/// 2^(e + kCellExponent), so the sphere of a point overlaps at most two cells along each axis.
constexpr int kMinExponent = -60, kMaxExponent = 60, kCellExponent = 2;
constexpr size_t kChunk = 8192;

int exponent_of(float radius) {
  return std::clamp(std::ilogb(radius), kMinExponent, kMaxExponent);
}

int32_t cell_of(float x, float inverse_size) {
  // All coordinates beyond this limit are in the same cell.
  constexpr float kMax = 1e9f;
  return static_cast<int32_t>(std::floor(std::clamp(x * inverse_size, -kMax, kMax)));
}

float inverse_size(int exponent) {
  return std::ldexp(1.f, -exponent - kCellExponent);
}

bool is_point(const float* row) {
  return row[3] > 0 && std::isfinite(row[3]) && std::isfinite(row[0] + row[1] + row[2]);
}

}  // namespace

uint32_t MergeGrid::bucket(int exponent, const int32_t (&cell)[3]) const {
  uint32_t hash = hash_u32<uint32_t>(static_cast<uint32_t>(exponent), 0x51ed270bu);
  for (const int32_t i : cell) hash = hash_u32<uint32_t>(hash, static_cast<uint32_t>(i));
  return hash & static_cast<uint32_t>(starts_.size() - 2);
}

void MergeGrid::build(std::span<const float> points) {
  points_ = points.data();
  const size_t count = points.size() / kMergePointWords;
  const size_t chunks = (count + kChunk - 1) / kChunk;
  // Calls use(point, bucket) once for each hash bucket that a point belongs to.
  const auto for_each = [&](const auto& use) {
    parallel_for(chunks, [&](size_t chunk) {
      for (size_t i = chunk * kChunk; i < std::min(count, (chunk + 1) * kChunk); ++i) {
        const float* row = points_ + i * kMergePointWords;
        if (!is_point(row)) continue;
        const int exponent = exponent_of(row[3]);
        const float inverse = inverse_size(exponent);
        int32_t lo[3], hi[3];
        for (int a = 0; a < 3; ++a) {
          lo[a] = cell_of(row[a] - row[3], inverse);
          hi[a] = cell_of(row[a] + row[3], inverse);
        }
        uint32_t cells[8];
        size_t n = 0;
        for (int corner = 0; corner < 8; ++corner) {
          const auto along = [&](int a) { return corner >> a & 1 ? hi[a] : lo[a]; };
          const uint32_t b = bucket(exponent, {along(0), along(1), along(2)});
          if (std::find(cells, cells + n, b) == cells + n) cells[n++] = b;
        }
        for (size_t m = 0; m < n; ++m) use(static_cast<uint32_t>(i), cells[m]);
      }
    });
  };
  std::vector<uint8_t> has(kMaxExponent - kMinExponent + 1);
  size_t point_count = 0;
  for (size_t i = 0; i < count; ++i)
    if (const float* row = points_ + i * kMergePointWords; is_point(row)) {
      has[static_cast<size_t>(exponent_of(row[3]) - kMinExponent)] = 1;
      ++point_count;
    }
  levels_.clear();
  for (size_t e = 0; e < has.size(); ++e)
    if (has[e] != 0) levels_.push_back(static_cast<int>(e) + kMinExponent);
  // The number of hash buckets is a power of two. The last entry of starts_ is the end of the last
  // bucket.
  starts_.assign(std::bit_ceil(std::max<size_t>(64, 2 * point_count)) + 1, 0);
  const auto counter = [&](uint32_t b) { return std::atomic_ref(starts_[b]); };
  for_each([&](uint32_t, uint32_t b) { counter(b).fetch_add(1, std::memory_order_relaxed); });
  std::inclusive_scan(starts_.begin(), starts_.end(), starts_.begin());
  entries_.resize(starts_.back());
  // Fill each hash bucket from its end to its start. The order within a bucket does not matter.
  for_each([&](uint32_t point, uint32_t b) {
    entries_[counter(b).fetch_sub(1, std::memory_order_relaxed) - 1] = point;
  });
}

bool MergeGrid::Search::next(uint32_t& pixel) {
  for (;;) {
    while (begin_ < end_) {
      pixel = grid_->entries_[begin_++];
      const float* row = grid_->points_ + size_t{pixel} * kMergePointWords;
      const float dx = at_[0] - row[0], dy = at_[1] - row[1], dz = at_[2] - row[2];
      // A hash bucket may also hold points of other cells and of other radius levels.
      if (dx * dx + dy * dy + dz * dz < row[3] * row[3] &&
          exponent_of(row[3]) == grid_->levels_[level_ - 1])
        return true;
    }
    if (!grid_ || level_ == grid_->levels_.size()) return false;
    const int exponent = grid_->levels_[level_++];
    const float inverse = inverse_size(exponent);
    const uint32_t b = grid_->bucket(
        exponent, {cell_of(at_[0], inverse), cell_of(at_[1], inverse), cell_of(at_[2], inverse)});
    begin_ = grid_->starts_[b];
    end_ = grid_->starts_[b + 1];
  }
}

}  // namespace wavecomb
