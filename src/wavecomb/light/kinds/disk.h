// SPDX-License-Identifier: Apache-2.0
/// Disk lights, or ellipses under a non-uniform scale, sampled uniformly by area.
#pragma once

#include "wavecomb/light/records/record_reader.h"

namespace wavecomb::detail {

/// Samples the point p + a u + b v with (a, b) uniform in the unit disk, so the area density of the
/// point is 1 / area. The disk emits only towards n.
template <typename F>
inline KindSample<F> sample_disk(const LightReader<F>& light, const Vec3<F>& from, const F& u,
                                 const F& v) {
  const Vec2<F> ab = square_to_disk(u, v);
  const Vec3<F> q = fma(light.u(), ab.x, fma(light.v(), ab.y, light.p()));
  const Direction<F> d = make_direction<F>(q - from);
  const F cos_light = -dot(d.wi, light.n());
  return {d.wi, d.length, light.radiance(),
          area_to_solid_angle<F>(d.length2, cos_light, light.area()), Mask<F>(false)};
}

/// Returns radiance and sampling density for a ray that hits the disk at distance t.
template <typename F>
inline KindHit<F> hit_disk(const LightReader<F>& light, const Vec3<F>& dir, const F& t) {
  const F cos_light = -dot(dir, light.n());
  const Mask<F> front = cos_light > 0.f;
  return {select<F>(front, light.radiance(), Color<F>(F(0.f))),
          area_to_solid_angle<F>(F(t * t), cos_light, light.area())};
}

/// Samples a light path that starts uniformly on the disk.
template <typename F>
inline KindEmission<F> emit_disk(const EmissionQuery<F>& q) {
  const LightReader<F>& light = q.light;
  const Vec2<F> ab = square_to_disk(q.u, q.v);
  return emit_by_cosine<F>(fma(light.u(), ab.x, fma(light.v(), ab.y, light.p())), light.n(), q.s,
                           q.t, light.radiance(), uniform_emission_density<F>(light.area()));
}

}  // namespace wavecomb::detail

namespace wavecomb {

/// Class of disk lights, an entry of WAVECOMB_LIGHT_KINDS (light/kinds/kinds.h).
struct DiskKind : FlatKind {
  static LightKindInfo describe();
  template <typename F>
  static detail::KindSample<F> sample(const detail::LightQuery<F>& q) {
    return detail::sample_disk<F>(q.light, q.from, q.u, q.v);
  }
  template <typename F>
  static detail::KindHit<F> hit(const detail::LightHitQuery<F>& m) {
    return detail::hit_disk<F>(m.light, m.dir, m.t);
  }
  template <typename F>
  static detail::KindEmission<F> emit(const detail::EmissionQuery<F>& q) {
    return detail::emit_disk<F>(q);
  }
  template <typename F>
  static F emission_density(const detail::LightHitQuery<F>& m) {
    return detail::uniform_emission_density<F>(m.light.area());
  }
};

}  // namespace wavecomb
