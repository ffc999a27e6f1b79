// SPDX-License-Identifier: Apache-2.0
/// Choice of the transport for Transport::kAuto: whether and how many light paths a render traces.
///
/// A render traces no light paths if the settings or the scene do not support them, if no surface
/// is transmissive or glossy, or if no light emits light paths. Otherwise small images of the whole
/// view are rendered before the first pass, two for each candidate ratio of light paths. (Each
/// ratio needs separate images, because the ratio determines the MIS weights, and these affect the
/// noise of both kinds of paths.) The noise without light paths cannot be measured in images of so
/// few samples, since camera paths may not find a caustic at all. The noise without light paths is
/// therefore estimated from light paths (light_paths/light_vertex.h). Let e_camera be the squared
/// error of the light that camera paths contribute in a render with light paths, e_left the squared
/// error of the remaining light if camera paths had to find it, and c the cost without light paths,
/// computed from the numbers of rays and vertices at fixed costs. The gain in efficiency of a ratio
/// with squared error e_s and cost c_s is
///   (e_camera + e_left) c / (e_s c_s).
/// Caustics that the camera sees in mirrors or through glass are found by merging only
/// (light_paths/merge_grid.h). In scenes with such surfaces, pilots with merging at the larger
/// ratio follow. The squared error of these caustics without merging is estimated as p_merged - p:
/// p is the squared error without light paths as estimated above, and p_merged the same from the
/// pilots with merging. The gain of merging is
///   (e_s c_s + max(p_merged - p, 0) c_s) / (e_merged c_merged).
/// Merging blurs caustics by up to a pixel, and is used only for a large gain.
/// The choice does not depend on seed, region, threads, waves or lanes, so that crops, resumed
/// renders and merged renders use the same transport. Samples of the pilot do not contribute to the
/// image.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "wavecomb/core/settings.h"
#include "wavecomb/light_paths/setup.h"
#include "wavecomb/render/camera_path_part.h"
#include "wavecomb/scene/scene.h"

namespace wavecomb {

/// The chosen transport, with the reason.
struct TransportChoice {
  Transport transport = Transport::kPath;
  LightPathShare share;   ///< for Transport::kLight
  CameraPathPart camera;  ///< of the render with the chosen transport
  /// Whether light paths are merged within one pixel; only with Settings::auto_merge.
  bool merges = false;
  std::string why;  ///< reason for the choice, worded as a clause of a message
  /// Predicted efficiency relative to a render without light paths; 0 if not measured.
  double gain = 0;
  double seconds = 0;
};

/// Result of a small pilot render.
struct TransportPilot {
  std::vector<float> beauty;  ///< rgb
  /// Part of the beauty contributed by light paths; empty without light paths.
  std::vector<float> by_light_paths;
  uint64_t rays = 0, records = 0;  ///< numbers of traced rays and shading records
};
/// Function that renders a small image with the given ratio of light paths to camera paths. If its
/// last argument is true, `by_light_paths` holds variances instead of radiance
/// (`RenderOptions::wants_camera_squares`).
using RenderPilot = std::function<TransportPilot(const Settings&, LightPathShare, bool)>;

/// Candidate ratios of light paths. In tests with caustics, ratios near the better candidate hardly
/// differed in efficiency, with and without merging.
inline constexpr std::array<LightPathShare, 2> kCandidateShares = {{{-3}, {0}}};

/// Returns whether any material reflects or transmits light sharply enough for caustics.
bool focuses_light(const Scene& scene);

/// Chooses the transport for `settings` from small images made by `render`. `samples` is the number
/// of samples that the actual render is expected to take. If `stopped` returns true, the function
/// stops and chooses `Transport::kPath`.
TransportChoice choose_transport(const Scene& scene, const Settings& settings, uint64_t samples,
                                 const RenderPilot& render, const std::function<bool()>& stopped);

// Exposed for tests.

/// Results of the pilot renders, whose images are `width` pixels wide.
struct TransportPilots {
  /// Two pilot renders with different seeds for each ratio of light paths. Ratios without images
  /// are no candidates.
  std::array<TransportPilot, 2> with[kCandidateShares.size()];
  /// Estimated variance per sample of each pixel if only camera paths sampled the light that light
  /// paths now contribute.
  std::vector<double> variance;
  uint32_t width = 0;
  bool merges = false;
};
/// Numbers of rays and shading records of a pilot render.
struct PilotWork {
  double rays = 0, records = 0;

  /// Returns the cost at the given cost of a record, in units of the cost of a ray.
  double cost(double vertex) const { return rays + vertex * records; }
};
/// Returns the work of a render without light paths, extrapolated from the pilot renders with two
/// ratios of light paths.
PilotWork work_without(const TransportPilots& pilots);
/// Squared relative error times cost, over all pixels and without the noisiest pixels.
struct PilotError {
  double all = 0, of_most = 0;
};
struct TransportGain {
  double gain = 0;  ///< efficiency of the best ratio, relative to a render without light paths
  LightPathShare share;
  CameraPathPart camera;     ///< of the best ratio, without the noisiest pixels
  PilotError with, without;  ///< of the best ratio, and without light paths
};
/// Returns the predicted efficiency gain for a render with `longer` times as many samples as the
/// pilots. `without` is the work of a render without light paths.
TransportGain transport_gain(const TransportPilots& pilots, const PilotWork& without,
                             double longer);
/// Returns the predicted efficiency of a render with merging, relative to the best ratio without
/// merging.
double merging_gain(const TransportGain& merged, const TransportGain& unmerged);

}  // namespace wavecomb
