// SPDX-License-Identifier: Apache-2.0
/// Queue of a wave's hits that await shading.
#pragma once

#include <array>
#include <cstring>
#include <span>
#include <vector>

#include "wavecomb/core/rows/soa.h"

namespace wavecomb {

/// Queue of hits, stored in arrival order (the order of their rays), with a separate shading order.
/// The ids of a hit are stored in columns, which scheduling policies read. All other data of a hit
/// is a contiguous row, which shading loads at once (docs/decisions/path-rows.md). `sorted_indices`
/// is the shading order; `materialize()` moves the records into that order.
///
/// Contract: owned by one wave; `size` records are valid. Shading stores the result of each record
/// at its arrival index, so that the shading order does not affect the order of the next rays.
class ShadingQueue {
 public:
  enum Column : uint32_t {
    kMaterial,
    kProgram,
    kPositionKey,  ///< Morton code of the hit; only if the policy requests it
    kColumns
  };
  ShadingQueue() = default;
  /// `row_words` is the number of 32-bit words in the row of a record.
  ShadingQueue(size_t capacity, size_t row_words)
      : block_(kColumns, capacity),
        moved_(kColumns, capacity),
        rows_(1, capacity * row_words),
        moved_rows_(1, capacity * row_words),
        row_words_(row_words),
        arrival_(3, capacity) {
    sorted_indices = arrival_.uints(0);
    slot = arrival_.uints(1);
    outcome = arrival_.uints(2);
  }

  size_t size = 0;
  uint32_t* sorted_indices = nullptr;  ///< a permutation of 0 .. size-1 if `ordered` or `moved`
  bool ordered = false;                ///< whether sorted_indices gives the shading order of the
                                       ///< records
  /// Whether records are in shading order; the arrival index of record i is then sorted_indices[i].
  bool moved = false;

  /// Path slot and shading outcome, always in arrival order.
  uint32_t *slot = nullptr, *outcome = nullptr;
  enum Outcome : uint32_t { kAlive = 1, kShadowRay = 2 };
  /// Bit offsets in `outcome` of the direction keys of the next ray and of the shadow ray.
  static constexpr uint32_t kRayKeyShift = 8, kShadowKeyShift = 16;

  uint32_t* uints(Column c) const { return block_.uints(c); }
  /// Returns the row of record `i`. The rows of later records follow in memory.
  float* row(size_t i) const { return rows_.floats(0) + i * row_words_; }

  /// Moves all records into shading order.
  void materialize();
  size_t bytes() const {
    return block_.bytes() + moved_.bytes() + rows_.bytes() + moved_rows_.bytes() + arrival_.bytes();
  }
  /// Empties the queue for the next depth.
  void clear();

 private:
  SoaBlock block_, moved_, rows_, moved_rows_;
  size_t row_words_ = 0;
  SoaBlock arrival_;
};

}  // namespace wavecomb
