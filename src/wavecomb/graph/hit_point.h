// SPDX-License-Identifier: Apache-2.0
/// What value graphs may ask of a hit.
#pragma once

#include "wavecomb/graph/run.h"
#include "wavecomb/surface/surface.h"

namespace wavecomb {

/// The GraphPoint of a hit on surface `s`, seen along `dir`. Not inline: kernels without graphs
/// keep their size.
template <typename F>
[[gnu::noinline, gnu::cold]] GraphPoint<F> graph_point(const SceneView& scene,
                                                       const MeshHit<F>& hit, const Surface<F>& s,
                                                       const Vec3<F>& dir,
                                                       const Footprint<F>& footprint,
                                                       const Mask<F>& active);

}  // namespace wavecomb
