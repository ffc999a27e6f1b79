// SPDX-License-Identifier: Apache-2.0
/// Reads light records by lane, and what the files of the light kinds share.
#pragma once

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
