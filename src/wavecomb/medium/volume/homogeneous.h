// SPDX-License-Identifier: Apache-2.0
/// Free flights and transmittance in homogeneous volumes, which need no null collisions.
#pragma once

#include <algorithm>

#include "wavecomb/medium/volume/equiangular.h"
#include "wavecomb/medium/volume/free_flights.h"
#include "wavecomb/medium/volume/ray_segments.h"

namespace wavecomb {

/// Returns whether a volume is homogeneous within its box.
inline bool is_even(const VolumeRecord& v) {
  return !v.density.grid.table;
}

/// Returns whether lights guide the distances in a volume (equiangular.h).
inline bool is_drawn_by_lamps(const VolumeRecord& v) {
  return is_even(v) && std::max({v.albedo[0], v.albedo[1], v.albedo[2]}) > 0;
}

namespace detail {

/// Packet of ray segments from index `k` on, clipped to the box of a homogeneous volume.
template <typename F>
struct EvenWays {
  Vec3<F> o, d;
  F begin, end;
  Mask<F> meets;

  EvenWays(const VolumeRecord& v, const Ways& ways, size_t k, const Mask<F>& lanes,
           VolumeCounts& counts)
      : o(load<F>(ways.ox + k), load<F>(ways.oy + k), load<F>(ways.oz + k)),
        d(load<F>(ways.dx + k), load<F>(ways.dy + k), load<F>(ways.dz + k)) {
    const BrickWalk<F> walk(v.density, o, d, load<F>(ways.most + k), lanes);
    meets = walk.on();
    begin = walk.x();
    end = walk.leave();
    counts.lanes += kWidth<F>;
    counts.steps += count<F>(lanes);
  }
};

}  // namespace detail

/// Samples free flights through a homogeneous volume, including by lights (equiangular.h).
/// `ways.most` is the original length of each segment, before any volume stopped it, so that
/// repeated calls sample the lights for the same part. kStops samples where flights stop; kRatios
/// computes the weights after all volumes were sampled.
template <typename F>
inline void fly_evenly(const VolumeView& volumes, uint32_t i, const Ways& ways,
                       const Flights& flights, FlightKeeps keeps, const LightView& lamps,
                       VolumeCounts& counts) {
  using U = UInt<F>;
  const VolumeRecord& v = volumes.volumes[i];
  if (v.most_extinction <= 0) return;
  const U mine(volumes.first_material + i);
  const F extinction[3] = {F(v.extinction[0]), F(v.extinction[1]), F(v.extinction[2])};
  const F least = min(extinction[0], min(extinction[1], extinction[2]));
  for (size_t k = 0; k < ways.count; k += kWidth<F>) {
    const U hero = load<U>(flights.hero + k);
    const Mask<F> lanes =
        first_lanes<F>(ways.count - k) & Mask<F>(hero != U(uint32_t{Flights::kNoHero}));
    const detail::EvenWays<F> w(v, ways, k, lanes, counts);
    if (none(w.meets)) continue;
    const auto of_hero = [&](const F(&x)[3]) {
      return select(hero == U(0u), x[0], select(hero == U(1u), x[1], x[2]));
    };
    CollisionNumbers<F> numbers;
    numbers.start(load<U>(ways.seed + k), i, lanes);
    const F first = i == 0 ? load<F>(ways.first + k) : numbers.next(lanes);
    const F chooses = numbers.next(lanes), angle = numbers.next(lanes);
    const F x = numbers.next(lanes), y = numbers.next(lanes), z = numbers.next(lanes);
    const LampWay<F> lamp = lamp_way<F>(
        lamps, {.o = w.o, .d = w.d, .begin = w.begin, .end = w.end, .extinction = least},
        {x, y, z, F(0.f)}, w.meets);
    const F stop = load<F>(flights.t + k);
    if (keeps == FlightKeeps::kStops) {
      const F own = of_hero(extinction);
      F at = w.begin - log(F(1.f - first)) / select(own > 0.f, own, F(1e-30f));
      const Mask<F> by_lamp = chooses < lamp.share;
      at = select(by_lamp, clamp(lamp.draw(angle), w.begin, w.end), at);
      const Mask<F> stops = w.meets & (at < w.end) & (at < stop);
      counts.collisions += count<F>(stops);
      store(flights.t + k, select(stops, at, stop));
      store(flights.material + k, select(Mask<U>(stops), mine, load<U>(flights.material + k)));
      continue;
    }
    const Mask<F> stopped = w.meets & Mask<F>(load<U>(flights.material + k) == mine);
    const F at = clamp(stop, w.begin, w.end);
    F drawn[3], scale[3];
    for (size_t c = 0; c < 3; ++c) {
      const EvenChance<F> chance =
          even_chance<F>(lamp, extinction[c], F(at - w.begin), at, stopped);
      drawn[c] = chance.drawn;
      scale[c] = chance.truth / select(chance.drawn > 0.f, chance.drawn, F(1.f));
    }
    const F by_hero = of_hero(drawn);
    const F inverse = F(1.f) / select(by_hero > 0.f, by_hero, F(1.f));
    for (size_t c = 0; c < 3; ++c) {
      const auto times = [&](float* column, const F& factor) {
        const F before = load<F>(column + k);
        store(column + k, select(w.meets, F(before * factor), before));
      };
      times(flights.ratio[c], drawn[c] * inverse);
      times(flights.scale[c], scale[c]);
    }
  }
}

/// Multiplies each `product` by the transmittance of a ray segment through a homogeneous volume.
template <typename F>
inline void pass_evenly(const VolumeRecord& v, const Ways& ways, float* const (&product)[3],
                        VolumeCounts& counts) {
  for (size_t k = 0; k < ways.count; k += kWidth<F>) {
    const detail::EvenWays<F> w(v, ways, k, first_lanes<F>(ways.count - k), counts);
    const F length = select(w.meets, F(w.end - w.begin), F(0.f));
    for (size_t c = 0; c < 3; ++c)
      store(product[c] + k, load<F>(product[c] + k) * exp(F(length * -v.extinction[c])));
  }
}

}  // namespace wavecomb
