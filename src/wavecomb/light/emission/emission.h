// SPDX-License-Identifier: Apache-2.0
/// Light paths: sampling of a light, a point on it and a direction, and the densities that both
/// ends of a path need for multiple importance sampling (docs/light-paths.md).
///
/// Two kinds of lights emit no light paths, so that only camera paths find their light: lights with
/// properties that light paths do not support, such as links, multipliers, decay or motion
/// (LightRecord::camera_only), and mesh lights whose visible emission differs from the light that
/// they cast. The function bodies are in emission.inl.
#pragma once

#include "wavecomb/light/sampling/light_sample.h"

namespace wavecomb {

/// Start of a light path. `flux` is the initial flux of the path. `density` is
/// KindEmission::density times the probability of selecting the light; MIS weights use 1 /
/// `density`.
template <typename F>
struct Emission {
  Vec3<F> o, d;
  Color<F> flux;
  F density;
  UInt<F> light;
  Mask<F> valid;
};

/// Random numbers in [0, 1) for sampling a light path: for the selection of the light (a multiple
/// of 2^-24), the point on the light, the direction, and the target sphere.
template <typename F>
struct EmissionNumbers {
  F light, u, v, s, t, aim;
};

/// Density with which camera paths sample a light from the point where a light path first hits a
/// surface. `density` is the solid angle density of a light sample. For a point light, `density` is
/// the probability of selecting the light times the squared distance d^2, since 1 / d^2 replaces
/// the solid angle. For a distant light without an angle, `density` is the probability of selecting
/// the light.
template <typename F>
struct CameraPathDensity {
  F density;
  Mask<F> is_delta;  ///< whether no bounce can hit the light
};

/// Selects a light in proportion to its weight, and samples a path from this light. The origin is
/// offset from the light's shape, so that rays do not hit it.
template <typename F>
Emission<F> sample_emission(const LightView& view, const EmissionNumbers<F>& r,
                            const Mask<F>& wanted);

/// Returns Emission::density of a path from `light` that arrives at `from` along -dir over the
/// distance t. The density is 0 if the light emits no paths.
template <typename F>
F emission_density(const LightView& view, const UInt<F>& light, const Vec3<F>& from,
                   const Vec3<F>& dir, const F& t, const Mask<F>& wanted);

/// Returns the density with which camera paths at `from` sample `light`, for a light path that
/// `light` emitted and that arrived at `from` along -dir over the distance t.
template <typename F>
CameraPathDensity<F> camera_path_density(const LightView& view, const UInt<F>& light,
                                         const LightReceiver<F>& from, const Vec3<F>& dir,
                                         const F& t, const Mask<F>& active);

}  // namespace wavecomb
