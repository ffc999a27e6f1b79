// SPDX-License-Identifier: Apache-2.0
/// Training samples from light paths, for aiming later light paths
/// (light_paths/aiming/aim_targets.h).
#pragma once

#include <vector>

#include "wavecomb/core/vec.h"
#include "wavecomb/light_paths/aiming/aim_targets.h"

namespace wavecomb {

/// Training samples, one for each light path, indexed by light path number.
///
/// Contract: only the wave that traces a light path writes the path's row, and no two waves trace
/// the same path.
class AimSamples {
 public:
  explicit AimSamples(size_t paths) : rows_(paths) {}

  /// Stores the first hit `point` of light path `path`.
  void begin(uint32_t path, const Vec3<float>& point) {
    rows_[path] = {point.x, point.y, point.z, 0.f};
  }
  /// Adds the unoccluded contribution of the vertex at `depth` of path `path` to the image, summed
  /// over all pixels.
  void add(uint32_t path, uint32_t depth, const Vec3<float>& light) {
    if (depth > 0) rows_[path].contribution += luminance(light);
  }
  const std::vector<AimSample>& rows() const { return rows_; }

 private:
  std::vector<AimSample> rows_;
};

}  // namespace wavecomb
