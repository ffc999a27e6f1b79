// SPDX-License-Identifier: Apache-2.0
/// Training sample of the guiding field.
#pragma once

#include <cstdint>

namespace wavecomb {

/// A training bounce that contributes light.
struct TrainingRecord {
  float p[3];   ///< position of the vertex
  float wi[3];  ///< sampled direction
  /// One over the distance to the next hit; 0 without a hit, negative if unknown.
  float inverse_distance;
  uint32_t material;
  uint8_t axis;  ///< guiding_axis() of the surface normal
  /// Radiance that the path received along wi, times f |cos| / pdf. This is a one-sample estimate
  /// of the integral of f L |cos| over directions, where L is the incident radiance.
  float value;
  float pdf;          ///< density with which wi was sampled
  float bsdf_pdf;     ///< density of wi under the BSDF alone
  float guiding_pdf;  ///< density of wi under the guiding field in use; 0 if there was no field
  float weight;       ///< throughput of the path divided by the image brightness
};

}  // namespace wavecomb
