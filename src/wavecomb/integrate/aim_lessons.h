// SPDX-License-Identifier: Apache-2.0
/// What paths from lights teach of where to aim them (learn/aim_targets.h).
#pragma once

#include <vector>

#include "wavecomb/core/vec.h"
#include "wavecomb/learn/aim_targets.h"

namespace wavecomb {

/// Rows by the number of the path (light_path_number): one sample of each. Contract: a path's row
/// is written by who traces it; no two waves have the same path.
class AimLessons {
 public:
  explicit AimLessons(size_t paths) : rows_(paths) {}

  /// Path `path` met something first at `place`.
  void begin(uint32_t path, const Vec3<float>& place) {
    rows_[path] = {place.x, place.y, place.z, 0.f};
  }
  /// What its vertex `depth` brought, unblocked, for all pixels.
  void bring(uint32_t path, uint32_t depth, const Vec3<float>& light) {
    if (depth > 0) rows_[path].worth += luminance(light);
  }
  const std::vector<AimLesson>& rows() const { return rows_; }

 private:
  std::vector<AimLesson> rows_;
};

}  // namespace wavecomb
