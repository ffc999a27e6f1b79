// SPDX-License-Identifier: Apache-2.0
/// Definitions of the function templates in emission.h, for the translation units that instantiate
/// them.
#pragma once

#include "wavecomb/light/emission/aim.h"
#include "wavecomb/light/emission/emission.h"
#include "wavecomb/light/sampling/escape.h"
#include "wavecomb/light/sampling/light_sample.inl"

namespace wavecomb {

namespace detail {

/// Returns the lanes whose light emits light paths.
template <typename F>
inline Mask<F> emits_paths(const LightView& view, const UInt<F>& light, const Mask<F>& active) {
  using U = UInt<F>;
  const Mask<F> listed = active & Mask<F>(light < U(view.count));
  const Mask<F> triangle = listed & Mask<F>(light >= U(view.first_triangle));
  const Mask<F> record = listed & not_(triangle);
  Mask<F> emits = listed;
  if (any(triangle) && view.mesh_lights)
    emits = emits & (not_(triangle) | Mask<F>(record_of<F>(view, light, triangle) == U(kNoLight)));
  if (any(record)) {
    const LightReader<F> reader(view.lights, light, record);
    emits = emits & (not_(record) | Mask<F>(reader[&LightRecord::camera_only] == U(0u)));
  }
  return emits;
}

/// Returns the probability with which sample_emission() selects a light. `recorded` is the
/// selection_pdf in the light's record.
template <typename F>
inline F emission_selection_pdf(const LightView& view, const UInt<F>& light, const F& recorded,
                                const Mask<F>& active) {
  return view.selection_pdf ? gather<F>(view.selection_pdf, light, active) : recorded;
}

/// Returns an upper bound of the magnitudes of the terms in p, u and v whose sum is a point on a
/// light. The point's rounding error is proportional to this bound.
template <typename F>
inline F size_of_terms(const Vec3<F>& p, const Vec3<F>& u, const Vec3<F>& v) {
  const auto most = [](const Vec3<F>& a) { return max(max(abs(a.x), abs(a.y)), abs(a.z)); };
  return F(most(p) + most(u)) + most(v);
}

/// Returns the lanes whose light no bounce can hit: point lights, and distant lights without an
/// angle.
template <typename F>
inline Mask<F> is_delta_light(const LightReader<F>& light, const Mask<F>& active) {
  Mask<F> delta(false);
  for_each_kind<F>(light[&LightRecord::kind], active, [&](LightKind kind, const Mask<F>& lanes) {
    delta = delta | (lanes & visit(kind, [&]<typename Kind>(Kind) {
                       return Kind::template is_delta<F>(light);
                     }));
  });
  return delta;
}

}  // namespace detail

template <typename F>
[[gnu::noinline]] Emission<F> sample_emission(const LightView& view, const EmissionNumbers<F>& r,
                                              const Mask<F>& wanted) {
  using U = UInt<F>;
  Emission<F> out{Vec3<F>(F(0.f)),  Vec3<F>(F(0.f), F(0.f), F(1.f)),
                  Color<F>(F(0.f)), F(0.f),
                  U(kNoLight),      Mask<F>(false)};
  if (!view.emits_paths() || view.count == 0 || none(wanted)) return out;
  const U light = detail::light_by_power<F>(view, r.light, wanted);
  const Mask<F> active = detail::emits_paths<F>(view, light, wanted);
  const auto put = [&](const detail::KindEmission<F>& e, const F& recorded, const F& size,
                       const Mask<F>& lanes) {
    const F density = e.density * detail::emission_selection_pdf<F>(view, light, recorded, lanes);
    const Mask<F> valid = lanes & (density > 0.f) & is_finite(density) & not_(is_black(e.radiance));
    const F inverse = 1.f / select(valid, density, F(1.f));
    // Offset the origin from the light by more than its rounding error.
    out.o = select<F>(valid, fma(e.n, F(size * 0x1p-20f), e.p), out.o);
    out.d = select<F>(valid, e.d, out.d);
    out.flux = select<F>(valid, e.radiance * inverse, out.flux);
    out.density = select(valid, density, out.density);
    out.valid = out.valid | valid;
  };
  const Mask<F> triangle = active & Mask<F>(light >= U(view.first_triangle));
  if (any(triangle)) {
    const detail::TriangleReader<F> reader(view, light, triangle);
    detail::KindEmission<F> e =
        detail::emit_triangle<F>(reader, view, r.u, r.v, r.s, r.t, triangle);
    if (view.aim) detail::aim_directions<F>(view, r.aim, r.s, r.t, 2.f, e, triangle);
    put(e, reader.selection_pdf, detail::size_of_terms<F>(reader.p, reader.u, reader.v), triangle);
  }
  const Mask<F> others = active & not_(triangle);
  if (any(others)) {
    const detail::LightReader<F> any_light(view.lights, light, others);
    detail::for_each_kind<F>(
        any_light[&LightRecord::kind], others, [&](LightKind kind, const Mask<F>& lanes) {
          const detail::LightReader<F> reader(view.lights, light, lanes);
          detail::KindEmission<F> e = visit(kind, [&]<typename Kind>(Kind) {
            return Kind::template emit<F>({view, reader, r.u, r.v, r.s, r.t, lanes});
          });
          if (view.aim) {
            if (visit(kind, []<typename Kind>(Kind) { return Kind::kIsInfinite; }))
              detail::aim_origins<F>(view, r.aim, r.u, r.v, e, lanes);
            else
              detail::aim_directions<F>(view, r.aim, r.s, r.t, 1.f, e, lanes);
          }
          if (view.shapings)
            e.radiance = detail::shaped<F>(view, reader.shaping(), e.d, e.radiance, lanes);
          if (view.filters) [[unlikely]]
            e.radiance = detail::filtered<F>(view, reader[&LightRecord::filter], {e.p, e.d, F(0.f)},
                                             e.radiance, lanes);
          const F size = detail::size_of_terms<F>(reader.p(), reader.u(), reader.v());
          put(e, reader.selection_pdf(), F(size + reader.radius()), lanes);
        });
  }
  out.light = select(Mask<U>(out.valid), light, out.light);
  return out;
}

template <typename F>
[[gnu::noinline]] F emission_density(const LightView& view, const UInt<F>& light,
                                     const Vec3<F>& from, const Vec3<F>& dir, const F& t,
                                     const Mask<F>& wanted) {
  F density(0.f);
  if (none(wanted)) return density;
  const Mask<F> active = detail::emits_paths<F>(view, light, wanted);
  const auto put = [&](const F& one, const F& recorded, const Mask<F>& lanes) {
    const F all = one * detail::emission_selection_pdf<F>(view, light, recorded, lanes);
    density = select(lanes & is_finite(all), all, density);
  };
  const Mask<F> triangle = active & Mask<F>(light >= UInt<F>(view.first_triangle));
  if (any(triangle)) {
    const detail::TriangleReader<F> reader(view, light, triangle);
    const F area = length(reader.m);
    F one = 0.5f * detail::uniform_emission_density<F>(area);
    if (view.aim) {
      const F own = abs(dot(reader.m, dir)) * F(0.5f * kInvPi) / select(area > 0.f, area, F(1.f));
      one = one * detail::aim_density_finite<F>(view, fma(dir, t, from), -dir, own);
    }
    put(one, reader.selection_pdf, triangle);
  }
  const Mask<F> others = active & not_(triangle);
  if (none(others)) return density;
  const detail::LightReader<F> any_light(view.lights, light, others);
  detail::for_each_kind<F>(
      any_light[&LightRecord::kind], others, [&](LightKind kind, const Mask<F>& lanes) {
        const detail::LightReader<F> reader(view.lights, light, lanes);
        const F one = visit(kind, [&]<typename Kind>(Kind) {
          const F even = Kind::template emission_density<F>({view, reader, from, dir, t, lanes});
          if (!view.aim) return even;
          return F(even * detail::aim_of_kind<Kind, F>(view, reader, from, dir, t));
        });
        put(one, reader.selection_pdf(), lanes);
      });
  return density;
}

template <typename F>
[[gnu::noinline]] CameraPathDensity<F> camera_path_density(const LightView& view,
                                                           const UInt<F>& light,
                                                           const LightReceiver<F>& from,
                                                           const Vec3<F>& dir, const F& t,
                                                           const Mask<F>& active) {
  using U = UInt<F>;
  CameraPathDensity<F> result{F(0.f), Mask<F>(false)};
  const Mask<F> triangle = active & Mask<F>(light >= U(view.first_triangle));
  if (any(triangle)) result.density = triangle_light_pdf<F>(view, light, from, dir, t, triangle);
  const Mask<F> infinite = active & Mask<F>(light < U(view.infinite_count));
  for (uint32_t i = 0; i < view.infinite_count && any(infinite); ++i) {
    const Mask<F> here = infinite & Mask<F>(light == U(i));
    if (none(here)) continue;
    const LightRecord& record = view.lights[i];
    const detail::LightReader<float> one(record, true);
    const bool is_delta = detail::is_delta_light<float>(one, true);
    const F pdf = is_delta ? F(1.f) : visit(record.kind, [&]<typename Kind>(Kind) {
      return Kind::template escape<F>({view, record, from.p, dir, here}).pdf;
    });
    result.density = select(here, F(pdf * infinite_selection_pdf(view, i)), result.density);
    if (is_delta) result.is_delta = result.is_delta | here;
  }
  const Mask<F> finite = active & not_(triangle) & not_(infinite);
  if (none(finite)) return result;
  const detail::LightReader<F> reader(view.lights, light, finite);
  const Mask<F> point = detail::is_delta_light<F>(reader, finite);
  const Mask<F> area = finite & not_(point);
  if (any(area))
    result.density =
        select(area, light_hit<F>(view, light, from, dir, t, area).pdf, result.density);
  if (any(point)) {
    const F selection_pdf =
        detail::finite_selection_pdf<F>(view, light, reader.selection_pdf(), from, point);
    result.density = select(point, F(selection_pdf * t * t), result.density);
    result.is_delta = result.is_delta | point;
  }
  return result;
}

}  // namespace wavecomb
