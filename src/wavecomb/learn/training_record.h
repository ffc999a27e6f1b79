// SPDX-License-Identifier: Apache-2.0
/// What a bounce teaches.
#pragma once

#include <cstdint>

namespace wavecomb {

/// A bounce that brought light.
struct TrainingRecord {
  float p[3];      ///< the vertex
  float wi[3];     ///< the direction
  float nearness;  ///< one over the distance of what it met; 0: nothing; below 0: not known
  uint32_t material;
  uint8_t axis;  ///< which way its surface faces: guide_axis
  /// What came back along it over the throughput that the path arrived with: an estimate of the
  /// integral of f Le |cos| over directions, by one of them.
  float value;
  float pdf;        ///< of the direction, as it was sampled
  float bsdf_pdf;   ///< by the BSDF alone
  float guide_pdf;  ///< by the field then in use; 0: there was none
  float weight;     ///< throughput at arrival over the brightness of the picture there
};

}  // namespace wavecomb
