// SPDX-License-Identifier: Apache-2.0
/// Fits target spheres to training light paths. Later light paths are aimed at these spheres.
#pragma once

#include <span>

#include "wavecomb/light/description/aim.h"

namespace wavecomb {

/// Training sample of a light path: its first hit, and the luminance that its second and later
/// vertices contribute to the image. The contribution of the first vertex does not count, because
/// light samples of camera paths also find it.
struct AimSample {
  float x = 0, y = 0, z = 0;
  float contribution = 0;
};

/// Fits spheres around the first hits of light paths that contribute to the image. Bounding boxes
/// are split as long as splits increase the likelihood, the split with the largest gain first.
///
/// With W_k the contribution in box k and A_k = r_k^2, the mixture chooses sphere k with a
/// probability proportional to W_k and is uniform within the sphere. The log-likelihood of the
/// mixture exceeds the log-likelihood of a single sphere by
///   sum_k W_k log(W_k / A_k) - W log(W / A),
/// which the splits maximise. `scene_radius` is the radius of the bounding sphere of all surfaces.
/// Returns no spheres if fewer than four samples contribute.
LightAim aim_targets(std::span<const AimSample> aim_samples, float scene_radius);

}  // namespace wavecomb
