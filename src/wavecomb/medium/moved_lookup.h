// SPDX-License-Identifier: Apache-2.0
/// Fields of volumes at the time of a ray. What is at p is what the field has at p - v(p) t, with
/// the velocity v there and t the seconds since the grids were as they are.
///
/// Volumes that move are looked at cell by cell of a space that bounds all that comes by
/// (scene/volume_motion.h), others by those of their grids; which of the two is the same for all
/// lanes.
#pragma once

#include "wavecomb/medium/grid_lookup.h"

namespace wavecomb {

/// The cells by which a volume's density is flown through.
inline const PlacedGrid& flown_cells(const VolumeRecord& v) {
  return v.moves ? v.density_cells : v.density;
}
/// And those of what it emits.
inline const PlacedGrid& glow_cells(const VolumeRecord& v) {
  return v.moves ? v.glow_cells : v.glow;
}

/// Seconds at a time of the shutter, from 0 to 1.
template <typename F>
inline F seconds_at(const VolumeRecord& v, const F& time) {
  return fma(time, F(v.seconds_span), F(v.seconds_open));
}

/// Where a field is read for `p`, in its bricks.
template <typename F>
inline Vec3<F> drifted(const FieldDrift& drift, const GridView& velocity, const Vec3<F>& p,
                       const F& seconds, const Mask<F>& active) {
  const Color<F> v = grid_color<F>(velocity, bricks_point<F>(drift.to_velocity, p), active);
  const Vec3<F> way = bricks_vector<F>(drift.per_second, v) * seconds;
  return bricks_point<F>(drift.to_bricks, p) - way;
}

/// Density at `p`, in the space of `flown_cells`.
template <typename F>
inline F density_at(const VolumeRecord& v, const Vec3<F>& p, const F& seconds,
                    const Mask<F>& active) {
  if (!v.moves) return grid_value<F>(v.density.grid, p, active);
  return grid_value<F>(v.density.grid, drifted<F>(v.density_drift, v.velocity, p, seconds, active),
                       active);
}
/// What the field of emission has at `p`, in the space of `glow_cells`, at a time of the shutter.
template <typename F>
inline Color<F> glow_at(const VolumeRecord& v, const Vec3<F>& p, const F& time,
                        const Mask<F>& active) {
  if (!v.moves) return grid_color<F>(v.glow.grid, p, active);
  return grid_color<F>(
      v.glow.grid, drifted<F>(v.glow_drift, v.velocity, p, seconds_at<F>(v, time), active), active);
}
/// What the field of colour has at a point of the world, at a time of the shutter.
template <typename F>
inline Color<F> tint_at(const VolumeRecord& v, const Vec3<F>& p, const F& time,
                        const Mask<F>& active) {
  if (!v.moves || !v.color.grid.table)
    return grid_color<F>(v.color.grid, bricks_point<F>(v.color.to_bricks, p), active);
  return grid_color<F>(v.color.grid,
                       drifted<F>(v.color_drift, v.velocity, p, seconds_at<F>(v, time), active),
                       active);
}

}  // namespace wavecomb
