// SPDX-License-Identifier: Apache-2.0
/// Free flights and transmittance in homogeneous volumes, which need no null collisions.
#pragma once

#include <algorithm>

#include "wavecomb/medium/volume/equiangular.h"
#include "wavecomb/medium/volume/free_flights.h"
#include "wavecomb/medium/volume/ray_segments.h"

namespace wavecomb {

/// Returns whether a volume is homogeneous within its box.
inline bool is_homogeneous(const VolumeRecord& v) {
  return !v.density.grid.table;
}

/// Returns whether distances in a volume may be sampled by equiangular sampling (equiangular.h).
inline bool supports_equiangular(const VolumeRecord& v) {
  return is_homogeneous(v) && std::max({v.albedo[0], v.albedo[1], v.albedo[2]}) > 0;
}

namespace detail {

/// Packet of ray segments from index `k` on, clipped to the box of a homogeneous volume.
template <typename F>
struct HomogeneousSegments {
  Vec3<F> o, d;
  F begin, end;
  Mask<F> hits_box;

  HomogeneousSegments(const VolumeRecord& v, const RaySegments& segments, size_t k,
                      const Mask<F>& lanes, VolumeCounts& counts)
      : o(load<F>(segments.ox + k), load<F>(segments.oy + k), load<F>(segments.oz + k)),
        d(load<F>(segments.dx + k), load<F>(segments.dy + k), load<F>(segments.dz + k)) {
    const GridTraversal<F> traversal(v.density, o, d, load<F>(segments.most + k), lanes);
    hits_box = traversal.on();
    begin = traversal.x();
    end = traversal.leave();
    counts.lanes += kWidth<F>;
    counts.steps += count<F>(lanes);
  }
};

}  // namespace detail

/// Samples free flights through a homogeneous volume, with equiangular sampling where possible
/// (equiangular.h). `segments.most` is the original length of each segment, before any volume
/// stopped it, so that repeated calls get the same equiangular distribution. With kStops, the
/// function samples where flights stop. With kRatios, it computes the weights, after all volumes
/// were sampled.
template <typename F>
inline void sample_homogeneous_flights(const VolumeView& volumes, uint32_t i,
                                       const RaySegments& segments, const Flights& flights,
                                       FlightResults results, const LightView& distance_lights,
                                       VolumeCounts& counts) {
  using U = UInt<F>;
  const VolumeRecord& v = volumes.volumes[i];
  if (v.max_extinction <= 0) return;
  const U volume_material(volumes.first_material + i);
  const F extinction[3] = {F(v.extinction[0]), F(v.extinction[1]), F(v.extinction[2])};
  const F least = min(extinction[0], min(extinction[1], extinction[2]));
  for (size_t k = 0; k < segments.count; k += kWidth<F>) {
    const U hero = load<U>(flights.hero + k);
    const Mask<F> lanes =
        first_lanes<F>(segments.count - k) & Mask<F>(hero != U(uint32_t{Flights::kNoHero}));
    const detail::HomogeneousSegments<F> w(v, segments, k, lanes, counts);
    if (none(w.hits_box)) continue;
    const auto of_hero = [&](const F(&x)[3]) {
      return select(hero == U(0u), x[0], select(hero == U(1u), x[1], x[2]));
    };
    CollisionSequence<F> numbers;
    numbers.start(load<U>(segments.seed + k), i, lanes);
    const F first = i == 0 ? load<F>(segments.first + k) : numbers.next(lanes);
    const F chooses = numbers.next(lanes), angle = numbers.next(lanes);
    const F x = numbers.next(lanes), y = numbers.next(lanes), z = numbers.next(lanes);
    const EquiangularDistribution<F> distribution = equiangular_distribution<F>(
        distance_lights, {.o = w.o, .d = w.d, .begin = w.begin, .end = w.end, .extinction = least},
        {x, y, z, F(0.f)}, w.hits_box);
    const F stop = load<F>(flights.t + k);
    if (results == FlightResults::kStops) {
      const F own = of_hero(extinction);
      F at = w.begin - log(F(1.f - first)) / select(own > 0.f, own, F(1e-30f));
      const Mask<F> by_angle = chooses < distribution.share;
      at = select(by_angle, clamp(distribution.sample_distance(angle), w.begin, w.end), at);
      const Mask<F> stops = w.hits_box & (at < w.end) & (at < stop);
      counts.collisions += count<F>(stops);
      store(flights.t + k, select(stops, at, stop));
      store(flights.material + k,
            select(Mask<U>(stops), volume_material, load<U>(flights.material + k)));
      continue;
    }
    const Mask<F> stopped = w.hits_box & Mask<F>(load<U>(flights.material + k) == volume_material);
    const F at = clamp(stop, w.begin, w.end);
    F sampled[3], scale[3];
    for (size_t c = 0; c < 3; ++c) {
      const OutcomeDensity<F> density =
          outcome_density<F>(distribution, extinction[c], F(at - w.begin), at, stopped);
      sampled[c] = density.sampled;
      scale[c] = density.exact / select(density.sampled > 0.f, density.sampled, F(1.f));
    }
    const F by_hero = of_hero(sampled);
    const F inverse = F(1.f) / select(by_hero > 0.f, by_hero, F(1.f));
    for (size_t c = 0; c < 3; ++c) {
      const auto times = [&](float* column, const F& factor) {
        const F before = load<F>(column + k);
        store(column + k, select(w.hits_box, F(before * factor), before));
      };
      times(flights.ratio[c], sampled[c] * inverse);
      times(flights.scale[c], scale[c]);
    }
  }
}

/// Multiplies each `product` by the transmittance of a ray segment through a homogeneous volume.
template <typename F>
inline void multiply_homogeneous_transmittance(const VolumeRecord& v, const RaySegments& segments,
                                               float* const (&product)[3], VolumeCounts& counts) {
  for (size_t k = 0; k < segments.count; k += kWidth<F>) {
    const detail::HomogeneousSegments<F> w(v, segments, k, first_lanes<F>(segments.count - k),
                                           counts);
    const F length = select(w.hits_box, F(w.end - w.begin), F(0.f));
    for (size_t c = 0; c < 3; ++c)
      store(product[c] + k, load<F>(product[c] + k) * exp(F(length * -v.extinction[c])));
  }
}

}  // namespace wavecomb
