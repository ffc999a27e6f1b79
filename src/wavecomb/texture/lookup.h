// SPDX-License-Identifier: Apache-2.0
/// Texture lookup in lanes. Bodies are in lookup.inl.
#pragma once

#include "wavecomb/core/math.h"
#include "wavecomb/core/vec.h"
#include "wavecomb/texture/texture.h"

namespace wavecomb {

/// How much of a texture a lookup sees, and by how many of its texels.
///
/// A filter is a mean of up to eight texels, four of each of two levels. One texel taken with the
/// weight that the filter gives it as its probability has the same mean, for an eighth of the reads
/// (M. Pharr, B. Wronski, M. Salvi, M. Fajardo, "Filtering After Shading With Stochastic Texture
/// Filtering", Proc. ACM CGIT 7(1), 2024).
template <typename F>
struct Footprint {
  F width;                 ///< in uv units
  bool one_texel = false;  ///< or all that the filter sees
  UInt<F> bits{0u};        ///< random, for one_texel

  /// Of all texels.
  Footprint(const F& w) : width(w) {}  // NOLINT(google-explicit-constructor)
  /// Of one, chosen by `random`.
  Footprint(const F& w, const UInt<F>& random) : width(w), one_texel(true), bits(random) {}

  /// For coordinates that are `factor` times as large.
  Footprint scaled(const F& factor) const {
    Footprint f = *this;
    f.width = width * factor;
    return f;
  }
  /// Bits first to first + n - 1 as a number in (0, 1): the middle of its 2^n-th.
  F number(int first, int n) const {
    const UInt<F> part = (bits >> first) & ((1u << n) - 1u);
    return F(F(Int<F>(part)) + 0.5f) * (1.f / static_cast<float>(1u << n));
  }
};

/// Linear r, g, b and alpha.
template <typename F>
struct Texel {
  F r, g, b, a;
};

namespace detail {

template <typename F>
inline Texel<F> select_texel(const Mask<F>& m, const Texel<F>& a, const Texel<F>& b) {
  return {select(m, a.r, b.r), select(m, a.g, b.g), select(m, a.b, b.b), select(m, a.a, b.a)};
}
/// The first active lane's value.
template <typename F>
inline uint32_t first_of(const UInt<F>& value, const Mask<F>& active) {
  if constexpr (kIsScalar<F>)
    return value;
  else
    return lane(value, static_cast<size_t>(std::countr_zero(lane_bits<F>(active))));
}

}  // namespace detail

/// Trilinear lookup in one texture (the same in all lanes). `s`, `t`: texture coordinates, t up
/// (USD's convention: (0, 0) is the lower left corner of the image, texel centres are at half
/// texels). The footprint's width says the level (lod = log2(width * max(texture width, height)),
/// clamped); width <= 0 or NaN reads the finest. Any s and t are safe; NaN counts as 0. Off a
/// texture that is black outside, each tap is black, and transparent if the texture has alpha.
/// Inactive lanes are unspecified. A UDIM texture gives the tile's texel, and that of missing tiles
/// where there is none.
template <typename F>
Texel<F> lookup(const TextureView& texture, const F& s, const F& t, const Footprint<F>& footprint,
                const Mask<F>& active);

/// Lookup where each lane has its own texture id (index into `textures`); runs `lookup` once per
/// distinct id among the active lanes. Lanes with id kNoTexture give (0, 0, 0, 1).
template <typename F>
Texel<F> lookup(const TextureView* textures, const UInt<F>& id, const F& s, const F& t,
                const Footprint<F>& footprint, const Mask<F>& active);

}  // namespace wavecomb
