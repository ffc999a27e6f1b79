// SPDX-License-Identifier: Apache-2.0
/// Reads material inputs at hits, from constants of records or from textures.
#pragma once

#include "wavecomb/core/math.h"
#include "wavecomb/core/rows/record_reader.h"
#include "wavecomb/core/vec.h"
#include "wavecomb/material/description/material.h"
#include "wavecomb/texture/lookup.h"

namespace wavecomb {

/// Upper limit of emitted radiance, so that no product of a path overflows.
inline constexpr float kMaxEmission = 1e18f;

namespace detail {

/// Returns the texture value of a material input: texel * scale + bias, for the channels that the
/// TextureUse selects.
template <typename F>
Vec3<F> read_texture(const MaterialView& view, const RecordReader<F>& use, const Vec2<F>& uv,
                     const Footprint<F>& footprint, const Mask<F>& active);

/// Reads the values of material inputs at a hit.
template <typename F>
struct InputReader {
  const MaterialView& view;
  const UInt<F>& material;
  const Vec2<F>& uv;
  const Footprint<F>& footprint;  ///< footprint in uv space
  Mask<F> active;
  bool uniform;
  RecordReader<F> record;
  UInt<F> textured_inputs;

  InputReader(const MaterialView& view_, const UInt<F>& material_, const Vec2<F>& uv_,
              const Footprint<F>& footprint_, const Mask<F>& active_)
      : view(view_),
        material(material_),
        uv(uv_),
        footprint(footprint_),
        active(active_),
        uniform(any(active_) && is_uniform<F>(material_, active_)),
        record(make_reader<MaterialRecord, F>(view_.materials, material_, uniform, active_)),
        textured_inputs(record[&MaterialRecord::textured_inputs]) {}

  /// Returns the value of input `s`: the texture value in lanes with a texture, otherwise
  /// `constant`.
  Vec3<F> value(Input s, const Vec3<F>& constant) const {
    const uint32_t bit = input_bit(s);
    const Mask<F> textured = Mask<F>((textured_inputs & UInt<F>(bit)) != UInt<F>(0u)) & active;
    if (none(textured)) return constant;
    const UInt<F> index = material * kInputCount + static_cast<uint32_t>(s);
    const auto use = make_reader<TextureUseRecord, F>(view.uses, index, uniform, textured);
    // Emission textures use an isotropic footprint: emitters are few and bright, and light samples
    // have no ray footprint.
    const Footprint<F> lookup_footprint =
        s == Input::kEmission ? Footprint<F>(footprint.width) : footprint;
    return select<F>(textured, read_texture<F>(view, use, uv, lookup_footprint, textured),
                     constant);
  }
  F value(Input s, const F& constant) const { return value(s, Vec3<F>(constant)).x; }
};

template <typename F>
inline F saturate(const F& x) {
  return min(max(x, F(0.f)), F(1.f));  // maps NaN to 0
}
template <typename F>
inline Color<F> saturate(const Color<F>& c) {
  return {saturate(c.x), saturate(c.y), saturate(c.z)};
}

template <typename F>
inline Color<F> valid_emission(const Color<F>& c) {
  return {min(max(c.x, F(0.f)), F(kMaxEmission)), min(max(c.y, F(0.f)), F(kMaxEmission)),
          min(max(c.z, F(0.f)), F(kMaxEmission))};
}

/// Returns the lanes whose opacity is the presence of the surface instead of transparency.
template <typename F>
inline Mask<F> opacity_is_presence(const InputReader<F>& inputs, const F& threshold) {
  const UInt<F> flags = inputs.record[&MaterialRecord::flags];
  return Mask<F>((flags & UInt<F>(uint32_t{kPresence})) != UInt<F>(0u)) | (threshold > 0.f);
}

}  // namespace detail

}  // namespace wavecomb
