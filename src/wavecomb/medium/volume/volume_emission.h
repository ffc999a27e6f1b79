// SPDX-License-Identifier: Apache-2.0
/// Emission along ray segments through volumes.
#pragma once

#include "wavecomb/medium/volume/tracking.h"

namespace wavecomb {

/// Estimates the radiance that one volume emits along a ray segment. The estimate uses a single
/// sampled point of the segment. The point is sampled in proportion to the grid's largest value in
/// each cell, and the estimate includes the transmittance of all volumes up to the point.
template <typename F>
inline Color<F> emission_of(const VolumeView& volumes, uint32_t index,
                            const SegmentRandom<F>& random, const RaySegment<F>& segment,
                            const Mask<F>& active, VolumeCounts& counts) {
  const VolumeRecord& v = volumes.volumes[index];
  const auto each_cell = [&](const auto& visit) {
    for (GridTraversal<F> traversal(emission_cells(v), segment.o, segment.d, segment.length,
                                    active);
         any(traversal.on());) {
      visit(traversal, F(traversal.most() * (traversal.leave() - traversal.x())));
      traversal.next_cell(traversal.on());
    }
  };
  F total(0.f);
  each_cell([&](const GridTraversal<F>& traversal, const F& share) {
    total = select(traversal.on(), F(total + share), total);
  });
  const Mask<F> has_emission = active & (total > 0.f);
  if (none(has_emission)) return Color<F>(F(0.f));
  CollisionSequence<F> numbers;
  numbers.start(random.branch(kMaxVolumes).seed, index, has_emission);
  const F wanted = (index == 0 ? random.r.w : numbers.next(has_emission)) * total;
  F before(0.f), x(0.f), greatest(0.f);
  Vec3<F> p(F(0.f));
  each_cell([&](const GridTraversal<F>& traversal, const F& share) {
    // Select the last cell whose cumulative sum begins at or below the target value, so that
    // rounding skips no cell.
    const Mask<F> here = traversal.on() & (share > 0.f) & (before <= wanted);
    const F fraction = clamp(F((wanted - before) / select(here, share, F(1.f))), F(0.f), F(1.f));
    const F at = fma(fraction, F(traversal.leave() - traversal.x()), traversal.x());
    x = select(here, at, x);
    greatest = select(here, traversal.most(), greatest);
    p = select<F>(here, traversal.at(at), p);
    before = select(traversal.on(), F(before + share), before);
  });
  const Color<F> value = emission_at<F>(v, p, segment.time, has_emission);
  const F weight = total / select(has_emission & (greatest > 0.f), greatest, F(1.f));
  const Color<F> emission{F(v.emission[0]), F(v.emission[1]), F(v.emission[2])};
  RaySegment<F> to_point = segment;
  to_point.length = x;
  const Color<F> through =
      transmittance_through<F>(volumes, random.branch(index), to_point, has_emission, counts);
  return select<F>(has_emission, value * emission * weight * through, Color<F>(F(0.f)));
}

}  // namespace wavecomb
