// SPDX-License-Identifier: Apache-2.0
/// Shading points of hits on curves and points. `geometry/hit/surface.h` includes this file.
#pragma once

#include "wavecomb/geometry/hit/surface_reader.h"

namespace wavecomb::detail {

/// Computes the shading point at hits on curves and points. The function is never inlined, so that
/// it does not increase the register use of kernels in scenes without curves. The normal of
/// Gaussian splats is -`dir`, opposite to the ray. The function body is in curve_surface.inl.
template <typename F>
void setup_curved(const SceneView& scene, const MeshHit<F>& hit, const Vec3<F>& dir, bool with_uv,
                  const Mask<F>& active, Surface<F>& out);

}  // namespace wavecomb::detail
