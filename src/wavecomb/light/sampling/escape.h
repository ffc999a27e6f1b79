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

/// Ray that leaves the scene, and the bounce that started it.
template <typename F>
struct EscapedRay {
  Vec3<F> from, dir;
  F bsdf_pdf{0.f};          ///< density of the bounce, per sr
  Mask<F> is_delta{false};  ///< whether the ray is a camera ray or a delta bounce, which light
                            ///< sampling cannot produce
  bool from_camera = false;
  UInt<F> link{0u};          ///< light linking class of the surface at which the ray starts
  F ratio{0.f};              ///< PathState::ratio, for MIS with light paths
  F time{0.5f};              ///< shutter time in [0, 1]
  Color<F> diffuse{F(0.f)};  ///< diffuse fraction of the bounce for each colour
};

/// Returns radiance times MIS weight of infinite light `light` for a ray that left the scene.
template <typename F>
inline Color<F> infinite_light_radiance(const LightView& view, uint32_t light,
                                        const EscapedRay<F>& ray, const Mask<F>& active) {
  const LightRecord& record = view.lights[light];
  Vec3<F> local_from = ray.from, along = ray.dir;
  if (view.motions) [[unlikely]] {
    const LightPose<F> pose = light_pose<F>(view, UInt<F>(light), ray.time, active);
    local_from = pose.point_to_rest(ray.from);
    along = pose.to_rest(ray.dir);
  }
  detail::KindHit<F> hit = visit(record.kind, [&]<typename Kind>(Kind) {
    return Kind::template escape<F>({view, record, local_from, along, active});
  });
  if (record.shaping != kNoShaping) [[unlikely]]
    hit.radiance = detail::shaped<F>(view, UInt<F>(record.shaping), -along, hit.radiance, active);
  const F light_pdf = hit.pdf * infinite_selection_pdf(view, light);
  F weight = select(ray.is_delta, F(1.f), balance_weight<F>(ray.bsdf_pdf, light_pdf));
  if (view.emits_paths()) [[unlikely]]
    weight = joint_bounce_weight<F>(ray.bsdf_pdf, light_pdf, ray.is_delta,
                                    F(ray.ratio * detail::infinite_emission_density<F>(
                                                      view, light, ray.from, ray.dir, active)));
  if (view.has_effects) [[unlikely]]
    hit.radiance = hit.radiance * LightEffect<F>(view, UInt<F>(light), active)
                                      .of_hit(ray.is_delta, ray.from_camera, ray.diffuse);
  if (view.links.members)
    weight = select(illuminates<F>(view, ray.link, UInt<F>(light), active), weight, F(0.f));
  return hit.radiance * weight;
}

/// Returns the radiance that a ray which leaves the scene receives from all infinite lights,
/// weighted for MIS. The MIS weight is the balance heuristic of bounce density and light sampling
/// density, or 1 for delta bounces and camera rays.
template <typename F>
inline Color<F> escaped_radiance(const LightView& view, const EscapedRay<F>& ray,
                                 const Mask<F>& active) {
  Color<F> sum(F(0.f));
  for (uint32_t i = 0; i < view.infinite_count; ++i)
    sum += infinite_light_radiance<F>(view, i, ray, active);
  return select<F>(active, sum, Color<F>(F(0.f)));
}

}  // namespace wavecomb
