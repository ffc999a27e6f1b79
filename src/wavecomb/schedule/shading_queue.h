// SPDX-License-Identifier: Apache-2.0
/// The hits of a wave that wait for shading.
#pragma once

#include <array>
#include <cstring>
#include <span>
#include <vector>

#include "wavecomb/core/soa.h"

namespace wavecomb {

/// Hits as records, column by column, in arrival order (which is the rays' order), with a logical
/// order beside them. `sorted_indices` says in which order records are shaded; `materialize()`
/// moves the columns into it.
///
/// Contract: owned by one wave; `size` records are valid. The record's number in arrival order is
/// where shading puts the path's next ray, so that no shading order shows in the ray order.
class ShadingQueue {
 public:
  /// Columns of a record. Floats first.
  enum Column : uint32_t {
    kDx,
    kDy,
    kDz,  ///< direction of the ray that hit
    kThroughputR,
    kThroughputG,
    kThroughputB,
    kPdf,
    kEtaScale,
    kConeWidth,
    kConeSpread,  ///< cone at the hit
    kT,
    kU,
    kV,
    kSlot,
    kInst,
    kMesh,
    kGeom,
    kPrim,
    kMaterial,
    kProgram,
    kArrival,      ///< the record's number in arrival order
    kPositionKey,  ///< Morton code of the hit; where a policy asks
    kColumns
  };

  ShadingQueue() = default;
  explicit ShadingQueue(size_t capacity)
      : block_(kColumns, capacity), moved_(kColumns, capacity), order_(2, capacity) {
    sorted_indices = order_.uints(0);
    for (uint32_t c = 0; c < kColumns; ++c) columns_[c] = block_.uints(c);
  }

  size_t size = 0;
  uint32_t* sorted_indices = nullptr;  ///< a permutation of 0 .. size-1 while `ordered`
  bool ordered = false;  ///< false: shaded in arrival order, sorted_indices is not read

  uint32_t* uints(Column c) const { return columns_[c]; }
  float* floats(Column c) const { return reinterpret_cast<float*>(columns_[c]); }

  /// Makes the physical order the logical one: afterwards records stand as they are shaded.
  void materialize();
  size_t bytes() const { return block_.bytes() + moved_.bytes() + order_.bytes(); }
  /// Empties the queue for the next depth.
  void clear();

 private:
  SoaBlock block_, moved_, order_;
  std::array<uint32_t*, kColumns> columns_{};
};

}  // namespace wavecomb
