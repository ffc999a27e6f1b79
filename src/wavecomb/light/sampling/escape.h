// SPDX-License-Identifier: Apache-2.0
/// Radiance of infinite lights along rays that leave the scene.
#pragma once

#include "wavecomb/light/emission/aim.h"
#include "wavecomb/light/filters/shaping.h"
#include "wavecomb/light/kinds/kinds.h"
#include "wavecomb/light/sampling/light_sample.h"
#include "wavecomb/light/sampling/moving.h"

namespace wavecomb {

namespace detail {

/// Returns Emission::density (light/emission/emission.h) of a path from infinite light `light` that
/// arrives at `from` along -dir.
template <typename F>
inline F infinite_emission_density(const LightView& view, uint32_t light, const Vec3<F>& from,
                                   const Vec3<F>& dir, const Mask<F>& active) {
  const LightRecord& record = view.lights[light];
  if (record.camera_only != 0) return F(0.f);
  const LightReader<F> reader(record, active);
  const float selection_pdf = view.selection_pdf ? view.selection_pdf[light] : record.selection_pdf;
  F density = visit(record.kind, [&]<typename Kind>(Kind) {
    return Kind::template emission_density<F>({view, reader, from, dir, F(0.f), active});
  });
  if (view.aim) density = density * aim_density_infinite<F>(view, from, dir);
  return select(is_finite(density), F(density * selection_pdf), F(0.f));
}

}  // namespace detail

/// Returns radiance times MIS weight of infinite light `light` for a ray from `from` along `dir`
/// that leaves the scene: one term of escaped_radiance.
template <typename F>
inline Color<F> infinite_light_radiance(const LightView& view, uint32_t light, const Vec3<F>& from,
                                        const Vec3<F>& dir, const F& bsdf_pdf,
                                        const Mask<F>& bsdf_is_delta, const Mask<F>& active,
                                        bool from_camera = false, const UInt<F>& link = UInt<F>(0u),
                                        const F& ratio = F(0.f), const F& time = F(0.5f),
                                        const Color<F>& share = Color<F>(F(0.f))) {
  const LightRecord& record = view.lights[light];
  Vec3<F> local_from = from, along = dir;
  if (view.motions) [[unlikely]] {
    const LightPose<F> pose = light_pose<F>(view, UInt<F>(light), time, active);
    local_from = pose.point_to_rest(from);
    along = pose.to_rest(dir);
  }
  detail::KindHit<F> hit = visit(record.kind, [&]<typename Kind>(Kind) {
    return Kind::template escape<F>({view, record, local_from, along, active});
  });
  if (record.shaping != kNoShaping) [[unlikely]]
    hit.radiance = detail::shaped<F>(view, UInt<F>(record.shaping), -along, hit.radiance, active);
  const F light_pdf = hit.pdf * infinite_selection_pdf(view, light);
  F weight = select(bsdf_is_delta, F(1.f), balance_weight<F>(bsdf_pdf, light_pdf));
  if (view.emits_paths()) [[unlikely]]
    weight = joint_bounce_weight<F>(
        bsdf_pdf, light_pdf, bsdf_is_delta,
        F(ratio * detail::infinite_emission_density<F>(view, light, from, dir, active)));
  if (view.has_effects) [[unlikely]]
    hit.radiance =
        hit.radiance *
        LightEffect<F>(view, UInt<F>(light), active).of_hit(bsdf_is_delta, from_camera, share);
  if (view.links.members)
    weight = select(illuminates<F>(view, link, UInt<F>(light), active), weight, F(0.f));
  return hit.radiance * weight;
}

/// Returns the sum over all infinite lights of radiance times MIS weight for a ray from `from`
/// along `dir` that leaves the scene. The weight is the balance heuristic of `bsdf_pdf` and the pdf
/// of light sampling, or 1 for delta bounces and camera rays. `share` is the diffuse fraction of
/// the bounce, by colour. `ratio` is PathState::ratio; it adds light paths to the weight if the
/// render has any.
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
