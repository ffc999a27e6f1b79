// SPDX-License-Identifier: Apache-2.0
/// Choice of the transport for Transport::kAuto: whether and how many light paths a render traces.
///
/// A render traces no light paths if the settings or the scene do not support them, if no surface
/// is transmissive or glossy, or if no light emits light paths. Otherwise small images of the whole
/// view are rendered before the first pass: two without light paths, and two for each candidate
/// ratio of light paths. (Each ratio needs separate images, because the ratio determines the MIS
/// weights, and these affect the noise of both kinds of paths.) The images of the larger ratio are
/// rendered only if those of the smaller ratio suggest a gain. In scenes with caustics that only
/// merging finds (light_paths/merge_grid.h), images with merging at the larger ratio follow.
/// transport_gain.h computes gains from these images. Merging blurs caustics by up to a pixel, and
/// is used only for a large gain. The choice does not depend on seed, region, threads, waves or
/// lanes, so that crops, resumed renders and merged renders use the same transport. Samples of the
/// pilot do not contribute to the image.
#pragma once

#include <cstdint>
#include <functional>
#include <string>

#include "wavecomb/core/settings.h"
#include "wavecomb/light_paths/render/transport_gain.h"
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

/// Function that renders a small image with the given ratio of light paths to camera paths. If its
/// last argument is true, `by_light_paths` holds variances instead of radiance
/// (`RenderOptions::wants_camera_squares`).
using RenderPilot = std::function<TransportPilot(const Settings&, LightPathShare, bool)>;

/// Returns whether any material reflects or transmits light sharply enough for caustics.
bool focuses_light(const Scene& scene);

/// Chooses the transport for `settings` from small images made by `render`. `samples` is the number
/// of samples that the actual render is expected to take. If `stopped` returns true, the function
/// stops and chooses `Transport::kPath`.
TransportChoice choose_transport(const Scene& scene, const Settings& settings, uint64_t samples,
                                 const RenderPilot& render, const std::function<bool()>& stopped);

}  // namespace wavecomb
