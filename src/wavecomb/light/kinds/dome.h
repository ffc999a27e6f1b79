// SPDX-License-Identifier: Apache-2.0
/// Dome lights: an environment with or without a latlong image.
///
/// UsdLuxDomeLight uses OpenEXR's convention for latitude-longitude images. In dome space,
///     direction = (cos(lat) sin(lon), sin(lat), cos(lat) cos(lon)),
///     s = 1/2 - lon / (2 pi),   t = 1/2 + lat / pi   (t up),
/// so that the top row is +y, the image's centre is in direction +z, and s decreases towards +x:
/// the column at s = 1/4 is in direction +x. The image is not mirrored as seen from inside the
/// sphere.
#pragma once

#include <bit>

#include "wavecomb/light/kinds/image.h"
#include "wavecomb/light/kinds/portal.h"
#include "wavecomb/light/records/record_reader.h"
#include "wavecomb/texture/lookup.h"

namespace wavecomb::detail {

/// The constant 2 pi^2: an element ds dt of a latlong image covers the solid angle 2 pi^2 sin(polar
/// angle) ds dt.
inline constexpr float kTwoPiSquared = 19.739208802178716f;

/// Convert directions from world space to dome space, and back.
template <typename F>
inline Vec3<F> to_dome(const LightReader<F>& light, const Vec3<F>& w) {
  return {dot(w, light.u()), dot(w, light.v()), dot(w, light.n())};
}
template <typename F>
inline Vec3<F> from_dome(const LightReader<F>& light, const Vec3<F>& d) {
  return fma(light.u(), d.x, fma(light.v(), d.y, Vec3<F>(light.n() * d.z)));
}

/// Returns the radiance at image coordinates s and t, from the finest mip level. Lookups do not
/// cross the poles in any wrap mode; in s, the texture's wrap mode applies (it should be kRepeat).
template <typename F>
inline Color<F> dome_radiance(const LightReader<F>& light, const TextureView& texture, const F& s,
                              const F& t, const Mask<F>& active) {
  const float half_texel = 0.5f / static_cast<float>(texture.levels[0].height);
  const F inside = clamp(t, F(half_texel), F(1.f - half_texel));
  const Texel<F> texel = lookup<F>(texture, s, inside, F(0.f), active);
  return light.radiance() * not_negative(Color<F>(texel.r, texel.g, texel.b));
}

/// Returns the solid angle density of a direction whose image point has the density `density` over
/// the unit square: the density divided by 2 pi^2 sin(polar angle).
template <typename F>
inline F dome_pdf(const F& density, const F& sin_theta) {
  const F measure = sin_theta * kTwoPiSquared;
  const Mask<F> valid = measure > 0.f;
  const F pdf = density / select(valid, measure, F(1.f));
  return select(valid & is_finite(pdf), pdf, F(0.f));
}

/// Samples a direction by the distribution of the image.
template <typename F>
inline KindSample<F> sample_dome_image(const LightReader<F>& light, const TextureView& texture,
                                       const Distribution2D& d, const F& u, const F& v,
                                       const Mask<F>& active) {
  const ImagePoint<F> at = sample_image<F>(d, u, v, active);
  const auto [sin_theta, cos_theta] = sincos_2pi(F(at.y * 0.5f));  // y: polar angle / pi
  const auto [sin_lon, cos_lon] = sincos_2pi(F(0.5f - at.x));
  const Vec3<F> local(sin_theta * sin_lon, cos_theta, sin_theta * cos_lon);
  return {from_dome<F>(light, local), F(kFarAway),
          dome_radiance<F>(light, texture, at.x, F(1.f - at.y), active),
          dome_pdf<F>(at.pdf, sin_theta), Mask<F>(false)};
}

/// Samples a dome without an image uniformly over the sphere.
template <typename F>
inline KindSample<F> sample_dome_constant(const LightReader<F>& light, const F& u, const F& v) {
  return {square_to_sphere(u, v), F(kFarAway), light.radiance(), F(kInv4Pi), Mask<F>(false)};
}

/// Samples directions to the dome lights of all lanes, one image after the other.
template <typename F>
inline KindSample<F> sample_dome_light(const LightView& view, const LightReader<F>& light,
                                       const F& u, const F& v, const Mask<F>& active) {
  KindSample<F> result = sample_dome_constant<F>(light, u, v);
  const UInt<F> texture = light.texture(), index = light[&LightRecord::distribution];
  Mask<F> pending = active & Mask<F>(texture != UInt<F>(kNoTexture));
  while (any(pending)) {
    const auto first = static_cast<size_t>(std::countr_zero(lane_bits<F>(pending)));
    const uint32_t one = lane(index, first);
    const Mask<F> same = pending & Mask<F>(index == UInt<F>(one));
    const KindSample<F> s = sample_dome_image<F>(
        light, view.materials.textures[lane(texture, first)], view.distributions[one], u, v, same);
    result = {select<F>(same, s.wi, result.wi), result.distance,
              select<F>(same, s.radiance, result.radiance), select(same, s.pdf, result.pdf),
              result.is_delta};
    pending = pending & not_(same);
  }
  return result;
}

/// Image position and polar angle of a direction in dome space.
template <typename F>
struct ImageDirection {
  F sin_theta;
  F s, down;  ///< image coordinates from the left and from the top
  explicit ImageDirection(const Vec3<F>& w)
      : sin_theta(sqrt(fma(w.x, w.x, F(w.z * w.z)))),
        s(fnma(atan2(w.x, w.z), F(kInv2Pi), F(0.5f))),
        down(atan2(sin_theta, w.y) * kInvPi) {}
};

/// Returns radiance and sampling density of the dome `record` for a ray that leaves the scene along
/// `dir`.
template <typename F>
inline KindHit<F> hit_dome(const LightView& view, const LightRecord& record, const Vec3<F>& dir,
                           const Mask<F>& active) {
  const LightReader<F> light(record, active);
  if (record.texture == kNoTexture) return {light.radiance(), F(kInv4Pi)};
  const Distribution2D& d = view.distributions[record.distribution];
  const ImageDirection<F> at(to_dome<F>(light, dir));
  return {dome_radiance<F>(light, view.materials.textures[record.texture], at.s, F(1.f - at.down),
                           active),
          dome_pdf<F>(image_pdf_at<F>(d, at.s, at.down, active), at.sin_theta)};
}

/// Returns radiance and sampling density of the dome `record` for a ray from `from` along `dir`
/// that leaves the scene. If the dome has portals, the density includes sampling through the
/// portals.
template <typename F>
inline KindHit<F> hit_dome_from(const LightView& view, const LightRecord& record,
                                const Vec3<F>& from, const Vec3<F>& dir, const Mask<F>& active) {
  KindHit<F> hit = hit_dome<F>(view, record, dir, active);
  if (record.portals != kNoPortals) [[unlikely]]
    hit.pdf = Portals<F>(view, record.portals, from, active).pdf(dir, hit.pdf, Mask<F>(false));
  return hit;
}

/// Samples directions from `from` to domes `lights`, some of which have portals.
template <typename F>
[[gnu::noinline]] KindSample<F> sample_portal_dome(const LightView& view, const UInt<F>& lights,
                                                   const Vec3<F>& from, const F& u, const F& v,
                                                   const Mask<F>& active) {
  KindSample<F> result{Vec3<F>(F(0.f), F(0.f), F(1.f)), F(kFarAway), Color<F>(F(0.f)), F(0.f),
                       Mask<F>(false)};
  Mask<F> pending = active;
  while (any(pending)) {
    const uint32_t one = lane(lights, static_cast<size_t>(std::countr_zero(lane_bits<F>(pending))));
    const LightRecord& record = view.lights[one];
    const Mask<F> same = pending & Mask<F>(lights == UInt<F>(one));
    pending = pending & not_(same);
    const LightReader<F> light(record, same);
    KindSample<F> s;
    if (record.portals == kNoPortals) {
      s = sample_dome_light<F>(view, light, u, v, same);
    } else {
      const Portals<F> portals(view, record.portals, from, same);
      const F share = portals.share();
      const Mask<F> through = u < share;
      const F inside = select(through, share, F(1.f - share));
      const F part = select(through, u, F(u - share)) / inside;
      const F rest = clamp(part, F(0.f), F(kOneMinusEpsilon));
      s = sample_dome_light<F>(view, light, rest, v, same);
      const Vec3<F> wi = portals.sample(rest, v);
      const KindHit<F> hit = hit_dome<F>(view, record, wi, same & through);
      s.wi = select<F>(through, wi, s.wi);
      s.radiance = select<F>(through, hit.radiance, s.radiance);
      s.pdf = portals.pdf(s.wi, select(through, hit.pdf, s.pdf), through);
    }
    result = {select<F>(same, s.wi, result.wi), result.distance,
              select<F>(same, s.radiance, result.radiance), select(same, s.pdf, result.pdf),
              result.is_delta};
  }
  return result;
}

/// Samples directions from `from` to domes `lights`, whose records are read through `light`.
template <typename F>
inline KindSample<F> sample_dome(const LightView& view, const UInt<F>& lights,
                                 const LightReader<F>& light, const Vec3<F>& from, const F& u,
                                 const F& v, const Mask<F>& active) {
  if (view.portals) [[unlikely]]
    return sample_portal_dome<F>(view, lights, from, u, v, active);
  return sample_dome_light<F>(view, light, u, v, active);
}

/// Samples a light path whose direction follows the distribution of the image. The portals of the
/// dome are not used.
template <typename F>
inline KindEmission<F> emit_dome(const EmissionQuery<F>& q) {
  const KindSample<F> direction = sample_dome_light<F>(q.view, q.light, q.s, q.t, q.lanes);
  return emit_infinite<F>(q.view, -direction.wi, q.u, q.v, direction.radiance, direction.pdf);
}

/// Returns the emission density (KindEmission::density) of the light paths along -dir that
/// emit_dome() samples. Images are evaluated one after the other.
template <typename F>
inline F dome_emission_density(const LightHitQuery<F>& m) {
  F pdf(kInv4Pi);
  const UInt<F> index = m.light[&LightRecord::distribution];
  const Vec3<F> w = to_dome<F>(m.light, m.dir);
  const ImageDirection<F> at(w);
  Mask<F> pending = m.lanes & Mask<F>(m.light.texture() != UInt<F>(kNoTexture));
  while (any(pending)) {
    const uint32_t one = lane(index, static_cast<size_t>(std::countr_zero(lane_bits<F>(pending))));
    const Mask<F> same = pending & Mask<F>(index == UInt<F>(one));
    pending = pending & not_(same);
    const F image = image_pdf_at<F>(m.view.distributions[one], at.s, at.down, same);
    pdf = select(same, dome_pdf<F>(image, at.sin_theta), pdf);
  }
  return infinite_emission_pdf<F>(m.view, pdf);
}

}  // namespace wavecomb::detail

namespace wavecomb {

/// Class of dome lights, an entry of WAVECOMB_LIGHT_KINDS (light/kinds/kinds.h).
struct DomeKind : InfiniteKind {
  static LightKindInfo describe();
  template <typename F>
  static Mask<F> is_delta(const detail::LightReader<F>& /*light*/) {
    return Mask<F>(false);
  }
  template <typename F>
  static detail::KindSample<F> sample(const detail::LightQuery<F>& q) {
    return detail::sample_dome<F>(q.view, q.index, q.light, q.from, q.u, q.v, q.lanes);
  }
  template <typename F>
  static detail::KindHit<F> escape(const detail::LightEscape<F>& e) {
    return detail::hit_dome_from<F>(e.view, e.light, e.from, e.dir, e.lanes);
  }
  template <typename F>
  static detail::KindEmission<F> emit(const detail::EmissionQuery<F>& q) {
    return detail::emit_dome<F>(q);
  }
  template <typename F>
  static F emission_density(const detail::LightHitQuery<F>& m) {
    return detail::dome_emission_density<F>(m);
  }
};

}  // namespace wavecomb
