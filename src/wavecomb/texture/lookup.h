// SPDX-License-Identifier: Apache-2.0
/// Texture lookup in SIMD lanes. Definitions are in lookup.inl.
#pragma once

#include "wavecomb/core/math.h"
#include "wavecomb/core/vec.h"
#include "wavecomb/texture/texture.h"

namespace wavecomb {

/// Filter footprint of a lookup.
///
/// A trilinear filter is a weighted mean of up to eight texels, four in each of two levels.
/// Stochastic filtering reads only one texel, which is chosen with a probability equal to its
/// filter weight. On average, the result is the same (M. Pharr, B. Wronski, M. Salvi, M. Fajardo,
/// "Filtering After Shading With Stochastic Texture Filtering", Proc. ACM CGIT 7(1), 2024).
template <typename F>
struct Footprint {
  F width;  ///< in uv units
  /// whether to read one random texel instead of all texels under the filter
  bool one_texel = false;
  UInt<F> bits{0u};  ///< random bits, used if one_texel is set

  /// Makes a footprint for full filtering.
  Footprint(const F& w) : width(w) {}  // NOLINT(google-explicit-constructor)
  /// Makes a footprint for stochastic filtering with the random bits `random`.
  Footprint(const F& w, const UInt<F>& random) : width(w), one_texel(true), bits(random) {}

  /// Returns the footprint for texture coordinates that are scaled by `factor`.
  Footprint scaled(const F& factor) const {
    Footprint f = *this;
    f.width = width * factor;
    return f;
  }
  /// Converts `n` random bits, starting at bit `first`, to a number in (0, 1). The number is the
  /// middle of an interval of length 2^-n.
  F number(int first, int n) const {
    const UInt<F> part = (bits >> first) & ((1u << n) - 1u);
    return F(F(Int<F>(part)) + 0.5f) * (1.f / static_cast<float>(1u << n));
  }
};

/// Filtered texture value: linear r, g, b and alpha.
template <typename F>
struct Texel {
  F r, g, b, a;
};

namespace detail {

template <typename F>
inline Texel<F> select_texel(const Mask<F>& m, const Texel<F>& a, const Texel<F>& b) {
  return {select(m, a.r, b.r), select(m, a.g, b.g), select(m, a.b, b.b), select(m, a.a, b.a)};
}
/// Returns the value of `a` in the first active lane.
template <typename F>
inline uint32_t first_of(const UInt<F>& value, const Mask<F>& active) {
  if constexpr (kIsScalar<F>)
    return value;
  else
    return lane(value, static_cast<size_t>(std::countr_zero(lane_bits<F>(active))));
}

}  // namespace detail

/// Looks up one texture, the same in all lanes, with trilinear filtering. `s` and `t` are texture
/// coordinates with t up. By USD's convention, (0, 0) is the lower left corner of the image, and
/// texel centres are at half texels. The footprint's width selects the mip level lod = log2(width *
/// max(texture width, height)), clamped to the existing levels; width <= 0 or NaN reads the finest
/// level. Any s and t are valid; NaN counts as 0. With Wrap::kBlack, taps outside the image are
/// black, and transparent if the texture has alpha. The result of inactive lanes is unspecified.
/// For UDIM textures, reads the tile that contains (s, t), or returns the value of missing tiles.
template <typename F>
Texel<F> lookup(const TextureView& texture, const F& s, const F& t, const Footprint<F>& footprint,
                const Mask<F>& active);

/// Looks up a texture per lane (`id` is an index into `textures`). Calls `lookup` once per distinct
/// id among the active lanes. The result is (0, 0, 0, 1) in lanes with id kNoTexture.
template <typename F>
Texel<F> lookup(const TextureView* textures, const UInt<F>& id, const F& s, const F& t,
                const Footprint<F>& footprint, const Mask<F>& active);

}  // namespace wavecomb
