// SPDX-License-Identifier: Apache-2.0
/// Reads light records by lane, and what the files of the light kinds share.
#pragma once

#include "wavecomb/core/fields.h"
#include "wavecomb/core/math.h"
#include "wavecomb/core/vec.h"
#include "wavecomb/core/warp.h"
#include "wavecomb/scene/light_data.h"

namespace wavecomb {

/// "Distance" of infinite lights.
inline constexpr float kFarAway = 1e30f;

namespace detail {

/// Fields of the light in each lane: one scalar load where all active lanes have the same light,
/// else gathers. Inactive lanes hold anything that their neighbours hold, or 0.
template <typename F>
struct LightReader {
  const LightRecord* base;
  UInt<F> first_word;
  const float* shared;  ///< the record of all active lanes, or null
  Mask<F> active;

  LightReader(const LightRecord* lights, const UInt<F>& light, const Mask<F>& active_)
      : base(lights),
        first_word(light * static_cast<uint32_t>(sizeof(LightRecord) / 4)),
        shared(nullptr),
        active(active_) {
    if constexpr (kIsScalar<F>) {
      if (active_) shared = reinterpret_cast<const float*>(lights + light);
    } else if (any(active_) && is_uniform<F>(light, active_)) {
      const auto first = static_cast<size_t>(std::countr_zero(lane_bits<F>(active_)));
      shared = reinterpret_cast<const float*>(lights + lane(light, first));
    }
  }
  /// The same record in all lanes.
  LightReader(const LightRecord& record, const Mask<F>& active_)
      : base(&record),
        first_word(0u),
        shared(reinterpret_cast<const float*>(&record)),
        active(active_) {}

  /// A member of the record: reader[&LightRecord::area].
  template <typename Record>
  F operator[](float Record::* member) const {
    return word(word_of(member));
  }
  template <typename Record>
  UInt<F> operator[](uint32_t Record::* member) const {
    return float_bits<F>(word(word_of(member)));
  }
  template <typename Record>
  Vec3<F> operator[](float (Record::*member)[3]) const {
    const uint32_t first = word_of(member);
    return {word(first), word(first + 1), word(first + 2)};
  }

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

 private:
  F word(uint32_t at) const {
    if (shared) return F(shared[at]);
    return gather<F>(base, first_word + at, active);
  }
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

}  // namespace wavecomb
