// SPDX-License-Identifier: Apache-2.0
/// Gain in efficiency by light paths and merging, estimated from small pilot renders.
///
/// Two images without light paths and two with light paths have the same seeds, and hence the same
/// camera paths. Let e be the squared error of the images without light paths, e_s that of the
/// images with light paths, and c and c_s the costs, computed from the numbers of rays and vertices
/// at fixed costs. In images of so few samples, camera paths may not find a caustic at all, so that
/// e is too small. Camera paths contribute P - C less in the images with light paths, since light
/// paths find this light too; light paths contribute L. If P - C is less than L, camera paths
/// missed light. Its squared error e_left is estimated from light paths
/// (light_paths/light_vertex.h). The gain in efficiency is
///   (e + (1 - (P - C) / L) e_left) c / (e_s c_s).
/// Each error is estimated over all pixels, and without the noisiest pixels. The first estimate is
/// uncertain if few pixels hold most of the noise, and the second lacks what these hold. Gains are
/// a geometric mean of both, in which the first counts more the more pixels hold the noise: their
/// effective number is (sum n)^2 / (sum n^2), where n is the noise of a pixel.
///
/// Caustics that the camera sees in mirrors or through glass are found by merging only
/// (light_paths/merge_grid.h). Their squared error without merging is estimated as p_merged - p: p
/// is the squared error without light paths as estimated above, and p_merged the same from pilots
/// with merging. The gain of merging is
///   (e_s c_s + max(p_merged - p, 0) c_s) / (e_merged c_merged).
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "wavecomb/light_paths/setup.h"
#include "wavecomb/render/camera_path_part.h"

namespace wavecomb {

/// Samples per pixel of a pilot render. This number suffices to show the effects of Sobol sequences
/// and of roulette.
inline constexpr uint32_t kTransportSamples = 8;

/// Candidate ratios of light paths. In tests with caustics, ratios near the better candidate hardly
/// differed in efficiency, with and without merging.
inline constexpr std::array<LightPathShare, 2> kCandidateShares = {{{-3}, {0}}};

/// Numbers of rays and shading records of a pilot render, or their means.
struct PilotWork {
  double rays = 0, records = 0;

  /// Returns the cost at the given cost of a record, in units of the cost of a ray.
  double cost(double vertex) const { return rays + vertex * records; }
};

/// Result of a small pilot render.
struct TransportPilot {
  std::vector<float> beauty;  ///< rgb
  /// Part of the beauty contributed by light paths; empty without light paths.
  std::vector<float> by_light_paths;
  PilotWork work;
};

/// Results of the pilot renders, whose images are `width` pixels wide.
struct TransportPilots {
  /// Two pilot renders without light paths.
  std::array<TransportPilot, 2> path;
  /// Two pilot renders for each ratio of light paths, with the seeds of `path`. Ratios without
  /// images are no candidates.
  std::array<TransportPilot, 2> with[kCandidateShares.size()];
  /// Estimated variance per sample of each pixel if only camera paths sampled the light that light
  /// paths now contribute; empty if camera paths find nearly all of it.
  std::vector<double> variance;
  uint32_t width = 0;
  bool merges = false;
};

/// Returns the fraction of the light contributed by light paths that camera paths do not find, from
/// the images of the smallest ratio that has images. Pixels in which camera paths are noisiest do
/// not count, since these are the few pixels in which camera paths hit a caustic by chance.
double missed_light(const TransportPilots& pilots);

/// Squared relative error times cost, over all pixels and without the noisiest pixels.
struct PilotError {
  double all = 0, of_most = 0;
  double pixels = 0;  ///< effective number of pixels that hold the noise
};

/// Predicted gain by light paths.
struct TransportGain {
  double gain = 0;  ///< efficiency of the best ratio, relative to a render without light paths
  LightPathShare share;
  CameraPathPart camera;     ///< of the best ratio, without the noisiest pixels
  PilotError with, without;  ///< of the best ratio, and without light paths
};

/// Returns the predicted efficiency gain for a render with `longer` times as many samples as the
/// pilots.
TransportGain transport_gain(const TransportPilots& pilots, double longer);

/// Returns the predicted gain of the better ratio if only images of the smaller ratio were
/// rendered.
double possible_gain(const TransportPilots& pilots, double longer);

/// Returns the predicted efficiency of a render with merging, relative to the best ratio without
/// merging.
double merging_gain(const TransportGain& merged, const TransportGain& unmerged);

}  // namespace wavecomb
