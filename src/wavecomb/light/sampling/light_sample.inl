// SPDX-License-Identifier: Apache-2.0
/// Definitions of the function templates in light_sample.h, for the translation units that
/// instantiate them.
#pragma once

#include "wavecomb/light/filters/filter.h"
#include "wavecomb/light/filters/shaping.h"
#include "wavecomb/light/kinds/kinds.h"
#include "wavecomb/light/kinds/triangle.h"
#include "wavecomb/light/sampling/light_sample.h"
#include "wavecomb/light/sampling/moving.h"
#include "wavecomb/light/sampling/tree_choice.h"

namespace wavecomb {

namespace detail {

/// Returns the light that the PowerTable selects for u_light, a multiple of 2^-24 in [0, 1). All
/// arithmetic is in integers, so that selection_pdf is exact.
template <typename F>
inline UInt<F> light_by_power(const LightView& view, const F& u_light, const Mask<F>& active) {
  using U = UInt<F>;
  if (view.count == 1) return U(0u);
  const PowerTable& table = view.power_table;
  const U number = U(to_int<F>(F(u_light * 0x1p24f)));
  const Mask<U> triangle = number >= U(table.split);
  const U k = number - select(triangle, U(table.split), U(0u));
  const U shift = select(triangle, U(table.shift[1]), U(table.shift[0]));
  const U bin = k >> shift;
  const U entry =
      gather<U>(table.bins, bin + select(triangle, U(table.triangle_bins), U(0u)), Mask<U>(active));
  const U other = entry >> shift;
  const U rest = k - (bin << shift), threshold = entry - (other << shift);
  return select(rest < threshold, bin, other) + select(triangle, U(view.first_triangle), U(0u));
}

/// Light selected by the light tree or by power.
template <typename F>
struct SelectedLight {
  UInt<F> light;
  F probability;   ///< selection probability, unless it is stored in the light's record
  Mask<F> active;  ///< lanes with a light
  bool of_record;

  SelectedLight(const LightView& view, const LightReceiver<F>& to, const F& u_light,
                const Mask<F>& wanted)
      : probability(0.f), active(wanted), of_record(!view.by_tree && !view.selection_pdf) {
    if (view.by_tree) {
      const LightChoice<F> choice = choose_by_tree<F>(view, to, u_light, wanted);
      light = choice.light;
      probability = choice.pdf;
      active = wanted & (choice.pdf > 0.f);
    } else {
      light = light_by_power<F>(view, u_light, wanted);
      if (view.selection_pdf) probability = gather<F>(view.selection_pdf, light, wanted);
    }
  }
  F pdf(const F& recorded) const { return of_record ? recorded : probability; }
};

/// Returns the probability with which sample_light() selects finite light `light`; `recorded` is
/// the selection_pdf in the light's record.
template <typename F>
inline F finite_selection_pdf(const LightView& view, const UInt<F>& light, const F& recorded,
                              const LightReceiver<F>& to, const Mask<F>& active) {
  if (view.by_tree) return tree_pdf<F>(view, light, to, active);
  return view.selection_pdf ? gather<F>(view.selection_pdf, light, active) : recorded;
}

/// Calls `one(kind, lanes)` for each kind of light in the active lanes.
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

template <typename F>
UInt<F> select_light_index(const LightView& view, const LightReceiver<F>& to, const F& u_light,
                           const Mask<F>& active) {
  if (view.count == 0 || none(active)) return UInt<F>(kNoLight);
  if (view.by_tree) return detail::choose_by_tree<F>(view, to, u_light, active).light;
  return detail::light_by_power<F>(view, u_light, active);
}

template <typename F>
LightSample<F> sample_light(const LightView& view, const LightReceiver<F>& to, const F& u_light,
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
  const detail::SelectedLight<F> selected(view, to, u_light, wanted);
  const UInt<F>& index = selected.light;
  result.light = index;
  const Mask<F>& active = selected.active;
  const auto put = [&](const detail::KindSample<F>& s, const F& selection_pdf,
                       const Mask<F>& lanes) {
    const F pdf = s.pdf * selection_pdf;
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
      s.radiance = detail::mesh_light_sample_radiance<F>(view, index, light, s, triangle);
    put(s, selected.pdf(light.selection_pdf), triangle);
  }
  const Mask<F> others = active & not_(triangle);
  if (none(others)) return result;
  const detail::LightReader<F> any_light(view.lights, index, others);
  detail::for_each_kind<F>(
      any_light[&LightRecord::kind], others, [&](LightKind kind, const Mask<F>& lanes) {
        // Read the records of one light kind at a time. Often there is only one light of a kind, so
        // that all lanes of this kind read the same record.
        const detail::LightReader<F> light(view.lights, index, lanes);
        Vec3<F> from = p;
        if (view.motions) [[unlikely]]
          from = light_pose<F>(view, index, to.time, lanes).point_to_rest(p);
        detail::KindSample<F> s = visit(kind, [&]<typename Kind>(Kind) {
          return Kind::template sample<F>({view, index, light, from, u, v, lanes});
        });
        if (view.shapings)
          s.radiance =
              detail::shaped<F>(view, light.shaping(), -s.wi, s.radiance, lanes & (s.pdf > 0.f));
        if (view.filters) [[unlikely]]
          s.radiance = detail::filtered<F>(view, light[&LightRecord::filter],
                                           {fma(s.wi, s.distance, from), -s.wi, s.distance},
                                           s.radiance, lanes & (s.pdf > 0.f));
        if (view.motions) [[unlikely]]
          s.wi = light_pose<F>(view, index, to.time, lanes).to_world(s.wi);
        put(s, selected.pdf(light.selection_pdf()), lanes);
      });
  return result;
}

template <typename F>
LightHit<F> light_hit(const LightView& view, const UInt<F>& light, const LightReceiver<F>& from,
                      const Vec3<F>& along, const F& t, const Mask<F>& hit_lanes) {
  LightHit<F> result{Color<F>(F(0.f)), F(0.f)};
  const Mask<F> active = hit_lanes & Mask<F>(light < UInt<F>(view.first_triangle));
  if (none(active)) return result;
  const detail::LightReader<F> reader(view.lights, light, active);
  const F selection_pdf =
      detail::finite_selection_pdf<F>(view, light, reader.selection_pdf(), from, active);
  Vec3<F> origin = from.p, dir = along;
  if (view.motions) [[unlikely]] {
    const LightPose<F> pose = light_pose<F>(view, light, from.time, active);
    origin = pose.point_to_rest(origin);
    dir = pose.to_rest(dir);
  }
  detail::for_each_kind<F>(
      reader[&LightRecord::kind], active, [&](LightKind kind, const Mask<F>& lanes) {
        detail::KindHit<F> hit = visit(kind, [&]<typename Kind>(Kind) {
          return Kind::template hit<F>({view, reader, origin, dir, t, lanes});
        });
        if (view.shapings)
          hit.radiance = detail::shaped<F>(view, reader.shaping(), -dir, hit.radiance, lanes);
        if (view.filters) [[unlikely]]
          hit.radiance = detail::filtered<F>(view, reader[&LightRecord::filter],
                                             {fma(dir, t, origin), -dir, t}, hit.radiance, lanes);
        result.radiance = select<F>(lanes, hit.radiance, result.radiance);
        result.pdf = select(lanes, F(hit.pdf * selection_pdf), result.pdf);
      });
  return result;
}

template <typename F>
F triangle_light_pdf(const LightView& view, const UInt<F>& light, const LightReceiver<F>& from,
                     const Vec3<F>& dir, const F& t, const Mask<F>& active) {
  const Mask<F> lanes = active & Mask<F>(light >= UInt<F>(view.first_triangle));
  if (none(lanes)) return F(0.f);
  const detail::TriangleDensity<F> d = detail::triangle_pdf<F>(view, light, dir, t, lanes);
  const F selection_pdf =
      detail::finite_selection_pdf<F>(view, light, d.selection_pdf, from, lanes);
  return select(lanes, F(d.solid_angle * selection_pdf), F(0.f));
}

}  // namespace wavecomb
