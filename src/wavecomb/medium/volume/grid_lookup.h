// SPDX-License-Identifier: Apache-2.0
/// Interpolated lookup in a voxel grid. All lanes read the same grid, each lane at a different
/// position.
#pragma once

#include "wavecomb/core/lanes/lanes.h"
#include "wavecomb/core/vec.h"
#include "wavecomb/medium/description/volume.h"
#include "wavecomb/texture/half.h"

namespace wavecomb {

/// Transforms a point from world space to the space of a grid, in which a brick has edge length 1.
template <typename F>
inline Vec3<F> bricks_point(const float (&m)[12], const Vec3<F>& p) {
  const auto row = [&](int i) {
    return fma(p.x, F(m[i]), fma(p.y, F(m[i + 1]), fma(p.z, F(m[i + 2]), F(m[i + 3]))));
  };
  return {row(0), row(4), row(8)};
}
template <typename F>
inline Vec3<F> bricks_vector(const float (&m)[12], const Vec3<F>& v) {
  const auto row = [&](int i) {
    return fma(v.x, F(m[i]), fma(v.y, F(m[i + 1]), F(v.z * m[i + 2])));
  };
  return {row(0), row(4), row(8)};
}

namespace detail {

/// Returns value `i` of a brick.
template <typename F>
inline F voxel_value(const GridView& grid, const UInt<F>& brick, const UInt<F>& i,
                     const Mask<F>& active) {
  using U = UInt<F>;
  const uint32_t values = kBrickVoxels * grid.components;
  if (!grid.is_half) return gather<F>(grid.voxels, brick * values + i, active);
  const U word = gather<U>(grid.voxels, brick * ((values + 1) / 2) + (i >> 1), Mask<U>(active));
  return half_to_float<F>(select((i & 1u) == U(0u), U(word & 0xffffu), U(word >> 16)));
}

}  // namespace detail

/// Returns the trilinearly interpolated value of a grid at the point `p` in the grid's space. A
/// grid with a single component returns its value in all three channels. A grid without a table is
/// 1 everywhere. `p` must lie inside the table, up to rounding error.
template <typename F>
inline Color<F> grid_color(const GridView& grid, const Vec3<F>& p, const Mask<F>& active) {
  using U = UInt<F>;
  if (!grid.table) return Color<F>(F(1.f));
  U cell[3], in_brick[3];
  F fraction[3];
  const F* const at[3] = {&p.x, &p.y, &p.z};
  Mask<F> inside = active;
  for (int k = 0; k < 3; ++k) {
    const F x = *at[k] * static_cast<float>(kBrickEdge);
    const auto end = static_cast<float>(grid.size[k] * kBrickEdge);
    inside = inside & (x >= 0.f) & (x <= end);
    const F within = clamp(select(inside, x, F(0.f)), F(0.f), F(end));
    const F low = min(floor(within), F(end - 1.f));
    const U voxel(to_int<F>(low));
    fraction[k] = within - low;
    cell[k] = voxel >> 3;
    in_brick[k] = voxel & 7u;
  }
  const U brick = gather<U>(grid.table, cell[0] + grid.size[0] * (cell[1] + grid.size[1] * cell[2]),
                            Mask<U>(inside));
  const Mask<F> stored = inside & Mask<F>(brick != U(kNoBrick));
  Color<F> out(F(grid.background));
  if (none(stored)) return out;
  const U first = in_brick[0] + kBrickRow * (in_brick[1] + kBrickRow * in_brick[2]);
  const auto component = [&](uint32_t c) {
    const auto voxel = [&](uint32_t step) {
      return detail::voxel_value<F>(grid, brick, U((first + step) * grid.components + c), stored);
    };
    const auto lerp = [](const F& t, const F& a, const F& b) { return fma(t, F(b - a), a); };
    const auto along_x = [&](uint32_t step) {
      return lerp(fraction[0], voxel(step), voxel(step + 1));
    };
    const auto across = [&](uint32_t step) {
      return lerp(fraction[1], along_x(step), along_x(step + kBrickRow));
    };
    return lerp(fraction[2], across(0), across(kBrickRow * kBrickRow));
  };
  const F x = component(0);
  const bool is_colour = grid.components == 3;
  const Color<F> value = is_colour ? Color<F>(x, component(1), component(2)) : Color<F>(x, x, x);
  return select<F>(stored, value, out);
}

/// Returns the value of a grid with one component.
template <typename F>
inline F grid_value(const GridView& grid, const Vec3<F>& p, const Mask<F>& active) {
  return grid_color<F>(grid, p, active).x;
}

}  // namespace wavecomb
