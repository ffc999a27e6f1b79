// SPDX-License-Identifier: Apache-2.0
/// Definition of read_texture (inputs.h), for the translation units that instantiate it.
#pragma once

#include "wavecomb/material/inputs/inputs.h"
#include "wavecomb/texture/lookup.inl"

namespace wavecomb::detail {

template <typename F>
Vec3<F> read_texture(const MaterialView& view, const RecordReader<F>& use, const Vec2<F>& uv,
                     const Footprint<F>& footprint, const Mask<F>& active) {
  using R = TextureUseRecord;
  F m[6];
  for (size_t i = 0; i < 6; ++i) m[i] = use.at(&R::uv, i);
  const F s = fma(m[0], uv.x, fma(m[1], uv.y, m[2]));
  const F t = fma(m[3], uv.x, fma(m[4], uv.y, m[5]));
  // The footprint is scaled by the length of the longer transformed axis.
  const F stretch = sqrt(max(fma(m[0], m[0], F(m[3] * m[3])), fma(m[1], m[1], F(m[4] * m[4]))));
  const Footprint<F> lookup_footprint = footprint.scaled(stretch);
  const UInt<F> id = use[&R::texture];
  const Texel<F> texel = use.shared ? lookup<F>(view.textures[first_active(id, active)], s, t,
                                                lookup_footprint, active)
                                    : lookup<F>(view.textures, id, s, t, lookup_footprint, active);
  const auto channel = [&](const F& value, size_t i) {
    return fma(value, use.at(&R::scale, i), use.at(&R::bias, i));
  };
  const F c[4] = {channel(texel.r, 0), channel(texel.g, 1), channel(texel.b, 2),
                  channel(texel.a, 3)};
  const UInt<F> which = use[&R::channel];
  F one = c[0];
  for (uint32_t i = 1; i < 4; ++i) one = select(Mask<F>(which == UInt<F>(i)), c[i], one);
  const Mask<F> rgb = Mask<F>(which >= UInt<F>(4u));
  return {select(rgb, c[0], one), select(rgb, c[1], one), select(rgb, c[2], one)};
}

}  // namespace wavecomb::detail
