// SPDX-License-Identifier: Apache-2.0
/// Where a region's light comes from, as its bounces tell.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "wavecomb/learn/guide_sphere.h"
#include "wavecomb/learn/guide_view.h"
#include "wavecomb/learn/training_record.h"

namespace wavecomb {

/// Weights of bins, row by row of the square of directions from the middle.
using DirectionBins = std::array<double, kGuideBins>;
/// The middle of a bin.
Vec3<float> bin_direction(uint32_t bin);

using Bounces = std::span<const TrainingRecord* const>;

/// The sphere by which bounces of a region agree best on where light comes from: about the mean of
/// their places, and of the radius, of a few, by which the sum of squares of what the bins have is
/// greatest. How far bounces went says what to try: openings are nearer than what is seen
/// through them. No bounce counts for more than `cut`.
GuideSphere fit_sphere(Bounces bounces, double cut);

/// `count` of the bounces, evenly spread.
std::vector<const TrainingRecord*> some_bounces(Bounces bounces, size_t count);

/// What bounces bring by the direction that they take, seen from the middle of `sphere`.
DirectionBins direction_bins(Bounces bounces, const GuideSphere& sphere, double cut);

/// The bins blurred by some 5 degrees, which a region's hundreds of bounces are too few to tell.
DirectionBins smoothed(const DirectionBins& bins);

}  // namespace wavecomb
