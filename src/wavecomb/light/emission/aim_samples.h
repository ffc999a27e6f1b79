// SPDX-License-Identifier: Apache-2.0
/// Training samples from light paths, for aiming later light paths (light/emission/aim_targets.h).
#pragma once

#include <vector>

#include "wavecomb/core/vec.h"
#include "wavecomb/light/emission/aim_targets.h"

namespace wavecomb {

/// Training samples, one for each light path, by light path number.
///
/// Contract: only the wave that traces a path writes its row, and no two waves trace the same path.
class AimLessons {
 public:
  explicit AimLessons(size_t paths) : rows_(paths) {}

  /// Records the first hit `place` of path `path`.
  void begin(uint32_t path, const Vec3<float>& place) {
    rows_[path] = {place.x, place.y, place.z, 0.f};
  }
  /// Adds the unblocked contribution of the path's vertex at `depth`, summed over all pixels.
  void bring(uint32_t path, uint32_t depth, const Vec3<float>& light) {
    if (depth > 0) rows_[path].worth += luminance(light);
  }
  const std::vector<AimLesson>& rows() const { return rows_; }

 private:
  std::vector<AimLesson> rows_;
};

}  // namespace wavecomb
