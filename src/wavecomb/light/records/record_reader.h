// SPDX-License-Identifier: Apache-2.0
/// `LightReader`, which reads the light record of each lane, and definitions that all light kinds
/// share.
#pragma once

#include "wavecomb/core/frame.h"
#include "wavecomb/core/math.h"
#include "wavecomb/core/rows/record_reader.h"
#include "wavecomb/core/vec.h"
#include "wavecomb/core/warp.h"
#include "wavecomb/light/description/light_records.h"

namespace wavecomb {

/// Distance of infinite lights.
inline constexpr float kFarAway = 1e30f;

namespace detail {

/// Reads the light record of each lane.
template <typename F>
struct LightReader : RecordReader<F> {
  LightReader(const LightRecord* lights, const UInt<F>& light, const Mask<F>& active_)
      : RecordReader<F>(make_reader<LightRecord, F>(lights, light, active_)) {}
  /// Reads the same record in all lanes.
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
  F selection_pdf() const { return (*this)[&LightRecord::selection_pdf]; }
  UInt<F> texture() const { return (*this)[&LightRecord::texture]; }
  UInt<F> shaping() const { return (*this)[&LightRecord::shaping]; }
};

/// Returns the index of the record that holds the light linking and the multipliers of light
/// `light`. This is the light's record or, for a triangle, the record of its mesh light. Returns
/// kNoLight for triangles that are not part of a mesh light.
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

/// Sample of one light, without the probability of selecting the light.
template <typename F>
struct KindSample {
  Vec3<F> wi;  ///< unit direction to the light
  F distance;
  Color<F> radiance;  ///< for delta lights, the irradiance at normal incidence
  /// Density over solid angle; 1 for delta lights, 0 if there is no valid sample.
  F pdf;
  Mask<F> is_delta;
};

/// Radiance and solid angle sampling density for a ray that hit a light.
template <typename F>
struct KindHit {
  Color<F> radiance;
  F pdf;
};

/// Parameters of a light sample: the light of each lane in `lanes`, the illuminated point `from`,
/// and the 2D sample (u, v).
template <typename F>
struct LightQuery {
  const LightView& view;
  const UInt<F>& index;         ///< index of the sampled light in each lane
  const LightReader<F>& light;  ///< reader of the light's record
  const Vec3<F>& from;
  const F &u, &v;
  const Mask<F>& lanes;
};

/// Rays origin + t dir that hit the shape of a light.
template <typename F>
struct LightHitQuery {
  const LightView& view;
  const LightReader<F>& light;
  const Vec3<F>&origin, &dir;
  const F& t;
  const Mask<F>& lanes;
};

/// Rays from `from` along `dir` that leave the scene, and the infinite light to evaluate for them.
template <typename F>
struct LightEscape {
  const LightView& view;
  const LightRecord& light;
  const Vec3<F>&from, &dir;
  const Mask<F>& lanes;
};

/// Parameters of a light path sample: the light of each lane in `lanes`, the 2D sample (u, v) for
/// the origin, and the 2D sample (s, t) for the direction.
template <typename F>
struct EmissionQuery {
  const LightView& view;
  const LightReader<F>& light;
  const F &u, &v, &s, &t;
  const Mask<F>& lanes;
};

/// Origin and direction of a light path, without the probability of selecting the light.
///
/// `density` is used for the path's weight and for MIS (docs/light-paths.md). It is the density of
/// the origin times the density of the direction, divided by the cosine:
///   p_A(p) p_w(d) / |cos|;   for a point light p_w(d);   for an infinite light p_w(d) / (pi R^2);
///   for a distant light without an angle 1 / (pi R^2),
/// so that radiance (point light: intensity; distant light without an angle: irradiance) / density
/// is the flux that the path carries. A density of 0 means that there is no path.
template <typename F>
struct KindEmission {
  Vec3<F> p, d;  ///< unit d
  /// Unit normal of the light's surface, along which the origin is offset; 0 for lights without a
  /// surface.
  Vec3<F> n;
  Color<F> radiance;
  F density;
};

/// Returns a light path from `p` whose direction is cosine-distributed about the surface normal
/// `n`.
template <typename F>
inline KindEmission<F> emit_by_cosine(const Vec3<F>& p, const Vec3<F>& n, const F& s, const F& t,
                                      const Color<F>& radiance, const F& density) {
  return {p, make_frame(n).to_world(square_to_cosine_hemisphere(s, t)), n, radiance, density};
}

/// Returns the emission density 1 / (pi area) of a light that is sampled uniformly by area, or 0 if
/// the density is out of range.
template <typename F>
inline F uniform_emission_density(const F& area) {
  const F density = kInvPi / select(area > 0.f, area, F(1.f));
  return select((area > 0.f) & is_finite(density), density, F(0.f));
}

/// Returns a light path along `d` through the bounding sphere of the scene. The path starts on a
/// disk of the sphere's radius in front of the scene, at a point sampled by (u, v).
template <typename F>
inline KindEmission<F> emit_infinite(const LightView& view, const Vec3<F>& d, const F& u,
                                     const F& v, const Color<F>& radiance, const F& direction_pdf) {
  const Vec2<F> at = square_to_disk(u, v);
  const Frame<F> frame = make_frame(d);
  const Vec3<F> centre{F(view.centre[0]), F(view.centre[1]), F(view.centre[2])};
  const Vec3<F> across = fma(frame.s, F(at.x * view.radius),
                             fma(frame.t, F(at.y * view.radius), Vec3<F>(d * F(-view.reach))));
  return {centre + across, d, Vec3<F>(F(0.f)), radiance,
          direction_pdf * (kInvPi / (view.radius * view.radius))};
}
/// Returns the density of emit_infinite() for a direction with density `direction_pdf`.
template <typename F>
inline F infinite_emission_pdf(const LightView& view, const F& direction_pdf) {
  return direction_pdf * (kInvPi / (view.radius * view.radius));
}

template <typename F>
inline KindHit<F> dark() {
  return {Color<F>(F(0.f)), F(0.f)};
}

/// Converts the area density 1 / area to a solid angle density at squared distance `d2`, where the
/// direction makes an angle with cosine `cos_light` with the light's normal. Returns 0 if the light
/// is seen from behind or edge-on, if its area is 0, or if the density is out of range.
template <typename F>
inline F area_to_solid_angle(const F& d2, const F& cos_light, const F& area) {
  const F projected = cos_light * area;
  const Mask<F> valid = (projected > 0.f) & (d2 > 0.f);
  const F pdf = d2 / select(valid, projected, F(1.f));
  return select(valid & is_finite(pdf), pdf, F(0.f));
}

/// Unit vector along d, and the length of d. The vector is finite even if d is 0.
template <typename F>
struct Direction {
  Vec3<F> wi;
  F length2, length;
};
template <typename F>
inline Direction<F> make_direction(const Vec3<F>& d) {
  const F length2 = length_squared(d);
  const Mask<F> valid = (length2 > 0.f) & is_finite(length2);
  const F safe = sqrt(select(valid, length2, F(1.f)));
  return {d * F(1.f / safe), select(valid, length2, F(0.f)), select(valid, safe, F(0.f))};
}

/// Returns v / |v|, or 0 if v is 0.
template <typename F>
inline Vec3<F> unit_or_zero(const Vec3<F>& v) {
  const F size = length(v);
  return v * F(1.f / select(size > 0.f, size, F(1.f)));
}

template <typename F>
inline Color<F> not_negative(const Color<F>& c) {
  return {max(c.x, F(0.f)), max(c.y, F(0.f)), max(c.z, F(0.f))};
}

}  // namespace detail

struct LightKindInfo;

/// Base class of light kinds that surround the scene at infinite distance. Light paths from these
/// lights start on a disk in front of the scene.
struct InfiniteKind {
  static constexpr bool kIsInfinite = true;
  template <typename F>
  static detail::KindHit<F> hit(const detail::LightHitQuery<F>& /*query*/) {
    return detail::dark<F>();
  }
};
/// Base class of light kinds at a finite position. Light paths from these lights leave a surface
/// with the normal `emission_normal()`.
struct FiniteKind {
  static constexpr bool kIsInfinite = false;
  template <typename F>
  static detail::KindHit<F> escape(const detail::LightEscape<F>& /*escape*/) {
    return detail::dark<F>();
  }
};
/// Base class of planar light kinds, whose normal is stored in the record.
struct FlatKind : FiniteKind {
  template <typename F>
  static Vec3<F> emission_normal(const detail::LightReader<F>& light, const Vec3<F>& /*p*/) {
    return light.n();
  }
  template <typename F>
  static Mask<F> is_delta(const detail::LightReader<F>& /*light*/) {
    return Mask<F>(false);
  }
};

}  // namespace wavecomb
