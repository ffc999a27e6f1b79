// SPDX-License-Identifier: Apache-2.0
/// Light sampling: choosing a light, a point on it, and the densities that go with it.
///
/// An estimator of direct light at p is f(wi) |cos| * LightSample::weight * MIS weight; the other
/// half of MIS comes from light_hit, triangle_light_pdf and escaped_radiance, whose `pdf` is what
/// sample_light would have given for the same direction.
#pragma once

#include "wavecomb/core/vec.h"
#include "wavecomb/light/aim.h"
#include "wavecomb/light/filter.h"
#include "wavecomb/light/kinds.h"
#include "wavecomb/light/light_tree.h"
#include "wavecomb/light/link.h"
#include "wavecomb/light/mesh_light.h"
#include "wavecomb/light/moving.h"
#include "wavecomb/light/shaping.h"
#include "wavecomb/light/triangle.h"
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

namespace detail {

/// Index of a light out of the 24 bits of u_pick (a multiple of 2^-24 in [0, 1)), as PickTable
/// says: integers all the way, so that pick_pdf is exact.
template <typename F>
inline UInt<F> pick_light(const LightView& view, const F& u_pick, const Mask<F>& active) {
  using U = UInt<F>;
  if (view.count == 1) return U(0u);
  const PickTable& pick = view.pick;
  const U number = U(to_int<F>(F(u_pick * 0x1p24f)));
  const Mask<U> triangle = number >= U(pick.split);
  const U k = number - select(triangle, U(pick.split), U(0u));
  const U shift = select(triangle, U(pick.shift[1]), U(pick.shift[0]));
  const U bin = k >> shift;
  const U entry =
      gather<U>(pick.bins, bin + select(triangle, U(pick.triangle_bins), U(0u)), Mask<U>(active));
  const U other = entry >> shift;
  const U rest = k - (bin << shift), threshold = entry - (other << shift);
  return select(rest < threshold, bin, other) + select(triangle, U(view.first_triangle), U(0u));
}

/// A choice, by tree or by shares.
template <typename F>
struct LightPick {
  UInt<F> light;
  F probability;   ///< where it is not what the light's record says
  Mask<F> active;  ///< lanes that have a light
  bool of_record;

  LightPick(const LightView& view, const LightReceiver<F>& to, const F& u_pick,
            const Mask<F>& wanted)
      : probability(0.f), active(wanted), of_record(!view.by_tree && !view.pick_pdf) {
    if (view.by_tree) {
      const LightChoice<F> choice = choose_by_tree<F>(view, to, u_pick, wanted);
      light = choice.light;
      probability = choice.pdf;
      active = wanted & (choice.pdf > 0.f);
    } else {
      light = pick_light<F>(view, u_pick, wanted);
      if (view.pick_pdf) probability = gather<F>(view.pick_pdf, light, wanted);
    }
  }
  F pdf(const F& recorded) const { return of_record ? recorded : probability; }
};

/// Probability with which sample_light chooses finite light `light`, whose record says `recorded`.
template <typename F>
inline F finite_pick_pdf(const LightView& view, const UInt<F>& light, const F& recorded,
                         const LightReceiver<F>& to, const Mask<F>& active) {
  if (view.by_tree) return tree_pdf<F>(view, light, to, active);
  return view.pick_pdf ? gather<F>(view.pick_pdf, light, active) : recorded;
}

/// Emission::density (light/emission.h) of a path from infinite light `light` that came along -dir
/// to `from`.
template <typename F>
inline F infinite_emission_density(const LightView& view, uint32_t light, const Vec3<F>& from,
                                   const Vec3<F>& dir, const Mask<F>& active) {
  const LightRecord& record = view.lights[light];
  if (record.camera_only != 0) return F(0.f);
  const LightReader<F> reader(record, active);
  const float pick = view.pick_pdf ? view.pick_pdf[light] : record.pick_pdf;
  F density = emission_density_of_kind<F>(static_cast<LightKind>(record.kind),
                                          {view, reader, from, dir, F(0.f), active});
  if (view.aim) density = density * aim_from_afar<F>(view, from, dir);
  return select(is_finite(density), F(density * pick), F(0.f));
}

/// Runs `one(kind, lanes)` for each kind of light among the active lanes.
template <typename F, typename Function>
inline void for_each_kind(const UInt<F>& kind, const Mask<F>& active, const Function& one) {
  for (Mask<F> pending = active; any(pending);) {
    const uint32_t k = first_active(kind, Mask<UInt<F>>(pending));
    const Mask<F> lanes = pending & Mask<F>(kind == UInt<F>(k));
    one(static_cast<LightKind>(k), lanes);
    pending = pending & not_(lanes);
  }
}

}  // namespace detail

/// The light that sample_light chooses for u_pick, where there is one.
template <typename F>
UInt<F> chosen_light(const LightView& view, const LightReceiver<F>& to, const F& u_pick,
                     const Mask<F>& active) {
  if (view.count == 0 || none(active)) return UInt<F>(kNoLight);
  if (view.by_tree) return detail::choose_by_tree<F>(view, to, u_pick, active).light;
  return detail::pick_light<F>(view, u_pick, active);
}

/// Chooses a light, by power or by tree, and a point on it as seen from `to`. Numbers in [0, 1);
/// u_pick is a multiple of 2^-24, as samplers give it.
template <typename F>
LightSample<F> sample_light(const LightView& view, const LightReceiver<F>& to, const F& u_pick,
                            const F& u, const F& v, const Mask<F>& wanted) {
  const F zero(0.f);
  const Vec3<F>& p = to.p;
  LightSample<F> result{Vec3<F>(zero, zero, F(1.f)),
                        F(kFarAway),
                        Color<F>(zero),
                        zero,
                        Mask<F>(false),
                        Mask<F>(false),
                        UInt<F>(kNoLight)};
  if (view.count == 0 || none(wanted)) return result;
  const detail::LightPick<F> pick(view, to, u_pick, wanted);
  const UInt<F>& index = pick.light;
  result.light = index;
  const Mask<F>& active = pick.active;
  const auto put = [&](const detail::KindSample<F>& s, const F& pick_pdf, const Mask<F>& lanes) {
    const F pdf = s.pdf * pick_pdf;
    const Mask<F> valid = lanes & (pdf > 0.f) & is_finite(pdf) & not_(is_black(s.radiance));
    const F inverse = 1.f / select(valid, pdf, F(1.f));
    result.wi = select<F>(valid, s.wi, result.wi);
    result.distance = select(valid, s.distance, result.distance);
    result.weight = select<F>(valid, s.radiance * inverse, result.weight);
    result.pdf = select(valid, pdf, result.pdf);
    result.is_delta = result.is_delta | (valid & s.is_delta);
    result.valid = result.valid | valid;
  };
  const Mask<F> triangle = active & Mask<F>(index >= UInt<F>(view.first_triangle));
  if (any(triangle)) {
    const detail::TriangleReader<F> light(view, index, triangle);
    detail::KindSample<F> s = detail::sample_triangle<F>(light, view, p, u, v, triangle);
    if (view.mesh_lights) [[unlikely]]
      s.radiance = detail::of_mesh_light<F>(view, index, light, s, triangle);
    put(s, pick.pdf(light.pick_pdf), triangle);
  }
  const Mask<F> others = active & not_(triangle);
  if (none(others)) return result;
  const detail::LightReader<F> any_light(view.lights, index, others);
  detail::for_each_kind<F>(
      any_light[&LightRecord::kind], others, [&](LightKind kind, const Mask<F>& lanes) {
        // Often there is one light of a kind, whose record is the same in all
        // its lanes.
        const detail::LightReader<F> light(view.lights, index, lanes);
        Vec3<F> from = p;
        if (view.motions) [[unlikely]]
          from = light_pose<F>(view, index, to.time, lanes).point_to_rest(p);
        detail::KindSample<F> s =
            detail::sample_kind<F>(kind, {view, index, light, from, u, v, lanes});
        if (view.shapings)
          s.radiance =
              detail::shaped<F>(view, light.shaping(), -s.wi, s.radiance, lanes & (s.pdf > 0.f));
        if (view.filters) [[unlikely]]
          s.radiance = detail::filtered<F>(view, light[&LightRecord::filter],
                                           {fma(s.wi, s.distance, from), -s.wi, s.distance},
                                           s.radiance, lanes & (s.pdf > 0.f));
        if (view.motions) [[unlikely]]
          s.wi = light_pose<F>(view, index, to.time, lanes).to_world(s.wi);
        put(s, pick.pdf(light.pick_pdf()), lanes);
      });
  return result;
}

template <typename F>
struct LightHit {
  Color<F> radiance;
  F pdf;  ///< what sample_light would have given for this direction, 0 for delta lights
};

/// Radiance that light `light` sends back along the ray from.p + t along which hit its shape at
/// distance t. Kinds without a shape and inactive lanes give 0.
template <typename F>
LightHit<F> light_hit(const LightView& view, const UInt<F>& light, const LightReceiver<F>& from,
                      const Vec3<F>& along, const F& t, const Mask<F>& hit_lanes) {
  LightHit<F> result{Color<F>(F(0.f)), F(0.f)};
  const Mask<F> active = hit_lanes & Mask<F>(light < UInt<F>(view.first_triangle));
  if (none(active)) return result;
  const detail::LightReader<F> reader(view.lights, light, active);
  const F pick_pdf = detail::finite_pick_pdf<F>(view, light, reader.pick_pdf(), from, active);
  Vec3<F> origin = from.p, dir = along;
  if (view.motions) [[unlikely]] {
    const LightPose<F> pose = light_pose<F>(view, light, from.time, active);
    origin = pose.point_to_rest(origin);
    dir = pose.to_rest(dir);
  }
  detail::for_each_kind<F>(
      reader[&LightRecord::kind], active, [&](LightKind kind, const Mask<F>& lanes) {
        detail::KindHit<F> hit = detail::hit_kind<F>(kind, {view, reader, origin, dir, t, lanes});
        if (view.shapings)
          hit.radiance = detail::shaped<F>(view, reader.shaping(), -dir, hit.radiance, lanes);
        if (view.filters) [[unlikely]]
          hit.radiance = detail::filtered<F>(view, reader[&LightRecord::filter],
                                             {fma(dir, t, origin), -dir, t}, hit.radiance, lanes);
        result.radiance = select<F>(lanes, hit.radiance, result.radiance);
        result.pdf = select(lanes, F(hit.pdf * pick_pdf), result.pdf);
      });
  return result;
}

/// The sampling density of triangle light `light` for a hit at distance t along dir; 0 for others.
template <typename F>
F triangle_light_pdf(const LightView& view, const UInt<F>& light, const LightReceiver<F>& from,
                     const Vec3<F>& dir, const F& t, const Mask<F>& active) {
  const Mask<F> lanes = active & Mask<F>(light >= UInt<F>(view.first_triangle));
  if (none(lanes)) return F(0.f);
  const detail::TriangleDensity<F> d = detail::triangle_pdf<F>(view, light, dir, t, lanes);
  const F pick_pdf = detail::finite_pick_pdf<F>(view, light, d.pick_pdf, from, lanes);
  return select(lanes, F(d.solid_angle * pick_pdf), F(0.f));
}

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

/// Radiance * MIS weight of infinite light `light` for a ray that left `from` and the scene along
/// dir, as
/// escaped_radiance sums them up.
template <typename F>
inline Color<F> infinite_light_radiance(const LightView& view, uint32_t light, const Vec3<F>& from,
                                        const Vec3<F>& dir, const F& bsdf_pdf,
                                        const Mask<F>& bsdf_is_delta, const Mask<F>& active,
                                        bool from_camera = false, const UInt<F>& link = UInt<F>(0u),
                                        const F& ratio = F(0.f), const F& time = F(0.5f),
                                        const Color<F>& share = Color<F>(F(0.f))) {
  const LightRecord& record = view.lights[light];
  Vec3<F> seen_from = from, along = dir;
  if (view.motions) [[unlikely]] {
    const LightPose<F> pose = light_pose<F>(view, UInt<F>(light), time, active);
    seen_from = pose.point_to_rest(from);
    along = pose.to_rest(dir);
  }
  detail::KindHit<F> hit = detail::escape_kind<F>(static_cast<LightKind>(record.kind),
                                                  {view, record, seen_from, along, active});
  if (record.shaping != kNoShaping) [[unlikely]]
    hit.radiance = detail::shaped<F>(view, UInt<F>(record.shaping), -along, hit.radiance, active);
  const F light_pdf = hit.pdf * infinite_pick_pdf(view, light);
  F weight = select(bsdf_is_delta, F(1.f), balance_weight<F>(bsdf_pdf, light_pdf));
  if (view.sends_paths()) [[unlikely]]
    weight = joint_bounce_weight<F>(
        bsdf_pdf, light_pdf, bsdf_is_delta,
        F(ratio * detail::infinite_emission_density<F>(view, light, from, dir, active)));
  if (view.has_effects) [[unlikely]]
    hit.radiance =
        hit.radiance *
        LightEffect<F>(view, UInt<F>(light), active).of_hit(bsdf_is_delta, from_camera, share);
  if (view.links.members)
    weight = select(shines_on<F>(view, link, UInt<F>(light), active), weight, F(0.f));
  return hit.radiance * weight;
}

/// Sum over all infinite lights of radiance * MIS weight for a ray that left `from` and the scene
/// along dir;
/// the weight is balance(bsdf_pdf, pdf of sample_light), or 1 where bsdf_is_delta (camera rays
/// too); `share` of the bounce is diffuse. `ratio`: PathState::ratio, where lights send paths,
/// which then share in the weight.
template <typename F>
inline Color<F> escaped_radiance(const LightView& view, const Vec3<F>& from, const Vec3<F>& dir,
                                 const F& bsdf_pdf, const Mask<F>& bsdf_is_delta,
                                 const Mask<F>& active, bool from_camera = false,
                                 const UInt<F>& link = UInt<F>(0u), const F& ratio = F(0.f),
                                 const F& time = F(0.5f),
                                 const Color<F>& share = Color<F>(F(0.f))) {
  Color<F> sum(F(0.f));
  for (uint32_t i = 0; i < view.infinite_count; ++i)
    sum += infinite_light_radiance<F>(view, i, from, dir, bsdf_pdf, bsdf_is_delta, active,
                                      from_camera, link, ratio, time, share);
  return select<F>(active, sum, Color<F>(F(0.f)));
}

}  // namespace wavecomb
