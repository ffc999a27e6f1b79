// SPDX-License-Identifier: Apache-2.0
/// Light filters, which attenuate and tint the light that passes through them.
///
/// Light leaves a point x on the light in direction e. In the filter's space, the light crosses the
/// window, the plane z = -distance, at w = x + e (distance + x_z) / -e_z. The radiance is
/// multiplied by the factors
///   doors     product over four sides of smoothstep(a w_x + b w_y + c)
///   picture   texel at (dot(u, (w_x, w_y, 1)), dot(v, (w_x, w_y, 1)))
///   decay     clamped functions of the distance d to the illuminated point:
///             near (d - near_start) / (near_end - near_start),
///             far 1 - (d - far_start) / (far_end - far_start)
/// Light that starts beyond the window or travels away from it is blocked. A filter of density k
/// passes the fraction 1 - k of the light unchanged.
#pragma once

#include "wavecomb/core/rows/fields.h"
#include "wavecomb/light/records/record_reader.h"
#include "wavecomb/texture/lookup.h"

namespace wavecomb::detail {

/// Ray from a light: start position and direction in world space, and distance to the illuminated
/// point.
template <typename F>
struct LeavingLight {
  Vec3<F> position, along;
  F distance;
};

/// Transmittance of a single filter.
template <typename F>
struct FilterReader : RecordReader<F> {
  FilterReader(const LightView& view, const UInt<F>& filter, const Mask<F>& lanes)
      : RecordReader<F>(make_reader<FilterRecord, F>(view.filters, filter, lanes)) {}

  /// Returns the transmittance at position (x, y) of the window, including the gobo image.
  Color<F> at_window(const TextureView* textures, const F& x, const F& y,
                     const Mask<F>& lanes) const {
    using R = FilterRecord;
    const auto along = [&](float (R::*line)[3]) {
      const Vec3<F> l = (*this)[line];
      return F(fma(l.x, x, fma(l.y, y, l.z)));
    };
    F passed(1.f);
    for (float (R::*side)[3] : {&R::side_0, &R::side_1, &R::side_2, &R::side_3}) {
      const F t = clamp(along(side), F(0.f), F(1.f));
      passed *= F(t * t) * fnma(F(2.f), t, F(3.f));
    }
    Color<F> result(passed);
    const UInt<F> texture = (*this)[&R::texture];
    const Mask<F> has_image = lanes & Mask<F>(texture != UInt<F>(kNoTexture));
    if (any(has_image)) {
      const Texel<F> texel = lookup<F>(textures, texture, along(&R::picture_u),
                                       along(&R::picture_v), F(0.f), has_image);
      result =
          select<F>(has_image, result * not_negative(Color<F>(texel.r, texel.g, texel.b)), result);
    }
    return result;
  }

  Color<F> passed(const TextureView* textures, const LeavingLight<F>& light,
                  const Mask<F>& lanes) const {
    using R = FilterRecord;
    const F near = clamp(F(F(light.distance - (*this)[&R::near_start]) * (*this)[&R::near_inverse]),
                         F(0.f), F(1.f));
    const F far = clamp(F(F(light.distance - (*this)[&R::far_start]) * (*this)[&R::far_inverse]),
                        F(0.f), F(1.f));
    Color<F> result(F(near * F(1.f - far)));
    const F window = (*this)[&R::distance];
    const Mask<F> in_frame = lanes & (window > 0.f);
    if (any(in_frame)) {
      const Vec3<F> rows[3] = {(*this)[&R::row_x], (*this)[&R::row_y], (*this)[&R::row_z]};
      const Vec3<F> origin = (*this)[&R::origin];
      const Vec3<F> x{dot(rows[0], light.position) + origin.x,
                      dot(rows[1], light.position) + origin.y,
                      dot(rows[2], light.position) + origin.z};
      const Vec3<F> e{dot(rows[0], light.along), dot(rows[1], light.along),
                      dot(rows[2], light.along)};
      const F along_axis = window + x.z;
      const Mask<F> through = in_frame & (e.z < 0.f) & (along_axis > 0.f);
      const F s = along_axis / select(through, F(-e.z), F(1.f));
      const Color<F> transmitted = at_window(textures, fma(e.x, s, x.x), fma(e.y, s, x.y), through);
      result =
          select<F>(in_frame, select<F>(through, result * transmitted, Color<F>(F(0.f))), result);
    }
    return lerp(Color<F>(F(1.f)), result, (*this)[&R::density]);
  }
};

/// Returns the radiance that passes filter `filter` and all filters chained to it. For kNoFilter,
/// the radiance is unchanged.
template <typename F>
[[gnu::noinline]] Color<F> filtered(const LightView& view, const UInt<F>& filter,
                                    const LeavingLight<F>& light, const Color<F>& radiance,
                                    const Mask<F>& lanes) {
  using U = UInt<F>;
  Color<F> result = radiance;
  U at = filter;
  for (;;) {
    const Mask<F> active = lanes & Mask<F>(at != U(kNoFilter));
    if (none(active)) return result;
    const FilterReader<F> reader(view, at, active);
    result =
        select<F>(active, result * reader.passed(view.materials.textures, light, active), result);
    at = select(Mask<U>(active), reader[&FilterRecord::next], U(kNoFilter));
  }
}

}  // namespace wavecomb::detail
