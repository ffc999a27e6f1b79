// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

namespace wavecomb {

/// Statistics of a guiding field.
struct GuidingFieldStatistics {
  uint64_t records = 0;  ///< number of training bounces that contribute light
  uint32_t cells = 0, regions = 0, guided_regions = 0;
  /// Mean probability that the field samples a bounce, and ratio of the second moment of the
  /// mixture to the second moment without guiding. Both values are weighted by the contribution of
  /// bounces to the image.
  double guided_share = 0, moment_ratio = 1;
};

}  // namespace wavecomb
