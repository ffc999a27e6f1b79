// SPDX-License-Identifier: Apache-2.0
/// Emission along ray segments through volumes.
#pragma once

#include "wavecomb/medium/volume/tracking.h"

namespace wavecomb {

/// Estimates the radiance that one volume emits along a ray segment, by one point on it. The point
/// is sampled in proportion to the grid's largest value in each cell, and the estimate includes the
/// transmittance of all volumes up to the point.
template <typename F>
inline Color<F> emission_of(const VolumeView& volumes, uint32_t index, const Way<F>& way,
                            const RaySegment<F>& segment, const Mask<F>& active,
                            VolumeCounts& counts) {
  const VolumeRecord& v = volumes.volumes[index];
  const auto each_cell = [&](const auto& visit) {
    for (BrickWalk<F> walk(glow_cells(v), segment.o, segment.d, segment.length, active);
         any(walk.on());) {
      visit(walk, F(walk.most() * (walk.leave() - walk.x())));
      walk.next_cell(walk.on());
    }
  };
  F total(0.f);
  each_cell([&](const BrickWalk<F>& walk, const F& share) {
    total = select(walk.on(), F(total + share), total);
  });
  const Mask<F> shines = active & (total > 0.f);
  if (none(shines)) return Color<F>(F(0.f));
  CollisionNumbers<F> numbers;
  numbers.start(way.branch(kMostVolumes).seed, index, shines);
  const F wanted = (index == 0 ? way.r.w : numbers.next(shines)) * total;
  F before(0.f), x(0.f), greatest(0.f);
  Vec3<F> p(F(0.f));
  each_cell([&](const BrickWalk<F>& walk, const F& share) {
    // The last cell that begins before the target value, so that rounding skips no cell.
    const Mask<F> here = walk.on() & (share > 0.f) & (before <= wanted);
    const F fraction = clamp(F((wanted - before) / select(here, share, F(1.f))), F(0.f), F(1.f));
    const F at = fma(fraction, F(walk.leave() - walk.x()), walk.x());
    x = select(here, at, x);
    greatest = select(here, walk.most(), greatest);
    p = select<F>(here, walk.at(at), p);
    before = select(walk.on(), F(before + share), before);
  });
  const Color<F> value = glow_at<F>(v, p, segment.time, shines);
  const F weight = total / select(shines & (greatest > 0.f), greatest, F(1.f));
  const Color<F> emission{F(v.emission[0]), F(v.emission[1]), F(v.emission[2])};
  RaySegment<F> to_point = segment;
  to_point.length = x;
  const Color<F> through =
      transmittance_through<F>(volumes, way.branch(index), to_point, shines, counts);
  return select<F>(shines, value * emission * weight * through, Color<F>(F(0.f)));
}

}  // namespace wavecomb
