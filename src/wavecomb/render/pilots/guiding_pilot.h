// SPDX-License-Identifier: Apache-2.0
/// Training paths and pilot renders of some pixels, with or without path guiding.
#pragma once

#include <functional>
#include <optional>
#include <span>
#include <vector>

#include "wavecomb/guiding/bounce/bounce_reader.h"
#include "wavecomb/guiding/image_tiles.h"
#include "wavecomb/render/pilots/guiding_training.h"
#include "wavecomb/wave/wave.h"

namespace wavecomb {

/// Cost of a ray tested against a list of triangles, relative to a ray traced through a BVH.
inline constexpr double kListRay = 0.3;
/// Costs in rays of shading a vertex and of looking up the guiding field there. Pilot renders use
/// these costs, while learned roulette uses the costs of the materials.
inline constexpr double kShadingRays = 0.7, kGuidedRays = 0.9;

/// Returns `count` evenly spaced pixels of `order`, in the same order.
std::vector<uint32_t> subset_of_pixels(const std::vector<uint32_t>& order, uint64_t count);

/// Returns the mean of `values` without the largest values, a fraction `share` of all values. Sorts
/// `values`.
double trimmed_mean(std::vector<double>& values, double share);

/// Traces the paths of `plan` from `pixels`, guided by the field of `context`, in batches that
/// limit memory use. Replaces the bounces and paths in `training_samples`, but appends to the
/// records. Returns the cost, in rays traced through a BVH.
double trace_training_paths(WaveContext context, const WaveSetup& waves,
                            std::span<const uint32_t> pixels, const TrainingPlan& plan,
                            TrainingSamples& training_samples,
                            const std::function<bool()>& stopped);

/// Result of a pilot render: two images of some pixels with different seeds. Both images use the
/// sampler of the render, so that they also benefit from its well-distributed samples.
struct PilotRender {
  uint32_t samples = 0;             ///< samples per pixel, in each image
  std::vector<double> differences;  ///< difference of the two means of each pixel
  double cost = 0;                  ///< cost of both images, in rays traced through a BVH

  /// Appends the pixels of a pilot render with the same number of samples.
  void append(const PilotRender& other);
  double cost_of_sample() const {
    return cost / (2.0 * samples * static_cast<double>(differences.size()));
  }
};

/// Work of a pilot render of some pixels.
struct PilotRenderPlan {
  std::span<const uint32_t> pixels;
  uint32_t samples;          ///< samples per pixel, in each of two images
  const GuidingView* guide;  ///< guiding field to use, or null for none
};

/// Renders the pixels twice, with `settings` except for the seed.
PilotRender render_pilot(WaveContext context, Settings settings, const WaveSetup& waves,
                         const PilotRenderPlan& plan, const std::function<bool()>& stopped);

/// Returns the mean squared difference of the two images of `pixels`, relative to the brightness of
/// the image. Leaves out the pixels that differ most, since fireflies say little about other
/// pixels. Contract: `tiles` are lit.
double error_of(const PilotRender& pilot, std::span<const uint32_t> pixels,
                const ImageTiles& tiles);

/// Returns the mean cost and variance of a path, with the effect of roulette, from the paths of the
/// last round, which were traced from `pixels`. `spread` is the variance without roulette. If
/// `spread` is empty, the variance is estimated from differences between neighbours, without the
/// paths that differ most.
PathStatistics mean_path(const TrainingSamples& training_samples, std::span<const uint32_t> pixels,
                         const ImageTiles& tiles, std::optional<double> spread);

/// Returns the standard error of the logarithm of error_of(a) / error_of(b), for two pilot renders
/// of `pixels`, by the jackknife over ten groups of pixels (B. Efron, C. Stein, "The Jackknife
/// Estimate of Variance", 1981).
double log_ratio_error(const PilotRender& a, const PilotRender& b, std::span<const uint32_t> pixels,
                       const ImageTiles& tiles);

}  // namespace wavecomb
