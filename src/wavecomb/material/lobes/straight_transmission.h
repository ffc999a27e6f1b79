// SPDX-License-Identifier: Apache-2.0
/// Straight transmission of UsdPreviewSurface and of smooth thin walls of OpenPBR, which ray
/// traversal samples.
///
/// Where the opacity of UsdPreviewSurface is below 1, or where a thin wall transmits, the surface
/// lets the fraction T of the light pass without a change of direction (PrincipledLayers::straight,
/// OpenPbrBsdf::straight). Traversal lets each ray pass with the probability T
/// (its smallest component, if T is coloured, and at most kMaxEmissivePassing on emissive
/// surfaces), and multiplies the contribution of a shadow ray by T instead. A path that is stopped,
/// with the probability 1 - T, has the throughput
///   T_k <- T_k / (1 - T),
/// and its BSDF has no straight transmission. So straight transmission is neither a vertex nor a
/// bounce: origin, density and MIS weight of a ray remain those of the vertex where it started, and
/// light samples reach lights behind clear surfaces.
///
/// The probability depends on the shading normal without normal map, and on inputs at the finest
/// texture level, so that traversal and shading compute the same value. If all inputs are constant,
/// both look it up in a table over the cosine, since traversal needs it at each hit. Thin walls
/// whose inputs are not constant transmit light by a delta lobe of the BSDF instead.
#pragma once

#include <array>

#include "wavecomb/geometry/hit/surface.h"
#include "wavecomb/material/inputs/presence.h"
#include "wavecomb/material/lobes/principled_layers.h"
#include "wavecomb/material/params.h"

namespace wavecomb {

/// Result of straight_transmission().
template <typename F>
struct StraightTransmission {
  F probability;  ///< probability with which a ray passes, from 0 to 1
  F opacity;      ///< opacity of UsdPreviewSurface, at the finest texture level
};

/// Inputs on which straight transmission depends.
inline constexpr uint32_t kStraightInputs = kPrincipledInputs & ~input_bit(Input::kNormal);

/// Number of nodes of a table of straight transmission. The nodes are uniform in sqrt(cosine), and
/// linear interpolation errs by at most 3e-4.
inline constexpr uint32_t kStraightNodes = 129;

/// Probabilities with which rays pass a surface, by sqrt(cosine).
using StraightTable = std::array<float, kStraightNodes>;

/// Tabulates `passing(cosine)`.
template <typename Passing>
inline StraightTable make_straight_table(const Passing& passing) {
  StraightTable table;
  for (uint32_t i = 0; i < kStraightNodes; ++i) {
    const float x = static_cast<float>(i) / (kStraightNodes - 1);
    table[i] = passing(x * x);
  }
  return table;
}

namespace detail {

/// Layers that determine straight transmission.
template <typename F>
using StraightLayers = PrincipledLayers<F, kMetalPart | kCoatPart | kTransmissionPart>;

/// Returns the probability with which rays pass `layers` at cosine z.
template <typename F>
inline F passing_at(const StraightLayers<F>& layers, const F& z) {
  return layers.passing_probability(layers.straight(z));
}

/// Looks up the probability with which rays pass at cosine `z` in table `index`.
template <typename F>
inline F tabulated_passing(const float* tables, const UInt<F>& index, const F& z,
                           const Mask<F>& active) {
  // The cosine of a triangle whose area overflows is NaN, which saturate() maps to 0.
  const F x = sqrt(saturate(z)) * static_cast<float>(kStraightNodes - 1);
  const F below = min(floor(x), F(static_cast<float>(kStraightNodes - 2)));
  const UInt<F> at = index * kStraightNodes + UInt<F>(to_int<F>(below));
  const F a = gather<F>(tables, at, active), b = gather<F>(tables, at + 1u, active);
  return fma(F(b - a), F(x - below), a);
}

}  // namespace detail

/// Returns the table of a material of UsdPreviewSurface whose inputs are constant.
inline StraightTable preview_surface_table(const MaterialView& view, uint32_t material) {
  const auto params = fetch_params<0, float>(view, material, {0, 0}, Footprint<float>(0.f), true);
  const detail::StraightLayers<float> layers(params, false);
  return make_straight_table([&](float z) { return detail::passing_at<float>(layers, z); });
}

/// Returns the table of a thin wall of OpenPBR, material `m`, whose inputs are constant. All values
/// are 0 if the wall is rough.
StraightTable wall_table(MaterialView view, uint32_t material, const Material& m);

namespace detail {

/// Evaluates straight_transmission() for materials without a table.
template <typename F, typename MakeCosine>
[[gnu::noinline, gnu::cold]] StraightTransmission<F> evaluate_straight(
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
  const StraightLayers<F> layers(params, false);
  return {select(passing, passing_at<F>(layers, make_cosine(passing)), F(0.f)), opacity};
}

}  // namespace detail

/// Returns the straight transmission at a hit. `make_cosine(lanes)` returns unadjusted_cosine() and
/// is called only if a lane has an opacity below 1. The active lanes must have materials with the
/// flag kTransmitsStraight.
template <typename F, typename MakeCosine>
inline StraightTransmission<F> straight_transmission(const SceneView& scene, const MeshHit<F>& hit,
                                                     const UInt<F>& material,
                                                     const MakeCosine& make_cosine,
                                                     const Mask<F>& active) {
  using U = UInt<F>;
  const MaterialView& materials = scene.materials;
  if (!materials.straight_table)
    return detail::evaluate_straight<F>(scene, hit, material, make_cosine, active);
  const U table = gather<U>(materials.straight_table, material, Mask<U>(active));
  const Mask<F> tabulated = active & Mask<F>(table != U(kNoStraightTable));
  const Mask<F> others = active & not_(tabulated);
  StraightTransmission<F> found{F(0.f), F(1.f)};
  if (any(others)) found = detail::evaluate_straight<F>(scene, hit, material, make_cosine, others);
  if (none(tabulated)) return found;
  const F probability = detail::tabulated_passing<F>(materials.straight_tables, table,
                                                     make_cosine(tabulated), tabulated);
  const F opacity = detail::saturate(
      gather_member<F>(materials.materials, &MaterialRecord::opacity, material, tabulated));
  return {select(tabulated, probability, found.probability),
          select(tabulated, opacity, found.opacity)};
}

}  // namespace wavecomb
