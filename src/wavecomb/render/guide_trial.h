// SPDX-License-Identifier: Apache-2.0
/// Paths that teach, and trials: some pixels rendered as the picture is, with a field or without.
#pragma once

#include <functional>
#include <span>
#include <vector>

#include "wavecomb/integrate/wave.h"
#include "wavecomb/render/bounce_reader.h"
#include "wavecomb/render/guide_training.h"
#include "wavecomb/render/picture_tiles.h"

namespace wavecomb {

/// What a ray costs where it is tested against a list, as a share of one in a hierarchy.
inline constexpr double kListRay = 0.3;
/// Of the cost of a vertex, in rays: shading it, and looking up the field there. (Trials; what
/// materials cost, roulette knows by themselves.)
inline constexpr double kShadingRays = 0.7, kGuidedRays = 0.9;

/// `count` of the picture's pixels, evenly spread, in an order that keeps neighbours together.
std::vector<uint32_t> some_pixels(const std::vector<uint32_t>& order, uint64_t count);

/// The mean without the share of values that are largest. Sorts them.
double mean_without_largest(std::vector<double>& values, double share);

/// Runs the paths of `pixels` that `plan` says with the field of `context`, some at a time, and
/// adds what they taught. Gives what they cost, in rays of a hierarchy.
double teach(WaveContext context, const WaveSetup& waves, std::span<const uint32_t> pixels,
             const LessonPlan& plan, Lessons& lessons, const std::function<bool()>& stopped);

/// Two pictures of some pixels, with other seeds: Sobol's points are in them as they are in the
/// picture.
struct Trial {
  uint32_t samples = 0;             ///< of each pixel, in each of the two
  std::vector<double> differences;  ///< of the pixels' means
  double cost = 0;                  ///< of both, in rays of a hierarchy

  double cost_of_sample() const {
    return cost / (2.0 * samples * static_cast<double>(differences.size()));
  }
};

/// Renders `samples` of each pixel, as `settings` say but for the seed. `guide`: null: without a
/// field.
Trial try_out(WaveContext context, Settings settings, const GuideView* guide,
              const WaveSetup& waves, std::span<const uint32_t> pixels, uint32_t samples,
              const GuideGrid& grid, const std::function<bool()>& stopped);

/// The mean squared difference, relative to the picture there. The pixels that differ most do not
/// count: fireflies tell too little of the others. Contract: `tiles` are lit.
double error_of(const Trial& trial, std::span<const uint32_t> pixels, const PictureTiles& tiles);

}  // namespace wavecomb
