// SPDX-License-Identifier: Apache-2.0
/// Inputs of value graphs at a hit.
#pragma once

#include "wavecomb/geometry/hit/surface.h"
#include "wavecomb/graph/run.h"

namespace wavecomb {

/// Returns the GraphPoint of a hit on surface `s` by a ray along `dir`. This function is not
/// inlined, to keep kernels without graphs small.
template <typename F>
[[gnu::noinline, gnu::cold]] GraphPoint<F> graph_point(const SceneView& scene,
                                                       const MeshHit<F>& hit, const Surface<F>& s,
                                                       const Vec3<F>& dir,
                                                       const Footprint<F>& footprint,
                                                       const Mask<F>& active);

}  // namespace wavecomb
