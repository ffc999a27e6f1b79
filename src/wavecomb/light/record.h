// SPDX-License-Identifier: Apache-2.0
/// Reads light records by lane, and what the files of the light kinds share.
#pragma once

#include "wavecomb/core/frame.h"
#include "wavecomb/core/math.h"
#include "wavecomb/core/record_reader.h"
#include "wavecomb/core/vec.h"
#include "wavecomb/core/warp.h"
#include "wavecomb/scene/light_data.h"

namespace wavecomb {

/// "Distance" of infinite lights.
inline constexpr float kFarAway = 1e30f;

namespace detail {

/// Fields of the light in each lane.
template <typename F>
struct LightReader : RecordReader<F> {
  LightReader(const LightRecord* lights, const UInt<F>& light, const Mask<F>& active_)
      : RecordReader<F>(make_reader<LightRecord, F>(lights, light, active_)) {}
  /// The same record in all lanes.
  LightReader(const LightRecord& record, const Mask<F>& active_)
      : RecordReader<F>(make_reader<LightRecord, F>(record, active_)) {}

  Vec3<F> p() const { return (*this)[&LightRecord::p]; }
  Vec3<F> u() const { return (*this)[&LightRecord::u]; }
  Vec3<F> v() const { return (*this)[&LightRecord::v]; }
  Vec3<F> n() const { return (*this)[&LightRecord::n]; }
  Color<F> radiance() const { return (*this)[&LightRecord::radiance]; }
  F area() const { return (*this)[&LightRecord::area]; }
  F radius() const { return (*this)[&LightRecord::radius]; }
  F one_minus_cos() const { return (*this)[&LightRecord::one_minus_cos]; }
  F pick_pdf() const { return (*this)[&LightRecord::pick_pdf]; }
  UInt<F> texture() const { return (*this)[&LightRecord::texture]; }
  UInt<F> shaping() const { return (*this)[&LightRecord::shaping]; }
};

/// The record that says what light `light` shines on and how: its own, or that of the mesh light
/// which a triangle is part of; kNoLight for triangles that merely glow.
template <typename F>
inline UInt<F> record_of(const LightView& view, const UInt<F>& light, const Mask<F>& active) {
  using U = UInt<F>;
  const Mask<U> triangle(light >= U(view.first_triangle));
  U record = select(triangle, U(kNoLight), light);
  if (view.mesh_lights) [[unlikely]] {
    const Mask<U> known = Mask<U>(active) & triangle & Mask<U>(light < U(view.count));
    record = select(known, gather<U>(view.mesh_lights, light - view.first_triangle, known), record);
  }
  return record;
}

/// What one light gives a shading point, before the choice of the light is counted.
template <typename F>
struct KindSample {
  Vec3<F> wi;  ///< unit direction to the light
  F distance;
  Color<F> radiance;  ///< delta lights: the irradiance at normal incidence
  F pdf;              ///< over solid angle; delta lights: 1; 0: no sample
  Mask<F> is_delta;
};

/// Radiance and density over solid angle for a ray that met a light.
template <typename F>
struct KindHit {
  Color<F> radiance;
  F pdf;
};

/// What a kind is asked to sample: the light in lanes `lanes`, as `from` sees it, by (u, v).
template <typename F>
struct LightQuery {
  const LightView& view;
  const UInt<F>& index;         ///< of the light in each lane
  const LightReader<F>& light;  ///< its record
  const Vec3<F>& from;
  const F &u, &v;
  const Mask<F>& lanes;
};

/// Rays origin + t dir that met the shape of a light.
template <typename F>
struct LightMeeting {
  const LightView& view;
  const LightReader<F>& light;
  const Vec3<F>&origin, &dir;
  const F& t;
  const Mask<F>& lanes;
};

/// Rays that left `from` and the scene along `dir`, of which one light is asked.
template <typename F>
struct LightEscape {
  const LightView& view;
  const LightRecord& light;
  const Vec3<F>&from, &dir;
  const Mask<F>& lanes;
};

/// What a kind is asked to send a path from: the light in lanes `lanes`, its place by (u, v), its
/// direction by (s, t).
template <typename F>
struct EmissionQuery {
  const LightView& view;
  const LightReader<F>& light;
  const F &u, &v, &s, &t;
  const Mask<F>& lanes;
};

/// Where a path starts at a light and where it goes, before the choice of the light is counted.
///
/// `density` is what the path's weight and those of multiple importance sampling need (docs/
/// light-paths.md): that of the place times that of the direction over its cosine,
///   p_A(p) p_w(d) / |cos|;   of a point p_w(d);   of an infinite light p_w(d) / (pi R^2);
///   of a distant one without an angle 1 / (pi R^2),
/// so that radiance (a point: intensity; without an angle: irradiance) / density is the flux that
/// the path carries. 0: no path.
template <typename F>
struct KindEmission {
  Vec3<F> p, d;  ///< unit d
  Vec3<F> n;     ///< unit, out of the light's surface, to keep clear of; 0: it has none
  Color<F> radiance;
  F density;
};

/// A path from `p` by cosine about the surface's normal `n`.
template <typename F>
inline KindEmission<F> emit_by_cosine(const Vec3<F>& p, const Vec3<F>& n, const F& s, const F& t,
                                      const Color<F>& radiance, const F& density) {
  return {p, make_frame(n).to_world(square_to_cosine_hemisphere(s, t)), n, radiance, density};
}

/// kInvPi / area; 0 where that is out of range.
template <typename F>
inline F even_emission_density(const F& area) {
  const F density = kInvPi / select(area > 0.f, area, F(1.f));
  return select((area > 0.f) & is_finite(density), density, F(0.f));
}

/// A path towards the sphere around the scene, along `d`, from a place of its shadow by (u, v).
template <typename F>
inline KindEmission<F> emit_from_afar(const LightView& view, const Vec3<F>& d, const F& u,
                                      const F& v, const Color<F>& radiance,
                                      const F& direction_pdf) {
  const Vec2<F> at = square_to_disk(u, v);
  const Frame<F> frame = make_frame(d);
  const Vec3<F> centre{F(view.centre[0]), F(view.centre[1]), F(view.centre[2])};
  const Vec3<F> across = fma(frame.s, F(at.x * view.radius),
                             fma(frame.t, F(at.y * view.radius), Vec3<F>(d * F(-view.reach))));
  return {centre + across, d, Vec3<F>(F(0.f)), radiance,
          direction_pdf * (kInvPi / (view.radius * view.radius))};
}
/// The same density for a direction that was met.
template <typename F>
inline F density_from_afar(const LightView& view, const F& direction_pdf) {
  return direction_pdf * (kInvPi / (view.radius * view.radius));
}

template <typename F>
inline KindHit<F> dark() {
  return {Color<F>(F(0.f)), F(0.f)};
}

/// The density over solid angle that a density of 1 / area becomes at distance^2 `d2`, where the
/// direction makes an angle of cosine `cos_light` with the light's normal; 0 where the light is
/// seen from behind or on edge, is degenerate, or the density is out of range.
template <typename F>
inline F area_to_solid_angle(const F& d2, const F& cos_light, const F& area) {
  const F projected = cos_light * area;
  const Mask<F> good = (projected > 0.f) & (d2 > 0.f);
  const F pdf = d2 / select(good, projected, F(1.f));
  return select(good & is_finite(pdf), pdf, F(0.f));
}

/// Unit vector along d and its length; anything finite where d is 0.
template <typename F>
struct Direction {
  Vec3<F> wi;
  F length2, length;
};
template <typename F>
inline Direction<F> make_direction(const Vec3<F>& d) {
  const F length2 = length_squared(d);
  const Mask<F> good = (length2 > 0.f) & is_finite(length2);
  const F safe = sqrt(select(good, length2, F(1.f)));
  return {d * F(1.f / safe), select(good, length2, F(0.f)), select(good, safe, F(0.f))};
}

template <typename F>
inline Color<F> not_negative(const Color<F>& c) {
  return {max(c.x, F(0.f)), max(c.y, F(0.f)), max(c.z, F(0.f))};
}

}  // namespace detail

struct LightKindInfo;

/// Kinds that rays which leave the scene do not see.
struct NoEscape {
  template <typename F>
  static detail::KindHit<F> escape(const detail::LightEscape<F>& /*escape*/) {
    return detail::dark<F>();
  }
};
/// Kinds that rays do not meet.
struct NoShape {
  template <typename F>
  static detail::KindHit<F> hit(const detail::LightMeeting<F>& /*meeting*/) {
    return detail::dark<F>();
  }
};

}  // namespace wavecomb
