// SPDX-License-Identifier: Apache-2.0
/// How many samples of a render each pixel gets, by what a pilot of all pixels has shown.
///
/// A pixel with deviation s, mean I and cost c a sample, that has n of all N samples, adds
/// (s / I)^2 / n to the picture's relative error and n c to its time. For a given N the error is
/// least where n is proportional to s / I; error times time is least where it is proportional to
/// (s / I) / sqrt(c) (Neyman, JRSS 97(4), 1934, and with costs).
///
/// Light of splats counts for I: no pixel's samples change its noise.
///
/// A pixel's count must not depend on its own samples, or the mean of them is biased: s / I and c
/// are means over the pixels around it, without itself. What is left is the scale, to which a pixel
/// adds its share of 24 of all pixels.
#pragma once

#include <span>

#include "wavecomb/core/settings.h"
#include "wavecomb/film/film.h"
#include "wavecomb/render/pass_plan.h"

namespace wavecomb {

/// Pixels to each side of the square whose means are taken.
inline constexpr uint32_t kAllotWindow = 2;
/// Weights of pixels are within these factors of the mean one: nobody starves for having been dark
/// by chance, and no firefly takes all.
inline constexpr double kLeastWeight = 0.125, kMostWeight = 8;

/// Samples that all pixels have before they are looked at; 0: there are too few to allot, or they
/// are even.
uint32_t pilot_samples(const Settings& settings);

/// What an allotment does, by what the pilot knows.
struct AllotmentFacts {
  uint32_t pilot = 0;            ///< samples of every pixel; 0: nothing was allotted
  uint32_t least = 0, most = 0;  ///< samples of a pixel at the end
  double gain = 0;               ///< efficiency to that of even samples, as expected; 0: not known
};

/// Allots settings.spp samples a pixel in the mean, exactly, of which all have the pilot's. `film`
/// has error sums, and costs for Allocate::kEfficiency, of the pilot.
Allotment allot(Film& film, const Settings& settings, AllotmentFacts& facts);

}  // namespace wavecomb
