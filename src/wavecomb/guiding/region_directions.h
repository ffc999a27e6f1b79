// SPDX-License-Identifier: Apache-2.0
/// Distribution of incident directions of a region, estimated from its training bounces.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "wavecomb/guiding/field/field_view.h"
#include "wavecomb/guiding/parallax_sphere.h"
#include "wavecomb/guiding/training_sample.h"

namespace wavecomb {

/// Weights of direction bins, row by row of the equal-area square (directions.h).
using DirectionBins = std::array<double, kGuidingBins>;
/// Returns the unit vector at the centre of a bin.
Vec3<float> bin_direction(uint32_t bin);

/// Training bounces of one region. The caller owns the records.
using Bounces = std::span<const TrainingRecord* const>;

/// Fits the sphere on which the incident light of a region is assumed to lie. The sphere's centre
/// is the mean position of the bounces. The sphere's radius is the candidate whose direction bins
/// have the largest sum of squares, that is, the most concentrated distribution. The candidates
/// include radii below the mean hit distance, because an opening such as a window is nearer than
/// the surfaces that rays hit behind it. The value of each bounce is clamped to `cut`.
ParallaxSphere fit_sphere(Bounces bounces, double cut);

/// Returns `count` bounces at equal index intervals, or all bounces if there are no more than
/// `count`.
std::vector<const TrainingRecord*> subset_of_bounces(Bounces bounces, size_t count);

/// Sums the values of bounces, clamped to `cut`, in bins by their direction as seen from the centre
/// of `sphere`.
DirectionBins direction_bins(Bounces bounces, const ParallaxSphere& sphere, double cut);

/// Blurs the bins by about 5 degrees, since a few hundred bounces per region leave gaps.
DirectionBins smoothed(const DirectionBins& bins);

}  // namespace wavecomb
