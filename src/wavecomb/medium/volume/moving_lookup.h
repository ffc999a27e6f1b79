// SPDX-License-Identifier: Apache-2.0
/// Lookup of volume fields at the shutter time of a ray. A moving field has, at the point p, the
/// value of its grid at p - v(p) t. v is the velocity at p, and t is the time in seconds relative
/// to the time of the grids.
///
/// In a moving volume, rays traverse cells that bound the field over the whole shutter interval
/// (medium/description/volume_motion.h). In a static volume, rays traverse the cells of the field's
/// grid. All lanes of a packet traverse the same grid.
#pragma once

#include "wavecomb/medium/volume/grid_lookup.h"

namespace wavecomb {

/// Returns the grid that rays traverse to sample the density of a volume.
inline const TransformedGrid& extinction_cells(const VolumeRecord& v) {
  return v.moves ? v.density_cells : v.density;
}
/// Returns the grid that rays traverse to sample the emission of a volume.
inline const TransformedGrid& emission_cells(const VolumeRecord& v) {
  return v.moves ? v.emission_cells : v.emission_field;
}

/// Returns the time of a volume in seconds at a shutter time from 0 to 1.
template <typename F>
inline F seconds_at(const VolumeRecord& v, const F& time) {
  return fma(time, F(v.seconds_span), F(v.seconds_open));
}

/// Returns the grid position, in bricks, from which a moving field's value has moved to the point
/// `p`.
template <typename F>
inline Vec3<F> drifted(const FieldDrift& drift, const GridView& velocity, const Vec3<F>& p,
                       const F& seconds, const Mask<F>& active) {
  const Color<F> v = grid_color<F>(velocity, bricks_point<F>(drift.to_velocity, p), active);
  const Vec3<F> displacement = bricks_vector<F>(drift.per_second, v) * seconds;
  return bricks_point<F>(drift.to_bricks, p) - displacement;
}

/// Returns the density at `p`, in the space of `extinction_cells`.
template <typename F>
inline F density_at(const VolumeRecord& v, const Vec3<F>& p, const F& seconds,
                    const Mask<F>& active) {
  if (!v.moves) return grid_value<F>(v.density.grid, p, active);
  return grid_value<F>(v.density.grid, drifted<F>(v.density_drift, v.velocity, p, seconds, active),
                       active);
}
/// Returns the emission field at `p`, in the space of `emission_cells`, at a shutter time.
template <typename F>
inline Color<F> emission_at(const VolumeRecord& v, const Vec3<F>& p, const F& time,
                            const Mask<F>& active) {
  if (!v.moves) return grid_color<F>(v.emission_field.grid, p, active);
  return grid_color<F>(v.emission_field.grid,
                       drifted<F>(v.emission_drift, v.velocity, p, seconds_at<F>(v, time), active),
                       active);
}
/// Returns the colour field at a point in world space, at a shutter time.
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
