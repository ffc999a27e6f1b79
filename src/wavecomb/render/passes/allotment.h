// SPDX-License-Identifier: Apache-2.0
/// Number of samples of each pixel, from a pilot render of all pixels.
///
/// A pixel with standard deviation s, mean I and cost c per sample that gets n of all N samples
/// adds (s / I)^2 / n to the relative error of the image and n c to its render time. For a given N,
/// the error is least if n is proportional to s / I (Neyman, JRSS 97(4), 1934); error times time is
/// least if n is proportional to (s / I) / sqrt(c).
///
/// I includes light splats, although the samples of a pixel do not change their noise.
///
/// A pixel's count must not depend on its own samples, or its mean is biased. Therefore s / I and c
/// are means over the surrounding pixels without the pixel itself. A pixel then influences its
/// count only through the common scale of all weights, to which it contributes through its 24
/// neighbours.
#pragma once

#include <span>

#include "wavecomb/core/settings.h"
#include "wavecomb/film/film.h"
#include "wavecomb/render/passes/pass_plan.h"

namespace wavecomb {

/// Half width in pixels of the window over which s / I and c are averaged.
inline constexpr uint32_t kAllocationWindow = 2;
/// Limits of a pixel's weight, relative to the mean weight. These limits keep a pixel that was dark
/// by chance from getting too few samples, and a firefly from taking all of them.
inline constexpr double kMinWeight = 0.125, kMaxWeight = 8;

/// Returns the samples per pixel of the pilot. 0 means that all pixels get the same number, because
/// the settings ask for it or because there are too few samples.
uint32_t pilot_samples(const Settings& settings);

/// Statistics of an allotment.
struct AllocationStatistics {
  uint32_t pilot = 0;            ///< samples per pixel of the pilot; 0 if pixels are sampled evenly
  uint32_t least = 0, most = 0;  ///< samples of a pixel at the end
  double gain = 0;               ///< predicted efficiency over even sampling; 0 if unknown
};

/// Distributes samples so that the mean per pixel is exactly settings.spp and every pixel has at
/// least the samples of the pilot. `film` holds the pilot's samples with error sums, and with costs
/// for Allocate::kEfficiency. Writes statistics to `facts`.
SampleAllocation allocate_samples(Film& film, const Settings& settings,
                                  AllocationStatistics& facts);

}  // namespace wavecomb
