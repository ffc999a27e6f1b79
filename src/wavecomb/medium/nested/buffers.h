// SPDX-License-Identifier: Apache-2.0
/// Buffers for rays that pass through several nested dielectrics (medium/nested/nested_media.h).
#pragma once

#include <cstddef>

#include "wavecomb/core/rows/soa.h"

namespace wavecomb {

/// Buffers of a worker; empty if the scene has no nested dielectrics.
struct NestedMediaBuffers {
  static constexpr size_t kWords = 32;    ///< row size of a ray, in 32-bit words
  static constexpr size_t kColumns = 16;  ///< number of columns of traced rays

  explicit NestedMediaBuffers(size_t capacity)
      : rows(capacity ? SoaBlock(1, capacity * kWords) : SoaBlock()),
        columns(capacity ? SoaBlock(kColumns, capacity) : SoaBlock()) {}
  size_t bytes() const { return rows.bytes() + columns.bytes(); }

  SoaBlock rows, columns;
};

}  // namespace wavecomb
