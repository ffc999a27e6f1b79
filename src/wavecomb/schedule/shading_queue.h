// SPDX-License-Identifier: Apache-2.0
/// The hits of a wave that wait for shading.
#pragma once

#include <array>
#include <cstring>
#include <span>
#include <vector>

#include "wavecomb/core/soa.h"

namespace wavecomb {

/// Hits in arrival order (which is the rays' order), with a logical order beside them: columns of
/// ids, which policies look at, and a row a record for the rest, which shading loads whole
/// (docs/decisions/path-rows.md). `sorted_indices` says in which order records are shaded;
/// `materialize()` moves them into it.
///
/// Contract: owned by one wave; `size` records are valid. The record's number in arrival order is
/// where shading notes what became of the path, so that no shading order shows in the ray order.
class ShadingQueue {
 public:
  enum Column : uint32_t {
    kMaterial,
    kProgram,
    kPositionKey,  ///< Morton code of the hit; where a policy asks
    kColumns
  };
  ShadingQueue() = default;
  /// `row_words`: of a record's row, whatever those words mean.
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
  uint32_t* sorted_indices = nullptr;  ///< a permutation of 0 .. size-1 while `ordered` or `moved`
  bool ordered = false;                ///< false: shaded as records stand
  bool moved = false;  ///< record i stands where it is shaded; it arrived as sorted_indices[i]

  /// By arrival, whatever the order: the path's slot, and what shading made of it (Outcome).
  uint32_t *slot = nullptr, *outcome = nullptr;
  enum Outcome : uint32_t { kAlive = 1, kShadowRay = 2 };
  /// Above those, direction keys of the next ray and of the shadow ray.
  static constexpr uint32_t kRayKeyShift = 8, kShadowKeyShift = 16;

  uint32_t* uints(Column c) const { return block_.uints(c); }
  /// The row of record `i`, and behind it those that follow.
  float* row(size_t i) const { return rows_.floats(0) + i * row_words_; }

  /// Makes the physical order the logical one: afterwards records stand as they are shaded.
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
