// SPDX-License-Identifier: Apache-2.0
/// Light sampling: choosing a light, a point on it, and the densities that go with it.
///
/// An estimator of direct light at p is f(wi) |cos| * LightSample::weight * MIS weight; the other
/// half of MIS comes from light_hit, triangle_light_pdf and escaped_radiance (escape.h), whose
/// `pdf` is what sample_light would have given for the same direction. Bodies are in light.inl; the
/// units of shared_kernels.h instantiate them.
#pragma once

#include "wavecomb/core/vec.h"
#include "wavecomb/light/link.h"
#include "wavecomb/light/mesh_light.h"
#include "wavecomb/light/receiver.h"
#include "wavecomb/scene/light_data.h"

namespace wavecomb {

/// A direction towards a light. `pdf` is a solid-angle density that includes the choice of the
/// light; for delta lights it is the probability of the choice and is_delta is set. `weight` =
/// radiance / pdf (delta: irradiance at normal incidence / pdf), so that the estimator is f_cos *
/// weight * MIS.
template <typename F>
struct LightSample {
  Vec3<F> wi;
  F distance;  ///< to the point on the light; kFarAway for infinite lights
  Color<F> weight;
  F pdf;
  Mask<F> is_delta;
  Mask<F> valid;  ///< false: no light arrives; weight and pdf are 0, wi is finite
  UInt<F> light;  ///< the light that was chosen, where there is one
};

/// Balance heuristic (E. Veach, "Robust Monte Carlo Methods", 1997, eq. 9.8): a / (a + b), 0 where
/// a is 0.
template <typename F>
inline F balance_weight(const F& a, const F& b) {
  return select(a > 0.f, F(1.f / (1.f + b / select(a > 0.f, a, F(1.f)))), F(0.f));
}

/// The light that sample_light chooses for u_pick, where there is one.
template <typename F>
UInt<F> chosen_light(const LightView& view, const LightReceiver<F>& to, const F& u_pick,
                     const Mask<F>& active);

/// Chooses a light, by power or by tree, and a point on it as seen from `to`. Numbers in [0, 1);
/// u_pick is a multiple of 2^-24, as samplers give it.
template <typename F>
LightSample<F> sample_light(const LightView& view, const LightReceiver<F>& to, const F& u_pick,
                            const F& u, const F& v, const Mask<F>& wanted);

template <typename F>
struct LightHit {
  Color<F> radiance;
  F pdf;  ///< what sample_light would have given for this direction, 0 for delta lights
};

/// Radiance that light `light` sends back along the ray from.p + t along which hit its shape at
/// distance t. Kinds without a shape and inactive lanes give 0.
template <typename F>
LightHit<F> light_hit(const LightView& view, const UInt<F>& light, const LightReceiver<F>& from,
                      const Vec3<F>& along, const F& t, const Mask<F>& hit_lanes);

/// The sampling density of triangle light `light` for a hit at distance t along dir; 0 for others.
template <typename F>
F triangle_light_pdf(const LightView& view, const UInt<F>& light, const LightReceiver<F>& from,
                     const Vec3<F>& dir, const F& t, const Mask<F>& active);

/// What becomes of the light that the two techniques bring where lights do not give all surfaces
/// the same. Run only where LightView::has_effects.
template <typename F>
struct LightEffect {
  F diffuse, specular;   ///< factors of the two parts of the response
  Mask<F> sampled_only;  ///< LightRecord::sampled_only
  Mask<F> applies;       ///< that, or a factor is not 1
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

  /// Factor of what a path gets that meets the light, `share` of whose bounce is diffuse; a
  /// mirror's image of it is specular.
  Color<F> of_hit(const Mask<F>& bsdf_is_delta, bool from_camera, const Color<F>& share) const {
    return detail::factor_of_hit<F>(diffuse, specular, sampled_only, bsdf_is_delta, from_camera,
                                    share);
  }
};

/// Probability with which sample_light chooses infinite light `light`.
inline float infinite_pick_pdf(const LightView& view, uint32_t light) {
  if (view.by_tree) return view.tree.infinite_pdf[light];
  return view.pick_pdf ? view.pick_pdf[light] : view.lights[light].pick_pdf;
}

/// Balance heuristic of three: weight of a bounce of density `p` (of a delta lobe: any), beside
/// light samples of density `light_pdf` and paths from the lights of density `others` times that of
/// the bounce.
template <typename F>
inline F joint_bounce_weight(const F& p, const F& light_pdf, const Mask<F>& is_delta,
                             const F& others) {
  const Mask<F> sampled = not_(is_delta) & (p > 0.f);
  const F by_light = select(sampled, F(light_pdf / select(sampled, p, F(1.f))), F(0.f));
  return 1.f / F(F(1.f + by_light) + others);
}

}  // namespace wavecomb
