// SPDX-License-Identifier: Apache-2.0
/// Definitions for lookup.h. Include this file only where the templates are instantiated.
#pragma once

#include "wavecomb/guiding/lookup.h"

namespace wavecomb {

namespace detail {

/// Converts a coordinate to grid steps, of which there are 2^kGuideBits per axis.
template <typename F>
inline UInt<F> guide_steps(const F& p, float lo, float scale) {
  constexpr auto most = static_cast<float>((1u << kGuideBits) - 1);
  const F at = (p - lo) * scale;
  return UInt<F>(to_int<F>(clamp(select(is_finite(at), at, F(0.f)), F(0.f), F(most))));
}

/// Finds the cell that contains the grid position (x, y, z).
template <typename F>
inline UInt<F> guide_cell(const GuideView& guide, const UInt<F>& x, const UInt<F>& y,
                          const UInt<F>& z, const Mask<F>& active) {
  using U = UInt<F>;
  constexpr uint32_t top_shift = kGuideBits - kGuideTopBits;
  U entry = gather<U>(guide.grid,
                      (x >> top_shift) | ((y >> top_shift) << kGuideTopBits) |
                          ((z >> top_shift) << (2 * kGuideTopBits)),
                      Mask<U>(active));
  constexpr uint32_t brick_mask = (1u << kGuideBrickBits) - 1;
  for (uint32_t level = 1; level <= kGuideLevels; ++level) {
    const Mask<U> divided = Mask<U>(active) & Mask<U>(entry < U(kGuideCell));
    if (none(divided)) break;
    const auto shift = static_cast<int>(top_shift - level * kGuideBrickBits);
    const U at = ((x >> shift) & brick_mask) | (((y >> shift) & brick_mask) << kGuideBrickBits) |
                 (((z >> shift) & brick_mask) << (2 * kGuideBrickBits));
    entry = select(divided, gather<U>(guide.grid, entry + at, divided), entry);
  }
  return entry & (kGuideCell - 1);
}

/// Entry of a cumulative row that contains sample value k: its bin and its 32-bit word. The row
/// starts at tables[first] and has kGuideSide bins.
template <typename F>
struct GuideBin {
  UInt<F> bin, word;
};
template <typename F>
inline GuideBin<F> find_guide_bin(const uint32_t* tables, const UInt<F>& first, const UInt<F>& k,
                                  const Mask<F>& active) {
  using U = UInt<F>;
  const Mask<U> on(active);
  U bin(0u), word = gather<U>(tables, first, on);
  for (uint32_t step = kGuideSide / 2; step > 0; step /= 2) {
    const U next = bin + step;
    const U there = gather<U>(tables, first + next, on);
    const Mask<U> reached = (there & 0xffffu) <= k;
    bin = select(reached, next, bin);
    word = select(reached, there, word);
  }
  return {bin, word};
}

/// Position of a sample value (u x 65536) within its bin, in [0, 1).
template <typename F>
inline F place_in_bin(const F& numbers, const UInt<F>& word) {
  const F start = F(Int<F>(word & 0xffffu)), count = F(Int<F>(word >> 16));
  return clamp(F((numbers - start) / max(count, F(1.f))), F(0.f), F(kOneMinusEpsilon));
}

}  // namespace detail

template <typename F>
[[gnu::noinline]] GuidePlace<F> find_guide(const GuideView& guide, const Vec3<F>& p,
                                           const UInt<F>& axis, const UInt<F>& material,
                                           const Mask<F>& active) {
  using U = UInt<F>;
  GuidePlace<F> place;
  place.axis = axis;
  if (!guide.grid) return place;
  const U x = detail::guide_steps<F>(p.x, guide.lo[0], guide.scale[0]);
  const U y = detail::guide_steps<F>(p.y, guide.lo[1], guide.scale[1]);
  const U z = detail::guide_steps<F>(p.z, guide.lo[2], guide.scale[2]);
  const U cell = detail::guide_cell<F>(guide, x, y, z, active);
  place.region = gather<U>(guide.cells, cell * kGuideAxes + place.axis, Mask<U>(active));
  const Mask<F> known = place.known = active & Mask<F>(place.region != U(kNoGuideRegion));
  const F least = gather<F>(guide.material_share, material, known);
  const F share = max(gather<F>(guide.bsdf_share, place.region, known), least);
  place.bsdf_share = select(known, share, F(1.f));
  static_assert(sizeof(GuideSphere) == 4 * sizeof(float));
  const auto of_sphere = [&, at = place.region * 4u](uint32_t i) {
    return gather<F>(guide.spheres->middle, at + i, known);
  };
  const F nearness = select(known, of_sphere(3), F(0.f));
  place.offset = sphere_offset<F>(p, {of_sphere(0), of_sphere(1), of_sphere(2)}, nearness);
  place.survival = gather<F>(guide.survival, place.region, known);
  place.guided = known & (place.bsdf_share < 1.f);
  return place;
}

template <typename F>
[[gnu::noinline]] F guide_pdf(const GuideView& guide, const GuidePlace<F>& place, const Vec3<F>& w,
                              const Mask<F>& active) {
  using U = UInt<F>;
  const FromMiddle<F> seen = seen_from_middle<F>(place.offset, w);
  const Vec2<F> at = octahedral_point<F>(seen.w);
  const auto bin = [](const F& x) {
    constexpr auto side = static_cast<float>(kGuideSide);
    return U(to_int<F>(clamp(F(x * side), F(0.f), F(side - 0.5f))));
  };
  const Mask<U> on(active);
  const U first = place.region * kGuideWords, row = bin(at.y), column = bin(at.x);
  const U marginal = gather<U>(guide.tables, first + row, on);
  const U within = gather<U>(guide.tables, first + kGuideSide + row * kGuideSide + column, on);
  constexpr float density = kInv4Pi * static_cast<float>(kGuideBins) * 0x1p-32f;
  const F numbers = F(Int<F>(marginal >> 16)) * F(Int<F>(within >> 16));
  return select(active, F(numbers * density * seen.factor), F(0.f));
}

template <typename F>
[[gnu::noinline]] Vec3<F> sample_guide(const GuideView& guide, const GuidePlace<F>& place,
                                       const F& u, const F& v, const Mask<F>& active) {
  using U = UInt<F>;
  const U first = place.region * kGuideWords;
  const F row_number = v * 65536.f, column_number = u * 65536.f;
  const auto row = detail::find_guide_bin<F>(guide.tables, first, U(to_int<F>(row_number)), active);
  const auto column = detail::find_guide_bin<F>(
      guide.tables, first + kGuideSide + row.bin * kGuideSide, U(to_int<F>(column_number)), active);
  constexpr float width = 1.f / static_cast<float>(kGuideSide);
  const F y = (F(Int<F>(row.bin)) + detail::place_in_bin<F>(row_number, row.word)) * width;
  const F x = (F(Int<F>(column.bin)) + detail::place_in_bin<F>(column_number, column.word)) * width;
  return seen_from_place<F>(place.offset, octahedral_direction<F>(x, y));
}

}  // namespace wavecomb
