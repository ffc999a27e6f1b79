// SPDX-License-Identifier: Apache-2.0
/// Paths that start at lights: a light, a place on it and a direction; and the densities that both
/// ends of a path need of it for multiple importance sampling (docs/light-paths.md).
///
/// Lights of which a path would have to know what it meets (LightRecord::camera_only) and mesh
/// lights, whose glow looks otherwise than what it lights, send no paths: the camera's find all of
/// their light. Bodies are in emission.inl.
#pragma once

#include "wavecomb/light/light.h"

namespace wavecomb {

/// A path from a light. The flux that it carries is `flux`; 1 / `density` is what goes into the
/// weights: KindEmission::density times the probability of the light's choice.
template <typename F>
struct Emission {
  Vec3<F> o, d;
  Color<F> flux;
  F density;
  UInt<F> light;
  Mask<F> valid;
};

/// Numbers in [0, 1): the light's (a multiple of 2^-24), the place's, the direction's, and what it
/// is aimed at.
template <typename F>
struct EmissionNumbers {
  F pick, u, v, s, t, aim;
};

/// How the camera's paths find a light at the first surface that a path from it meets: with
/// `density` over solid angle by a light sample; of a point, density is per square of the distance
/// (1 / d^2 is its solid angle), of a light without an angle the probability of its choice.
template <typename F>
struct LightReach {
  F density;
  Mask<F> is_delta;  ///< and by no bounce
};

/// Chooses a light by its share and a path from it. Where paths start they are clear of the light's
/// own shape.
template <typename F>
Emission<F> sample_emission(const LightView& view, const EmissionNumbers<F>& r,
                            const Mask<F>& wanted);

/// Emission::density of a path from `light` that would have come along the ray from.p + t dir,
/// backwards; 0 where the light sends none.
template <typename F>
F emission_density(const LightView& view, const UInt<F>& light, const Vec3<F>& from,
                   const Vec3<F>& dir, const F& t, const Mask<F>& wanted);

/// How light samples and bounces at `from` find `light`, which a path came from over a distance t
/// along -dir.
template <typename F>
LightReach<F> light_reach(const LightView& view, const UInt<F>& light, const LightReceiver<F>& from,
                          const Vec3<F>& dir, const F& t, const Mask<F>& active);

}  // namespace wavecomb
