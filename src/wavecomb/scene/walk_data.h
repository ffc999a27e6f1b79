// SPDX-License-Identifier: Apache-2.0
/// What light meets that walks below a surface.
#pragma once

#include <cstdint>

#include "wavecomb/core/fields.h"
#include "wavecomb/core/vec.h"

namespace wavecomb {

struct Material;
struct GraphSet;

/// How light enters a surface below which it walks; OpenPbrRecord::walks.
enum class WalkKind : uint8_t {
  kNone,    ///< it does not
  kWhole,   ///< all of it: what is below gives it its colour
  kTinted,  ///< as much of it as the colour says, which a graph says; below, nothing is absorbed
};

/// A medium that is even: of a material below whose surface light walks.
template <typename F>
struct WalkMedium {
  Color<F> extinction;  ///< one over a unit of length; 0: nobody walks here
  Color<F> albedo;      ///< of a single collision
  F anisotropy;         ///< mean cosine of the scattering angle
  Color<F> color;       ///< what is left of light below a flat wall; what is darker counts as 0.05
  Color<F> diffusion;   ///< diffusion length nu, in mean free paths; from 1.02 to 100
  Color<F> log_diffusion;  ///< ln((nu + 1) / (nu - 1))
  WAVECOMB_FIELDS(extinction, albedo, anisotropy, color, diffusion, log_diffusion)
};
static_assert(sizeof(WalkMedium<float>) == 64);

WalkKind walk_kind(const Material& material, const GraphSet& graphs);
/// The medium of a material whose kind is not kNone.
WalkMedium<float> make_walk_medium(const Material& material, WalkKind kind);

/// The albedo of a single collision, with mean cosine `anisotropy`, that gives a half-space the
/// colour `color` under even light, within 0.4 %: van de Hulst's approximation,
///   color = (1 - s) (1 - 0.139 s) / (1 + 1.17 s),  s^2 = (1 - albedo) / (1 - anisotropy albedo)
/// solved for the albedo (van de Hulst, "Multiple Light Scattering", 1980; OpenPBR 1.1), with a
/// correction of s.
float single_albedo(float color, float anisotropy);

/// The diffusion length of a medium, in mean free paths; from 1.02 to 100. With albedo a, even:
///   1 / sqrt(1 - a^(2.44294 - 0.0215813 a + 0.578637 / a))
/// (d'Eon and Krivanek, "Zero-Variance Theory for Efficient Subsurface Scattering", 2020); else
/// that of the even medium that is similar.
double diffusion_length(double albedo, double anisotropy);

/// What kernels need of all such media.
struct WalkView {
  const WalkMedium<float>* media = nullptr;  ///< by material; null: nobody walks
  uint32_t exit_material = 0;                ///< shades where walks end: a white diffuse one
};

}  // namespace wavecomb
