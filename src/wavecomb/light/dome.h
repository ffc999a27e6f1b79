// SPDX-License-Identifier: Apache-2.0
/// Dome lights: an environment all around, with or without a latlong image.
///
/// UsdLuxDomeLight takes OpenEXR's convention for latitude-longitude images. In the dome's own
/// space,
///     direction = (cos(lat) sin(lon), sin(lat), cos(lat) cos(lon)),
///     s = 1/2 - lon / (2 pi),   t = 1/2 + lat / pi   (t up),
/// so that the top row is +y, the image's centre looks at +z, and s falls towards +x: the quarter
/// of the image at s = 1/4 looks at +x. From outside the sphere the image would be mirrored; from
/// inside it is not.
#pragma once

#include "wavecomb/light/record.h"
#include "wavecomb/texture/lookup.h"

namespace wavecomb::detail {

/// 2 pi^2: solid angle of a piece of the image is 2 pi^2 sin(polar angle) ds dt.
inline constexpr float kTwoPiSquared = 19.739208802178716f;

/// The dome's own coordinates of a world direction, and back.
template <typename F>
inline Vec3<F> to_dome(const LightReader<F>& light, const Vec3<F>& w) {
  return {dot(w, light.u()), dot(w, light.v()), dot(w, light.n())};
}
template <typename F>
inline Vec3<F> from_dome(const LightReader<F>& light, const Vec3<F>& d) {
  return fma(light.u(), d.x, fma(light.v(), d.y, Vec3<F>(light.n() * d.z)));
}

/// Radiance at image coordinates s and t, finest level. Taps do not cross the poles, however the
/// texture wraps; in s the texture's own wrap mode holds (which should be kRepeat).
template <typename F>
inline Color<F> dome_radiance(const LightReader<F>& light, const TextureView& texture, const F& s,
                              const F& t, const Mask<F>& active) {
  const float half_texel = 0.5f / static_cast<float>(texture.levels[0].height);
  const F inside = clamp(t, F(half_texel), F(1.f - half_texel));
  const Texel<F> texel = lookup<F>(texture, s, inside, F(0.f), active);
  return light.radiance() * not_negative(Color<F>(texel.r, texel.g, texel.b));
}

/// The last i with cdf[i] <= x among the ascending values that start at `first`; x in [0, 1). The
/// guide entries `row` of the distribution narrow the search.
template <typename F>
inline UInt<F> find_interval(const Distribution2D& d, const UInt<F>& row, const float* cdf,
                             const UInt<F>& first, const F& x, const Mask<F>& active) {
  using U = UInt<F>;
  constexpr uint32_t kGuide = Distribution2D::kGuide;
  const U entry =
      gather<U>(d.guide.data(), row * kGuide + U(to_int<F>(F(x * float{kGuide}))), Mask<U>(active));
  U low = entry & 0xffffu, high = entry >> 16;
  for (;;) {
    const Mask<F> open = active & Mask<F>(low < high);
    if (none(open)) return low;
    const U middle = (low + high + 1u) >> 1;
    const F value = gather<F>(cdf, first + middle, open);
    const Mask<U> above(open & (value <= x));
    high = select(Mask<U>(open) & not_(above), middle - 1u, high);
    low = select(above, middle, low);
  }
}

/// Density over the unit square of cell (x, y) is stored; a direction's density over solid angle is
/// that divided by 2 pi^2 sin(polar angle).
template <typename F>
inline F dome_pdf(const Distribution2D& d, const UInt<F>& x, const UInt<F>& y, const F& sin_theta,
                  const Mask<F>& active) {
  const F density = gather<F>(d.density.data(), y * d.width + x, active);
  const F measure = sin_theta * kTwoPiSquared;
  const Mask<F> good = measure > 0.f;
  const F pdf = density / select(good, measure, F(1.f));
  return select(good & is_finite(pdf), pdf, F(0.f));
}

/// A point of the image by its density: the row by the marginal, then the column, each by
/// inversion.
template <typename F>
inline KindSample<F> sample_dome_image(const LightReader<F>& light, const TextureView& texture,
                                       const Distribution2D& d, const F& u, const F& v,
                                       const Mask<F>& active) {
  const auto inside = [](const F& x, const F& a, const F& b) {
    const F size = b - a;
    return min(max(F((x - a) / select(size > 0.f, size, F(1.f))), F(0.f)), F(kOneMinusEpsilon));
  };
  const UInt<F> y =
      find_interval<F>(d, UInt<F>(d.height), d.marginal.data(), UInt<F>(0u), v, active);
  const F dy = inside(v, gather<F>(d.marginal.data(), y, active),
                      gather<F>(d.marginal.data(), y + 1u, active));
  const UInt<F> row = y * (d.width + 1);
  const UInt<F> x = find_interval<F>(d, y, d.conditional.data(), row, u, active);
  const F dx = inside(u, gather<F>(d.conditional.data(), row + x, active),
                      gather<F>(d.conditional.data(), row + x + 1u, active));

  const F s = (F(Int<F>(x)) + dx) * (1.f / static_cast<float>(d.width));
  const F down = (F(Int<F>(y)) + dy) * (1.f / static_cast<float>(d.height));  // polar angle / pi
  const auto [sin_theta, cos_theta] = sincos_2pi(F(down * 0.5f));
  const auto [sin_lon, cos_lon] = sincos_2pi(F(0.5f - s));
  const Vec3<F> local(sin_theta * sin_lon, cos_theta, sin_theta * cos_lon);
  return {from_dome<F>(light, local), F(kFarAway),
          dome_radiance<F>(light, texture, s, F(1.f - down), active),
          dome_pdf<F>(d, x, y, sin_theta, active), Mask<F>(false)};
}

/// A dome without an image: uniform over the sphere.
template <typename F>
inline KindSample<F> sample_dome_constant(const LightReader<F>& light, const F& u, const F& v) {
  return {square_to_sphere(u, v), F(kFarAway), light.radiance(), F(kInv4Pi), Mask<F>(false)};
}

/// One kind of dome light after the other among the active lanes: each image once.
template <typename F>
inline KindSample<F> sample_dome(const LightView& view, const LightReader<F>& light, const F& u,
                                 const F& v, const Mask<F>& active) {
  KindSample<F> result = sample_dome_constant<F>(light, u, v);
  const UInt<F> texture = light.texture(), index = light.bits(offsetof(LightRecord, distribution));
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

/// What a ray that left the scene along `dir` gets from the dome `record`.
template <typename F>
inline KindHit<F> hit_dome(const LightView& view, const LightRecord& record, const Vec3<F>& dir,
                           const Mask<F>& active) {
  const LightReader<F> light(record, active);
  if (record.texture == kNoTexture) return {light.radiance(), F(kInv4Pi)};
  const Distribution2D& d = view.distributions[record.distribution];
  const Vec3<F> w = to_dome<F>(light, dir);
  const F sin_theta = sqrt(fma(w.x, w.x, F(w.z * w.z)));
  const F s = fnma(atan2(w.x, w.z), F(kInv2Pi), F(0.5f));
  const F down = atan2(sin_theta, w.y) * kInvPi;
  const auto cell = [](const F& x, uint32_t size) {
    const F i =
        clamp(floor(F(x * static_cast<float>(size))), F(0.f), F(static_cast<float>(size - 1)));
    return UInt<F>(to_int<F>(i));
  };
  return {
      dome_radiance<F>(light, view.materials.textures[record.texture], s, F(1.f - down), active),
      dome_pdf<F>(d, cell(s, d.width), cell(down, d.height), sin_theta, active)};
}

}  // namespace wavecomb::detail
