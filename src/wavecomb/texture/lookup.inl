// SPDX-License-Identifier: Apache-2.0
/// Definitions for lookup.h; include only where the templates are instantiated.
#pragma once

#include "wavecomb/core/rows/fields.h"
#include "wavecomb/core/rows/rows.h"
#include "wavecomb/texture/half.h"
#include "wavecomb/texture/lookup.h"
#include "wavecomb/texture/srgb.h"

namespace wavecomb {

namespace detail {

/// Returns a + (b - a) t, which is exactly a if a == b.
template <typename F>
inline Texel<F> lerp_texel(const Texel<F>& a, const Texel<F>& b, const F& t) {
  return {fma(F(b.r - a.r), t, a.r), fma(F(b.g - a.g), t, a.g), fma(F(b.b - a.b), t, a.b),
          fma(F(b.a - a.a), t, a.a)};
}

/// Size and storage offset of the mip level of each lane.
template <typename F>
struct LevelLanes {
  UInt<F> width, height, tiles_x, offset;
};

/// Returns the given mip level in all lanes.
template <typename F>
inline LevelLanes<F> broadcast_level(const TextureLevel& level) {
  using U = UInt<F>;
  return {U(level.width), U(level.height), U(level.tiles_x), U(level.offset)};
}
/// Returns level `index` (< level_count) in each lane.
template <typename F>
inline LevelLanes<F> gather_level(const TextureView& texture, const UInt<F>& index,
                                  const Mask<F>& active) {
  constexpr uint32_t kWords = sizeof(TextureLevel) / 4;
  const auto words = load_rows<kWords, F>(texture.levels, index * kWords, active);
  const auto word = [&](uint32_t at) { return float_bits<F>(words[at]); };
  return {word(word_of(&TextureLevel::width)), word(word_of(&TextureLevel::height)),
          word(word_of(&TextureLevel::tiles_x)), word(word_of(&TextureLevel::offset))};
}

/// Two neighbouring texels along one axis, and the interpolation weight.
template <typename F>
struct Taps {
  UInt<F> i0, i1;    ///< indices, always below the size
  F weight;          ///< weight of i1, in [0, 1)
  Mask<F> in0, in1;  ///< false if the tap is outside the image with Wrap::kBlack
};

/// Maps a coordinate into [0, 1], or [-2, 3] for Wrap::kBlack; NaN becomes 0.
template <typename F>
inline F wrap_coordinate(Wrap wrap, const F& x) {
  const F zero(0.f), one(1.f);
  switch (wrap) {
    case Wrap::kRepeat:
      return clamp(F(x - floor(x)), zero, one);
    case Wrap::kClamp:
      return clamp(x, zero, one);
    case Wrap::kMirror: {
      const F fold = fnma(floor(F(x * 0.5f)), F(2.f), x);  // in [0, 2]
      return clamp(select(fold > 1.f, F(2.f - fold), fold), zero, one);
    }
    case Wrap::kBlack:
      return clamp(select(x == x, x, zero), F(-2.f), F(3.f));
  }
  return zero;
}

/// Returns the taps at texel coordinate `x`, where texel i has its centre at x = i.
template <typename F>
inline Taps<F> make_taps(Wrap wrap, const F& x, const UInt<F>& size) {
  const F base = floor(x);
  const Int<F> n = Int<F>(size), zero(0), last = n - 1;
  const Int<F> a = to_int<F>(base), b = a + 1;
  const Mask<F> a_low = Mask<F>(a < zero), b_high = Mask<F>(b > last);
  Taps<F> taps{UInt<F>(0u), UInt<F>(0u), F(x - base), Mask<F>(true), Mask<F>(true)};
  if (wrap == Wrap::kRepeat) {
    // The lower tap a lies in [-1, size - 1], or is equal to `size` due to rounding. The upper tap
    // is b = a + 1.
    const Int<F> a_in = select(Mask<F>(a > last), zero, a);
    taps.i0 = UInt<F>(select(a_low, last, a_in));
    taps.i1 = UInt<F>(select(
        b_high, select(Mask<F>(b > n), select(Mask<F>(n > Int<F>(1)), Int<F>(1), zero), zero), b));
  } else {
    if (wrap == Wrap::kBlack) {
      taps.in0 = not_(a_low) & Mask<F>(a <= last);
      taps.in1 = Mask<F>(b >= zero) & not_(b_high);
    }
    const auto inside = [&](const Int<F>& i) {
      const Int<F> low = select(Mask<F>(i < zero), zero, i);
      return UInt<F>(select(Mask<F>(low > last), last, low));
    };
    taps.i0 = inside(a);
    taps.i1 = inside(b);
  }
  return taps;
}

/// Returns the storage index, in texels, of column x and row y of a level.
template <typename F>
inline UInt<F> texel_offset(const LevelLanes<F>& level, const UInt<F>& x, const UInt<F>& y) {
  static_assert(TextureView::kTile == 8);
  const UInt<F> tile = (y >> 3) * level.tiles_x + (x >> 3);
  return level.offset + (tile << 6) + ((y & 7u) << 3) + (x & 7u);
}

template <typename F>
inline UInt<F> fetch_word(const TextureView& texture, const UInt<F>& word, const Mask<F>& active) {
  return float_bits<F>(gather<F>(texture.texels, word, active));
}

/// Converts a byte to its linear value.
template <typename F>
inline F decode_u8(bool srgb, const UInt<F>& byte) {
  if (srgb) return lookup256<F>(kSrgbToLinear.data(), byte);
  return F(Int<F>(byte)) * (1.f / 255.f);
}

/// Reads the texel at storage index `i`.
template <typename F>
inline Texel<F> fetch(const TextureView& texture, const UInt<F>& i, const Mask<F>& active) {
  const F one(1.f);
  if (texture.channels == 1) {
    F value(0.f);
    if (texture.format == TexelFormat::kU8) {
      const UInt<F> word = fetch_word<F>(texture, i >> 2, active);
      value = decode_u8<F>(texture.srgb, (word >> ((i & 3u) << 3)) & 0xffu);
    } else if (texture.format == TexelFormat::kF16) {
      const UInt<F> word = fetch_word<F>(texture, i >> 1, active);
      value = half_to_float<F>((word >> ((i & 1u) << 4)) & 0xffffu);
    } else {
      value = gather<F>(texture.texels, i, active);
    }
    return {value, value, value, one};
  }
  Texel<F> t;
  if (texture.format == TexelFormat::kU8) {
    const UInt<F> word = fetch_word<F>(texture, i, active);
    t.r = decode_u8<F>(texture.srgb, word & 0xffu);
    t.g = decode_u8<F>(texture.srgb, (word >> 8) & 0xffu);
    t.b = decode_u8<F>(texture.srgb, (word >> 16) & 0xffu);
    t.a = texture.has_alpha ? decode_u8<F>(false, word >> 24) : one;
  } else if (texture.format == TexelFormat::kF16) {
    const auto words = load_rows<2, F>(texture.texels, i << 1, active);
    const UInt<F> rg = float_bits<F>(words[0]), ba = float_bits<F>(words[1]);
    t.r = half_to_float<F>(rg & 0xffffu);
    t.g = half_to_float<F>(rg >> 16);
    t.b = half_to_float<F>(ba & 0xffffu);
    t.a = texture.has_alpha ? half_to_float<F>(ba >> 16) : one;
  } else {
    const auto words = load_rows<4, F>(texture.texels, i << 2, active);
    t.r = words[0];
    t.g = words[1];
    t.b = words[2];
    t.a = texture.has_alpha ? words[3] : one;
  }
  return t;
}

/// Reads the texel at column x and row y of a level. `in` is false for taps outside the image,
/// which are black with Wrap::kBlack.
template <typename F>
inline Texel<F> tap(const TextureView& texture, const LevelLanes<F>& level, const UInt<F>& x,
                    const UInt<F>& y, const Mask<F>& in, const Mask<F>& active) {
  const Texel<F> texel = fetch<F>(texture, texel_offset<F>(level, x, y), active);
  if (texture.wrap_s != Wrap::kBlack && texture.wrap_t != Wrap::kBlack) return texel;
  const F zero(0.f);
  return select_texel<F>(in, texel, {zero, zero, zero, texture.has_alpha ? zero : F(1.f)});
}

/// Bilinear lookup in one level; s and t must come from wrap_coordinate.
template <typename F>
inline Texel<F> bilinear(const TextureView& texture, const LevelLanes<F>& level, const F& s,
                         const F& t, const Mask<F>& active) {
  const F width(Int<F>(level.width)), height(Int<F>(level.height));
  // Rows are stored from the top, but t points up.
  const Taps<F> x = make_taps<F>(texture.wrap_s, fma(s, width, F(-0.5f)), level.width);
  const Taps<F> y = make_taps<F>(texture.wrap_t, fnma(t, height, F(height - 0.5f)), level.height);
  const auto at = [&](const UInt<F>& i, const UInt<F>& j, const Mask<F>& in) {
    return tap<F>(texture, level, i, j, in, active);
  };
  const Texel<F> top =
      lerp_texel<F>(at(x.i0, y.i0, x.in0 & y.in0), at(x.i1, y.i0, x.in1 & y.in0), x.weight);
  const Texel<F> low =
      lerp_texel<F>(at(x.i0, y.i1, x.in0 & y.in1), at(x.i1, y.i1, x.in1 & y.in1), x.weight);
  return lerp_texel<F>(top, low, y.weight);
}

/// Reads one texel of one level, chosen with a probability equal to its weight in bilinear
/// filtering.
template <typename F>
inline Texel<F> one_texel(const TextureView& texture, const LevelLanes<F>& level, const F& s,
                          const F& t, const Footprint<F>& footprint, const Mask<F>& active) {
  const F width(Int<F>(level.width)), height(Int<F>(level.height));
  const F left = footprint.number(0, 11) - 0.5f, up = footprint.number(11, 11) - 0.5f;
  const Taps<F> x = make_taps<F>(texture.wrap_s, fma(s, width, left), level.width);
  const Taps<F> y = make_taps<F>(texture.wrap_t, fnma(t, height, F(height + up)), level.height);
  return tap<F>(texture, level, x.i0, y.i0, x.in0 & y.in0, active);
}

/// Implements `lookup` for a texture without UDIM tiles.
template <typename F>
inline Texel<F> lookup_plain(const TextureView& texture, const F& s, const F& t,
                             const Footprint<F>& footprint, const Mask<F>& active) {
  const F s_in = wrap_coordinate<F>(texture.wrap_s, s);
  const F t_in = wrap_coordinate<F>(texture.wrap_t, t);
  const TextureLevel& finest = texture.levels[0];
  const float size =
      static_cast<float>(finest.width > finest.height ? finest.width : finest.height);
  const F texels_wide = footprint.width * size;
  const Mask<F> coarse = (texels_wide > 1.f) & active;
  if (none(coarse)) {
    const LevelLanes<F> level = broadcast_level<F>(finest);
    return footprint.one_texel ? one_texel<F>(texture, level, s_in, t_in, footprint, active)
                               : bilinear<F>(texture, level, s_in, t_in, active);
  }
  const uint32_t last = texture.level_count - 1;
  // Lanes that read only the finest level get lod 0. Their result does not depend on whether other
  // lanes of the packet read coarser levels.
  const F lod = min(log2(clamp(texels_wide, F(1.f), F(1e9f))), F(static_cast<float>(last)));
  if (footprint.one_texel) {
    const F nearest = max(floor(F(lod + footprint.number(22, 10))), F(0.f));
    const UInt<F> level = select(Mask<UInt<F>>(coarse), UInt<F>(to_int<F>(nearest)), UInt<F>(0u));
    return one_texel<F>(texture, gather_level<F>(texture, level, active), s_in, t_in, footprint,
                        active);
  }
  const F base = max(floor(lod), F(0.f));
  const F weight = select(coarse, F(lod - base), F(0.f));
  const UInt<F> level = select(coarse, UInt<F>(to_int<F>(base)), UInt<F>(0u));
  const Texel<F> fine =
      bilinear<F>(texture, gather_level<F>(texture, level, active), s_in, t_in, active);
  const Mask<F> mixed = (weight > 0.f) & active;
  if (none(mixed)) return fine;
  const UInt<F> next = select(mixed, level + 1u, level);
  const Texel<F> rough =
      bilinear<F>(texture, gather_level<F>(texture, next, mixed), s_in, t_in, mixed);
  return select_texel<F>(mixed, lerp_texel<F>(fine, rough, weight), fine);
}

/// Implements `lookup` for a UDIM texture: calls `lookup_plain` once for each tile that active
/// lanes read. A point on the border of two tiles belongs to the tile above or to the right.
/// Filters do not cross borders.
template <typename F>
[[gnu::noinline]] Texel<F> lookup_tiles(const TextureView& texture, const F& s, const F& t,
                                        const Footprint<F>& footprint, const Mask<F>& active) {
  using U = UInt<F>;
  const F zero(0.f), columns(static_cast<float>(TileSet::kColumns));
  // NaN becomes 0. Coordinates far outside the tiles are clamped to values that fit an integer and
  // are still outside.
  const auto clean = [&](const F& x) { return clamp(select(x == x, x, zero), F(-1.f), columns); };
  const F column = floor(clean(s)), row = floor(clean(t));
  const Mask<F> inside =
      (column >= zero) & (row >= zero) & (column < columns) & (row < columns) & active;
  const U tile = select(Mask<U>(inside), U(to_int<F>(fma(row, columns, column))), U(0u));
  Texel<F> result = lookup_plain<F>(texture, zero, zero, F(0.f), active);
  Mask<F> pending = inside;
  while (any(pending)) {
    const uint32_t one = first_of<F>(tile, pending);
    const Mask<F> same = pending & Mask<F>(tile == U(one));
    if (const TextureView* view = texture.tiles->views[one]) {
      const Texel<F> texel = lookup_plain<F>(*view, F(s - column), F(t - row), footprint, same);
      result = select_texel<F>(same, texel, result);
    }
    pending = pending & not_(same);
  }
  return result;
}

}  // namespace detail

template <typename F>
inline Texel<F> lookup(const TextureView& texture, const F& s, const F& t,
                       const Footprint<F>& footprint, const Mask<F>& active) {
  if (texture.tiles) [[unlikely]] {
    // Copy the arguments here, so that the compiler keeps the originals in registers for textures
    // without tiles.
    const F u = s, v = t;
    const Footprint<F> f = footprint;
    const Mask<F> on = active;
    return detail::lookup_tiles<F>(texture, u, v, f, on);
  }
  return detail::lookup_plain<F>(texture, s, t, footprint, active);
}

template <typename F>
inline Texel<F> lookup(const TextureView* textures, const UInt<F>& id, const F& s, const F& t,
                       const Footprint<F>& footprint, const Mask<F>& active) {
  Texel<F> result{F(0.f), F(0.f), F(0.f), F(1.f)};
  Mask<F> pending = active & Mask<F>(id != UInt<F>(kNoTexture));
  while (any(pending)) {
    const uint32_t one = detail::first_of<F>(id, pending);
    const Mask<F> same = pending & Mask<F>(id == UInt<F>(one));
    result = detail::select_texel<F>(same, lookup<F>(textures[one], s, t, footprint, same), result);
    pending = pending & not_(same);
  }
  return result;
}

}  // namespace wavecomb
