// SPDX-License-Identifier: Apache-2.0
/// Number of samples of each pixel, from a pilot render of all pixels.
///
/// If a pixel with standard deviation s, mean I and cost c per sample gets n of all N samples, it
/// adds (s / I)^2 / n to the relative error of the image and n c to its render time. For a given N,
/// the error is least if n is proportional to s / I (Neyman, JRSS 97(4), 1934); the product of
/// error and render time is least if n is proportional to (s / I) / sqrt(c).
///
/// I includes light splats, although more samples of a pixel do not reduce the noise of its light
/// splats.
///
/// The sample count of a pixel must not depend on the samples of the pixel, because the mean of the
/// pixel would then be biased. Therefore s / I and c are means over the surrounding pixels, without
/// the pixel itself. A pixel then influences its sample count only through the common scale of all
/// weights, since it affects the weights of its 24 neighbours.
#pragma once

#include <span>

#include "wavecomb/core/settings.h"
#include "wavecomb/film/film.h"
#include "wavecomb/render/passes/pass_plan.h"

namespace wavecomb {

/// Half width in pixels of the window over which s / I and c are averaged.
inline constexpr uint32_t kAllocationWindow = 2;
/// Limits of the weight of a pixel, relative to the mean weight. The limits ensure that a pixel
/// that was dark by chance does not get too few samples, and that a firefly does not get most of
/// the samples.
inline constexpr double kMinWeight = 0.125, kMaxWeight = 8;

/// Returns the samples per pixel of the pilot render. If the result is 0, all pixels get the same
/// number of samples, because the settings ask for this or because the render has too few samples.
uint32_t pilot_samples(const Settings& settings);

/// Statistics of an allotment.
struct AllocationStatistics {
  /// Samples per pixel of the pilot render; 0 if all pixels get the same number.
  uint32_t pilot = 0;
  uint32_t least = 0, most = 0;  ///< smallest and largest number of samples of a pixel at the end
  /// Predicted efficiency, relative to equal samples for all pixels; 0 if unknown.
  double gain = 0;
};

/// Distributes samples so that the mean per pixel is exactly settings.spp and every pixel has at
/// least the samples of the pilot. `film` holds the pilot's samples with error sums, and with costs
/// for Allocate::kEfficiency. Writes statistics to `facts`.
SampleAllocation allocate_samples(Film& film, const Settings& settings,
                                  AllocationStatistics& facts);

}  // namespace wavecomb
