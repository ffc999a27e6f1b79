// SPDX-License-Identifier: Apache-2.0
/// Buffers for rays that pass through several nested dielectrics (medium/nested/nested_media.h).
#pragma once

#include <cstddef>

#include "wavecomb/core/rows/soa.h"

namespace wavecomb {

/// Buffers of a worker; empty if the scene has no nested dielectrics.
struct InteriorBuffers {
  static constexpr size_t kWords = 32;    ///< 32-bit words per ray
  static constexpr size_t kColumns = 16;  ///< 32-bit words per traced ray

  explicit InteriorBuffers(size_t capacity)
      : rows(capacity ? SoaBlock(1, capacity * kWords) : SoaBlock()),
        columns(capacity ? SoaBlock(kColumns, capacity) : SoaBlock()) {}
  size_t bytes() const { return rows.bytes() + columns.bytes(); }

  SoaBlock rows, columns;
};

}  // namespace wavecomb
