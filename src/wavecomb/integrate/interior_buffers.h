// SPDX-License-Identifier: Apache-2.0
/// Room for rays that pass from one medium inside of meshes to the next (medium/interiors.h).
#pragma once

#include <cstddef>

#include "wavecomb/core/soa.h"

namespace wavecomb {

/// Empty where a scene has nothing of the kind.
struct InteriorBuffers {
  static constexpr size_t kWords = 32;    ///< of rows, for each ray
  static constexpr size_t kColumns = 16;  ///< of the rays that are traced at a time

  explicit InteriorBuffers(size_t capacity)
      : rows(capacity ? SoaBlock(1, capacity * kWords) : SoaBlock()),
        columns(capacity ? SoaBlock(kColumns, capacity) : SoaBlock()) {}
  size_t bytes() const { return rows.bytes() + columns.bytes(); }

  SoaBlock rows, columns;
};

}  // namespace wavecomb
