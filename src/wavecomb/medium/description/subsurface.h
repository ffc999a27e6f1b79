// SPDX-License-Identifier: Apache-2.0
/// Media for subsurface random walks.
#pragma once

#include <cstdint>

#include "wavecomb/core/rows/fields.h"
#include "wavecomb/core/vec.h"

namespace wavecomb {

struct Material;
struct GraphSet;

/// Kind of subsurface random walk of a material, stored in OpenPbrRecord::subsurface.
enum class SubsurfaceKind : uint8_t {
  kNone,   ///< no random walk
  kWhole,  ///< light enters untinted, and absorption in the medium determines the colour
  /// The medium does not absorb. The subsurface colour, driven by a value graph, tints light that
  /// enters.
  kTinted,
};

/// Homogeneous medium for the subsurface random walk of a material.
template <typename F>
struct SubsurfaceMedium {
  Color<F> extinction;     ///< extinction per unit of length; 0 if the material has no random walk
  Color<F> albedo;         ///< single-scattering albedo
  F anisotropy;            ///< mean cosine of the scattering angle
  Color<F> color;          ///< diffuse albedo of a flat half-space, at least 0.05
  Color<F> diffusion;      ///< diffusion length nu, in mean free paths, from 1.02 to 100
  Color<F> log_diffusion;  ///< ln((nu + 1) / (nu - 1))
  WAVECOMB_FIELDS(extinction, albedo, anisotropy, color, diffusion, log_diffusion)
};
static_assert(sizeof(SubsurfaceMedium<float>) == 64);

/// Returns the kind of random walk of a material.
SubsurfaceKind subsurface_kind(const Material& material, const GraphSet& graphs);
/// Makes the medium of a material whose SubsurfaceKind is not kNone.
SubsurfaceMedium<float> make_subsurface_medium(const Material& material, SubsurfaceKind kind);

/// Returns the single-scattering albedo, for mean cosine `anisotropy`, for which a half-space under
/// uniform illumination has the colour `color`, within 0.4 %. The function inverts van de Hulst's
/// approximation
///   color = (1 - s) (1 - 0.139 s) / (1 + 1.17 s),  s^2 = (1 - albedo) / (1 - anisotropy albedo)
/// (van de Hulst, "Multiple Light Scattering", 1980; OpenPBR 1.1), with a fitted correction of s.
float single_albedo(float color, float anisotropy);

/// Returns the diffusion length of a medium, in mean free paths, from 1.02 to 100. For isotropic
/// scattering with albedo a, the diffusion length is
///   1 / sqrt(1 - a^(2.44294 - 0.0215813 a + 0.578637 / a))
/// (d'Eon and Krivanek, "Zero-Variance Theory for Efficient Subsurface Scattering", 2020). By
/// similarity theory, an anisotropic medium has the same diffusion length as an equivalent
/// isotropic medium.
double diffusion_length(double albedo, double anisotropy);

/// Device view of all media for subsurface random walks.
struct SubsurfaceView {
  const SubsurfaceMedium<float>* media =
      nullptr;  ///< media, indexed by material; null if no material has subsurface random walks
  uint32_t exit_material = 0;  ///< white diffuse material that shades exit points of random walks
};

}  // namespace wavecomb
