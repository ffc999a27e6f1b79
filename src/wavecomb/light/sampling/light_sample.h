// SPDX-License-Identifier: Apache-2.0
/// Light sampling: selection of a light, sampling of a point on the light, and the densities of
/// both.
///
/// The direct light at p is estimated by f(wi) |cos| * LightSample::weight * MIS weight. The other
/// MIS technique is a bounce that hits a light. For its direction, light_hit(),
/// triangle_light_pdf() and escaped_radiance() (escape.h) compute the density of sample_light().
/// The function bodies are in light_sample.inl; the translation units of shared_kernels.h
/// instantiate them.
#pragma once

#include "wavecomb/core/vec.h"
#include "wavecomb/light/description/light_records.h"
#include "wavecomb/light/kinds/mesh_light.h"
#include "wavecomb/light/sampling/linking.h"
#include "wavecomb/light/sampling/receiver.h"

namespace wavecomb {

/// Direction towards a light. `pdf` is a solid angle density that includes the selection of the
/// light. For delta lights, `pdf` is the selection probability, and is_delta is set. `weight` is
/// radiance / pdf (for delta lights, irradiance at normal incidence / pdf), so that the estimator
/// is f_cos * weight * MIS weight.
template <typename F>
struct LightSample {
  Vec3<F> wi;
  F distance;  ///< distance to the point on the light; kFarAway for infinite lights
  Color<F> weight;
  F pdf;
  Mask<F> is_delta;
  /// Whether light arrives at the point; if false, weight and pdf are 0 and wi is finite.
  Mask<F> valid;
  UInt<F> light;  ///< the selected light, or kNoLight
};

/// Returns the balance heuristic (E. Veach, "Robust Monte Carlo Methods", 1997, eq. 9.8) a / (a +
/// b), or 0 if a is 0.
template <typename F>
inline F balance_weight(const F& a, const F& b) {
  return select(a > 0.f, F(1.f / (1.f + b / select(a > 0.f, a, F(1.f)))), F(0.f));
}

/// Returns the light that sample_light() selects with u_light, or kNoLight.
template <typename F>
UInt<F> select_light_index(const LightView& view, const LightReceiver<F>& to, const F& u_light,
                           const Mask<F>& active);

/// Selects a light by power or by the light tree, and samples a point on the light as seen from
/// `to`. The random numbers u_light, u and v are in [0, 1). u_light is a multiple of 2^-24, as
/// samplers provide it.
template <typename F>
LightSample<F> sample_light(const LightView& view, const LightReceiver<F>& to, const F& u_light,
                            const F& u, const F& v, const Mask<F>& wanted);

template <typename F>
struct LightHit {
  Color<F> radiance;
  F pdf;  ///< density of sample_light() for the ray's direction; 0 for delta lights
};

/// Returns the radiance and sampling density of light `light` for the ray from `from.p` along
/// `along`, which hit the light's shape at distance t. Returns 0 for light kinds without a shape
/// and for inactive lanes.
template <typename F>
LightHit<F> light_hit(const LightView& view, const UInt<F>& light, const LightReceiver<F>& from,
                      const Vec3<F>& along, const F& t, const Mask<F>& hit_lanes);

/// Returns the sampling density of triangle light `light` for a hit at distance t along dir, or 0
/// if `light` is not a triangle light.
template <typename F>
F triangle_light_pdf(const LightView& view, const UInt<F>& light, const LightReceiver<F>& from,
                     const Vec3<F>& dir, const F& t, const Mask<F>& active);

/// Factors by which the contribution of lights is multiplied: the diffuse and specular multipliers
/// or, if a bounce hits a light that only light samples find (`LightRecord::sampled_only`), 0.
/// These factors are used only if `LightView::has_effects` is set.
template <typename F>
struct LightEffect {
  F diffuse, specular;   ///< multipliers of the diffuse response and of the specular response
  Mask<F> sampled_only;  ///< LightRecord::sampled_only
  Mask<F> applies;       ///< whether sampled_only is set or a multiplier is not 1
  UInt<F> shadow;        ///< LightRecord::shadow

  LightEffect(const LightView& view, const UInt<F>& light, const Mask<F>& active) {
    const UInt<F> record = detail::record_of<F>(view, light, active);
    const Mask<F> known = active & Mask<F>(record != UInt<F>(kNoLight));
    const detail::LightReader<F> reader(view.lights, record, known);
    diffuse = select(known, reader[&LightRecord::diffuse], F(1.f));
    specular = select(known, reader[&LightRecord::specular], F(1.f));
    sampled_only = known & Mask<F>(reader[&LightRecord::sampled_only] != UInt<F>(0u));
    applies = sampled_only | not_(Mask<F>(diffuse == F(1.f)) & Mask<F>(specular == F(1.f)));
    shadow = select(Mask<UInt<F>>(known), reader[&LightRecord::shadow], UInt<F>(kPlainShadow));
  }

  /// Returns the factor by which to multiply the emission of a light that a path hits. `share` is
  /// the diffuse fraction of the path's last bounce. A delta bounce counts as a specular bounce.
  Color<F> of_hit(const Mask<F>& bsdf_is_delta, bool from_camera, const Color<F>& share) const {
    return detail::factor_of_hit<F>(diffuse, specular, sampled_only, bsdf_is_delta, from_camera,
                                    share);
  }
};

/// Returns the probability with which sample_light() selects infinite light `light`.
inline float infinite_selection_pdf(const LightView& view, uint32_t light) {
  if (view.by_tree) return view.tree.infinite_pdf[light];
  return view.selection_pdf ? view.selection_pdf[light] : view.lights[light].selection_pdf;
}

/// Returns the balance heuristic weight of a bounce with density `p` (ignored for delta lobes). The
/// other techniques are light samples with density `light_pdf`, and light paths, whose density is
/// `others` times `p`.
template <typename F>
inline F joint_bounce_weight(const F& p, const F& light_pdf, const Mask<F>& is_delta,
                             const F& others) {
  const Mask<F> sampled = not_(is_delta) & (p > 0.f);
  const F by_light = select(sampled, F(light_pdf / select(sampled, p, F(1.f))), F(0.f));
  return 1.f / F(F(1.f + by_light) + others);
}

}  // namespace wavecomb
