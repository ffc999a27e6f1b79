// SPDX-License-Identifier: Apache-2.0
/// Straight transmission of UsdPreviewSurface, which ray traversal samples.
///
/// Where opacity is below 1, the surface lets the fraction T of the light pass without a change of
/// direction (PrincipledLayers::straight). Traversal lets each ray pass with the probability T
/// (its smallest component, if T is coloured, and at most kMaxEmissivePassing on emissive
/// surfaces), and multiplies the contribution of a shadow ray by T instead. A path that is stopped,
/// with the probability 1 - T, has the throughput
///   T_k <- T_k / (1 - T),
/// and its BSDF has no straight transmission. So straight transmission is neither a vertex nor a
/// bounce: origin, density and MIS weight of a ray remain those of the vertex where it started, and
/// light samples reach lights behind clear surfaces.
///
/// The probability depends on the shading normal without normal map, and on inputs at the finest
/// texture level, so that traversal and shading compute the same value.
#pragma once

#include "wavecomb/geometry/hit/surface.h"
#include "wavecomb/material/inputs/presence.h"
#include "wavecomb/material/lobes/principled_layers.h"
#include "wavecomb/material/params.h"

namespace wavecomb {

/// Result of straight_transmission().
template <typename F>
struct StraightTransmission {
  F probability;  ///< probability with which a ray passes, from 0 to 1
  F opacity;      ///< opacity at the finest texture level
};

/// Returns the lanes whose materials may transmit light straight.
template <typename F>
inline Mask<F> transmits_straight(const UInt<F>& flags) {
  return Mask<F>((flags & UInt<F>(uint32_t{kTransmitsStraight})) != UInt<F>(0u));
}

/// Returns the cosine on which straight transmission along `dir` depends. It is the same for the
/// opposite direction.
template <typename F>
inline F straight_cosine(const Surface<F>& s, const Vec3<F>& dir) {
  return min(abs(dot(dir, s.unadjusted)), F(1.f));
}

/// Returns the straight transmission at a hit. `make_cosine(lanes)` returns straight_cosine() and
/// is called only if a lane has an opacity below 1. The active lanes must have materials with the
/// flag kTransmitsStraight.
template <typename F, typename MakeCosine>
[[gnu::noinline, gnu::cold]] StraightTransmission<F> straight_transmission(
    const SceneView& scene, const MeshHit<F>& hit, const UInt<F>& material,
    const MakeCosine& make_cosine, const Mask<F>& active) {
  const MeshPosition<F> position{hit.mesh, hit.prim, hit.u, hit.v};
  const Vec2<F> uv = hit_uv<F>(scene.meshes, hit.mesh, hit.prim, hit.u, hit.v, active);
  const auto point = [&](const Mask<F>& lanes) {
    return point_at_rest<F>(scene.meshes, scene.instances, hit.inst, position, uv, lanes);
  };
  const Footprint<F> finest(F(0.f));
  const F opacity = material_opacity<F>(scene.materials, material, uv, finest, point, active);
  const Mask<F> passing = active & (opacity < 1.f);
  if (none(passing)) return {F(0.f), opacity};
  ShadingParams<F> params =
      fetch_params<kPrincipledInputs, F>(scene.materials, material, uv, finest, point, passing);
  params.opacity = opacity;
  const PrincipledLayers<F, kMetalPart | kCoatPart | kTransmissionPart> layers(params, false);
  const Color<F> straight = layers.straight(make_cosine(passing));
  return {select(passing, layers.passing_probability(straight), F(0.f)), opacity};
}

}  // namespace wavecomb
