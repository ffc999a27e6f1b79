// SPDX-License-Identifier: Apache-2.0
/// Definitions for lookup.h. Include this file only where the templates are instantiated.
#pragma once

#include "wavecomb/guiding/lookup.h"

namespace wavecomb {

namespace detail {

/// Converts a coordinate to grid steps, of which there are 2^kGuidingBits per axis.
template <typename F>
inline UInt<F> guiding_steps(const F& p, float lo, float scale) {
  constexpr auto most = static_cast<float>((1u << kGuidingBits) - 1);
  const F at = (p - lo) * scale;
  return UInt<F>(to_int<F>(clamp(select(is_finite(at), at, F(0.f)), F(0.f), F(most))));
}

/// Finds the cell that contains the grid position (x, y, z).
template <typename F>
inline UInt<F> guiding_cell(const GuidingView& guide, const UInt<F>& x, const UInt<F>& y,
                            const UInt<F>& z, const Mask<F>& active) {
  using U = UInt<F>;
  constexpr uint32_t top_shift = kGuidingBits - kGuidingTopBits;
  U entry = gather<U>(guide.grid,
                      (x >> top_shift) | ((y >> top_shift) << kGuidingTopBits) |
                          ((z >> top_shift) << (2 * kGuidingTopBits)),
                      Mask<U>(active));
  constexpr uint32_t brick_mask = (1u << kGuidingBrickBits) - 1;
  for (uint32_t level = 1; level <= kGuidingLevels; ++level) {
    const Mask<U> divided = Mask<U>(active) & Mask<U>(entry < U(kGuidingCell));
    if (none(divided)) break;
    const auto shift = static_cast<int>(top_shift - level * kGuidingBrickBits);
    const U at = ((x >> shift) & brick_mask) | (((y >> shift) & brick_mask) << kGuidingBrickBits) |
                 (((z >> shift) & brick_mask) << (2 * kGuidingBrickBits));
    entry = select(divided, gather<U>(guide.grid, entry + at, divided), entry);
  }
  return entry & (kGuidingCell - 1);
}

/// Bin of a sampling table row to which a sample value k is assigned: the index of the bin, and its
/// 32-bit word in the table. The row starts at tables[first] and has kGuidingSide bins.
template <typename F>
struct GuidingBin {
  UInt<F> bin, word;
};
template <typename F>
inline GuidingBin<F> find_guiding_bin(const uint32_t* tables, const UInt<F>& first,
                                      const UInt<F>& k, const Mask<F>& active) {
  using U = UInt<F>;
  const Mask<U> on(active);
  U bin(0u), word = gather<U>(tables, first, on);
  for (uint32_t step = kGuidingSide / 2; step > 0; step /= 2) {
    const U next = bin + step;
    const U entry_found = gather<U>(tables, first + next, on);
    const Mask<U> reached = (entry_found & 0xffffu) <= k;
    bin = select(reached, next, bin);
    word = select(reached, entry_found, word);
  }
  return {bin, word};
}

/// Returns the position of a sample value (u x 65536) within its bin, in [0, 1).
template <typename F>
inline F position_in_bin(const F& numbers, const UInt<F>& word) {
  const F start = F(Int<F>(word & 0xffffu)), count = F(Int<F>(word >> 16));
  return clamp(F((numbers - start) / max(count, F(1.f))), F(0.f), F(kOneMinusEpsilon));
}

}  // namespace detail

template <typename F>
[[gnu::noinline]] GuidingLookup<F> look_up_guiding(const GuidingView& guide, const Vec3<F>& p,
                                                   const UInt<F>& axis, const UInt<F>& material,
                                                   const Mask<F>& active) {
  using U = UInt<F>;
  GuidingLookup<F> guiding;
  guiding.axis = axis;
  if (!guide.grid) return guiding;
  const U x = detail::guiding_steps<F>(p.x, guide.lo[0], guide.scale[0]);
  const U y = detail::guiding_steps<F>(p.y, guide.lo[1], guide.scale[1]);
  const U z = detail::guiding_steps<F>(p.z, guide.lo[2], guide.scale[2]);
  const U cell = detail::guiding_cell<F>(guide, x, y, z, active);
  guiding.region = gather<U>(guide.cells, cell * kGuidingAxes + guiding.axis, Mask<U>(active));
  const Mask<F> known = guiding.known = active & Mask<F>(guiding.region != U(kNoGuidingRegion));
  const F least = gather<F>(guide.material_share, material, known);
  const F share = max(gather<F>(guide.bsdf_share, guiding.region, known), least);
  guiding.bsdf_share = select(known, share, F(1.f));
  static_assert(sizeof(ParallaxSphere) == 4 * sizeof(float));
  const auto of_sphere = [&, at = guiding.region * 4u](uint32_t i) {
    return gather<F>(guide.spheres->centre, at + i, known);
  };
  const F inverse_distance = select(known, of_sphere(3), F(0.f));
  guiding.offset =
      sphere_offset<F>(p, {of_sphere(0), of_sphere(1), of_sphere(2)}, inverse_distance);
  guiding.survival = gather<F>(guide.survival, guiding.region, known);
  guiding.guided = known & (guiding.bsdf_share < 1.f);
  return guiding;
}

template <typename F>
[[gnu::noinline]] F guiding_pdf(const GuidingView& guide, const GuidingLookup<F>& guiding,
                                const Vec3<F>& w, const Mask<F>& active) {
  using U = UInt<F>;
  const CentreDirection<F> from_centre = direction_from_centre<F>(guiding.offset, w);
  const Vec2<F> at = octahedral_point<F>(from_centre.w);
  const auto bin = [](const F& x) {
    constexpr auto side = static_cast<float>(kGuidingSide);
    return U(to_int<F>(clamp(F(x * side), F(0.f), F(side - 0.5f))));
  };
  const Mask<U> on(active);
  const U first = guiding.region * kGuidingWords, row = bin(at.y), column = bin(at.x);
  const U marginal = gather<U>(guide.tables, first + row, on);
  const U within = gather<U>(guide.tables, first + kGuidingSide + row * kGuidingSide + column, on);
  constexpr float density = kInv4Pi * static_cast<float>(kGuidingBins) * 0x1p-32f;
  const F numbers = F(Int<F>(marginal >> 16)) * F(Int<F>(within >> 16));
  return select(active, F(numbers * density * from_centre.factor), F(0.f));
}

template <typename F>
[[gnu::noinline]] Vec3<F> sample_guiding(const GuidingView& guide, const GuidingLookup<F>& guiding,
                                         const F& u, const F& v, const Mask<F>& active) {
  using U = UInt<F>;
  const U first = guiding.region * kGuidingWords;
  const F row_number = v * 65536.f, column_number = u * 65536.f;
  const auto row =
      detail::find_guiding_bin<F>(guide.tables, first, U(to_int<F>(row_number)), active);
  const auto column =
      detail::find_guiding_bin<F>(guide.tables, first + kGuidingSide + row.bin * kGuidingSide,
                                  U(to_int<F>(column_number)), active);
  constexpr float width = 1.f / static_cast<float>(kGuidingSide);
  const F y = (F(Int<F>(row.bin)) + detail::position_in_bin<F>(row_number, row.word)) * width;
  const F x =
      (F(Int<F>(column.bin)) + detail::position_in_bin<F>(column_number, column.word)) * width;
  return direction_from_point<F>(guiding.offset, octahedral_direction<F>(x, y));
}

}  // namespace wavecomb
