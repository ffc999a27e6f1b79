// SPDX-License-Identifier: Apache-2.0
/// Densities with which guided camera paths bounce at the vertices of light paths, for MIS weights.
///
/// Light paths are not guided. Camera paths may be, and then sample the bounce from w to l with the
/// density p-> of the mixture of BSDF and guiding distribution (guiding/bounce/guided_bounce.h). A
/// vertex of a light path looks up the same distribution, on the side from which the camera path
/// would arrive.
#pragma once

#include "wavecomb/guiding/bounce/guided_bounce.h"

namespace wavecomb {

/// Density of the bounces of camera paths that arrive at a vertex of a light path from one
/// direction, over solid angle.
template <typename F>
struct CameraBounce {
  F pdf;  ///< density p-> of the bounce towards the light
  /// Probability that the BSDF samples the bounce, as in GuidingLookup. The selection probability
  /// of a delta lobe is that of the BSDF times this value.
  F bsdf_share;
};

/// Returns the density with which camera paths bounce from `w` to `l`, in the shading frame
/// `frame`. `p_bsdf` is the density of the BSDF for this bounce.
template <typename Bsdf, typename F, uint32_t kFeatures, typename Interaction>
WAVECOMB_INLINE CameraBounce<F> camera_bounce(const Vertex<F, kFeatures>& v, const Interaction& at,
                                              const Frame<F>& frame, const Vec3<F>& w,
                                              const Vec3<F>& l, const F& p_bsdf) {
  const GuidingLookup<F> guiding = guiding_lookup<Bsdf, F>(v, at, frame, w);
  return {mixed_pdf<Bsdf, F>(v, guiding, frame.to_world(l), l, w, p_bsdf), guiding.bsdf_share};
}

}  // namespace wavecomb
