// SPDX-License-Identifier: Apache-2.0
/// Filters of lights: what stands before a light and changes what goes through it.
///
/// Light leaves a place x of the light along e. In the filter's own space it crosses the window,
/// the plane z = -distance, at w = x + e (distance + x_z) / -e_z, and
///   doors     product over four sides of smoothstep(a w_x + b w_y + c)
///   picture   texel at (u . (w_x, w_y, 1), v . (w_x, w_y, 1))
///   decay     of the distance to what is lit: near (d - near_start) / (near_end - near_start),
///             far 1 - (d - far_start) / (far_end - far_start), both within 0 and 1
/// multiply the radiance. Light that does not go through the window, as it starts beyond it or goes
/// the other way, is dark. A filter of density k lets 1 - k of the light by as it is.
#pragma once

#include "wavecomb/core/fields.h"
#include "wavecomb/light/record.h"
#include "wavecomb/texture/lookup.h"

namespace wavecomb::detail {

/// Place and direction of light that leaves a light, in the world, and how far it goes.
template <typename F>
struct Leaving {
  Vec3<F> place, along;
  F distance;
};

/// What one filter lets through.
template <typename F>
struct FilterReader : RecordReader<F> {
  FilterReader(const LightView& view, const UInt<F>& filter, const Mask<F>& lanes)
      : RecordReader<F>(make_reader<FilterRecord, F>(view.filters, filter, lanes)) {}

  /// Of window (x, y), where light meets it; picture: what it shows there.
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
    const Mask<F> pictured = lanes & Mask<F>(texture != UInt<F>(kNoTexture));
    if (any(pictured)) {
      const Texel<F> texel = lookup<F>(textures, texture, along(&R::picture_u),
                                       along(&R::picture_v), F(0.f), pictured);
      result =
          select<F>(pictured, result * not_negative(Color<F>(texel.r, texel.g, texel.b)), result);
    }
    return result;
  }

  Color<F> passed(const TextureView* textures, const Leaving<F>& light,
                  const Mask<F>& lanes) const {
    using R = FilterRecord;
    const F near = clamp(F(F(light.distance - (*this)[&R::near_start]) * (*this)[&R::near_inverse]),
                         F(0.f), F(1.f));
    const F far = clamp(F(F(light.distance - (*this)[&R::far_start]) * (*this)[&R::far_inverse]),
                        F(0.f), F(1.f));
    Color<F> result(F(near * F(1.f - far)));
    const F window = (*this)[&R::distance];
    const Mask<F> framed = lanes & (window > 0.f);
    if (any(framed)) {
      const Vec3<F> rows[3] = {(*this)[&R::row_x], (*this)[&R::row_y], (*this)[&R::row_z]};
      const Vec3<F> origin = (*this)[&R::origin];
      const Vec3<F> x{dot(rows[0], light.place) + origin.x, dot(rows[1], light.place) + origin.y,
                      dot(rows[2], light.place) + origin.z};
      const Vec3<F> e{dot(rows[0], light.along), dot(rows[1], light.along),
                      dot(rows[2], light.along)};
      const F way = window + x.z;
      const Mask<F> through = framed & (e.z < 0.f) & (way > 0.f);
      const F s = way / select(through, F(-e.z), F(1.f));
      const Color<F> shown = at_window(textures, fma(e.x, s, x.x), fma(e.y, s, x.y), through);
      result = select<F>(framed, select<F>(through, result * shown, Color<F>(F(0.f))), result);
    }
    return lerp(Color<F>(F(1.f)), result, (*this)[&R::density]);
  }
};

/// Radiance as filter `filter` and those that go with it let it through; as it is for kNoFilter.
template <typename F>
[[gnu::noinline]] Color<F> filtered(const LightView& view, const UInt<F>& filter,
                                    const Leaving<F>& light, const Color<F>& radiance,
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
