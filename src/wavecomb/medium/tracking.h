// SPDX-License-Identifier: Apache-2.0
/// Free flights, transmittance and emission along a way through volumes.
///
/// Null-scattering (Miller, Georgiev and Jarosz, "A null-scattering path integral formulation of
/// light transport", 2019): extinction is filled up with collisions that change nothing, to a
/// majorant that is constant in each cell of a grid, so that distances to collisions are
/// exponential. One volume is looked at after the other; where several overlap, the nearest of
/// their collisions is that of all together, since the least of independent exponential distances
/// is exponential with the sum of their rates.
///
/// Random numbers: of collision i in volume v they are hashes of (the path's numbers, v, i), which
/// no schedule changes.
#pragma once

#include "wavecomb/core/hash.h"
#include "wavecomb/core/math.h"
#include "wavecomb/integrate/media.h"
#include "wavecomb/integrate/statistics.h"
#include "wavecomb/medium/brick_walk.h"

namespace wavecomb {

/// What a way draws from: the numbers of its vertex set, of which the first volume takes some as
/// they are, well spread over a pixel's samples, and a seed for all others.
template <typename F>
struct Way {
  Sample4<F> r;
  UInt<F> seed;
  VolumeCounts* counts;  ///< gets what it takes

  Way(const Passage<F>& p, VertexSet set, VolumeCounts& takes)
      : r(sample_4d<F>(p.sampler, p.key, vertex_set(set, p.depth))),
        seed(float_bits<F>(r.x) ^ hash_u32<UInt<F>>(p.key.pixel_hash, p.key.sample)),
        counts(&takes) {}
  /// Another one with numbers of its own.
  Way branch(uint32_t number) const {
    Way other = *this;
    other.seed = hash_u32<UInt<F>>(seed, UInt<F>(0x2545f491u + number));
    return other;
  }
};

/// Numbers of a way through one volume, one after the other. Each lane counts its own.
template <typename F>
struct CollisionNumbers {
  UInt<F> seed, count{0u};
  VolumeCounts* counts;

  CollisionNumbers(const Way<F>& way, uint32_t volume)
      : seed(hash_u32<UInt<F>>(way.seed, UInt<F>(0x9c8f2d3bu + volume))), counts(way.counts) {}
  F next(const Mask<F>& lanes) {
    const F number = unit_float<F>(hash_u32<UInt<F>>(seed, count));
    count = select(Mask<UInt<F>>(lanes), UInt<F>(count + 1u), count);
    return number;
  }
};

namespace detail {

/// Follows lanes from one collision with the majorant to the next, real or not, and calls
/// collide(lanes, x, p, majorant) there: x along the way, p in the grid's space, the majorant of
/// the grid's own values. It returns the lanes that end.
template <typename F, typename Collide>
inline void each_collision(const PlacedGrid& placed, float scale, const Vec3<F>& o,
                           const Vec3<F>& d, const F& most, const Mask<F>& active,
                           CollisionNumbers<F>& numbers, const F* first, const Collide& collide) {
  if (scale <= 0) return;
  BrickWalk<F> walk(placed, o, d, most, active);
  // Optical depth that is left until the next collision.
  const auto depth = [](const F& number) { return F(-log(F(1.f - number))); };
  if (none(walk.on())) return;
  F left = depth(first ? *first : numbers.next(walk.on()));
  while (any(walk.on())) {
    const F majorant = walk.most() * scale;
    const F leave = walk.leave();
    const F here = majorant * (leave - walk.x());
    const Mask<F> collides = walk.on() & (left < here);
    numbers.counts->lanes += kWidth<F>;
    numbers.counts->steps += count<F>(walk.on());
    numbers.counts->collisions += count<F>(collides);
    const Mask<F> passes = walk.on() & not_(collides);
    if (any(collides)) {
      const F x = min(F(walk.x() + left / select(collides, majorant, F(1.f))), leave);
      walk.move_to(x, collides);
      const F again = depth(numbers.next(collides));
      left = select(collides, again, F(left - here));
      walk.stop(collide(collides, x, walk.at(x), majorant));
    } else {
      left = left - here;
    }
    walk.next_cell(passes);
  }
}

}  // namespace detail

/// What became of a way through one volume.
template <typename F>
struct Collision {
  Mask<F> stopped;
  F x;             ///< where, if so
  Color<F> ratio;  ///< by channel: probability of what happened, over that by the channel that
                   ///< decided
};

/// Lanes fly through `v` until they collide or have come to `most`. Channel `hero` decides in each.
template <typename F>
inline Collision<F> fly_through(const VolumeRecord& v, uint32_t index, const Way<F>& way,
                                const UInt<F>& hero, const Vec3<F>& o, const Vec3<F>& d,
                                const F& most, const Mask<F>& active) {
  using U = UInt<F>;
  Collision<F> out{Mask<F>(false), F(0.f), Color<F>(F(1.f))};
  CollisionNumbers<F> numbers(way, index);
  const F of_hero = select(hero == U(0u), F(v.extinction[0]),
                           select(hero == U(1u), F(v.extinction[1]), F(v.extinction[2])));
  detail::each_collision<F>(
      v.density, v.most_extinction, o, d, most, active, numbers, index == 0 ? &way.r.z : nullptr,
      [&](const Mask<F>& lanes, const F& x, const Vec3<F>& p, const F& majorant) {
        const F density = grid_value<F>(v.density.grid, p, lanes) / select(lanes, majorant, F(1.f));
        const F real = min(F(density * of_hero), F(1.f));
        const Mask<F> stops = lanes & (numbers.next(lanes) < real);
        if (!v.is_grey) {
          const F by_hero = F(1.f) / select(stops, real, F(1.f - real));
          const auto channel = [&](const F& ratio, float extinction) {
            const F share = min(F(density * extinction), F(1.f));
            return select(lanes, F(ratio * select(stops, share, F(1.f - share)) * by_hero), ratio);
          };
          out.ratio = {channel(out.ratio.x, v.extinction[0]), channel(out.ratio.y, v.extinction[1]),
                       channel(out.ratio.z, v.extinction[2])};
        }
        out.stopped = out.stopped | stops;
        out.x = select(stops, x, out.x);
        return stops;
      });
  return out;
}

/// A free flight through all volumes. The path meets the volume's material where it stops. Each
/// channel decides in so many flights as it has of the path's throughput T (hero wavelengths,
/// Wilkie et al., "Hero Wavelength Spectral Sampling", 2014). So the weight is, with the
/// probabilities p_c of what happened,
///   p_c sum(T) / sum over channels k of T_k p_k
/// which leaves sum(T) as it was, however often the path is scattered.
template <typename F>
inline Flight<F> fly_through(const VolumeView& volumes, const Passage<F>& p,
                             const Color<F>& throughput, const Mask<F>& active,
                             VolumeCounts& counts) {
  using U = UInt<F>;
  const Way<F> way(p, VertexSet::kFlight, counts);
  const F sum = throughput.x + throughput.y + throughput.z, u = way.r.y * sum;
  const U hero =
      select(u < throughput.x, U(0u), select(u < F(throughput.x + throughput.y), U(1u), U(2u)));
  Flight<F> f{Mask<F>(false), p.t, U(0u), Color<F>(F(1.f))};
  bool is_grey = true;
  for (uint32_t i = 0; i < volumes.count; ++i) {
    const VolumeRecord& v = volumes.volumes[i];
    is_grey = is_grey && v.is_grey;
    const Collision<F> c = fly_through<F>(v, i, way, hero, p.o, p.d, f.t, active);
    f.t = select(c.stopped, c.x, f.t);
    f.material = select(Mask<U>(c.stopped), U(volumes.first_material + i), f.material);
    f.stopped = f.stopped | c.stopped;
    f.weight = c.ratio;
  }
  if (is_grey) {
    f.weight = Color<F>(F(1.f));
    return f;
  }
  // With several volumes, flights through the first ones went further than to what stopped them in
  // the end: once more, with the same numbers, to there. A flight to its own end is itself.
  if (volumes.count > 1) {
    f.weight = Color<F>(F(1.f));
    for (uint32_t i = 0; i < volumes.count; ++i) {
      const Mask<F> stopper = f.stopped & Mask<F>(f.material == U(volumes.first_material + i));
      const F until = select(stopper, p.t, f.t);
      f.weight *= fly_through<F>(volumes.volumes[i], i, way, hero, p.o, p.d, until, active).ratio;
    }
  }
  const F shares = dot(f.weight, throughput);
  f.weight = f.weight * F(sum / select(shares > 0.f, shares, F(1.f)));
  return f;
}

/// Transmittance of p.o + x p.d, 0 < x < `most`, by ratio tracking (Novak, Selle and Jarosz,
/// "Residual Ratio Tracking", 2014, eq. 9), which ends at random where little is left.
template <typename F>
inline Color<F> transmittance_through(const VolumeView& volumes, const Way<F>& way,
                                      const Vec3<F>& o, const Vec3<F>& d, const F& most,
                                      const Mask<F>& active) {
  constexpr float kLittle = 0.1f;
  Color<F> product(F(1.f));
  Mask<F> on = active;
  for (uint32_t i = 0; i < volumes.count && any(on); ++i) {
    const VolumeRecord& v = volumes.volumes[i];
    CollisionNumbers<F> numbers(way, i);
    detail::each_collision<F>(
        v.density, v.most_extinction, o, d, most, on, numbers, i == 0 ? &way.r.z : nullptr,
        [&](const Mask<F>& lanes, const F& /*x*/, const Vec3<F>& p, const F& majorant) {
          const F density =
              grid_value<F>(v.density.grid, p, lanes) / select(lanes, majorant, F(1.f));
          const auto kept = [&](float extinction) {
            return max(F(1.f - density * extinction), F(0.f));
          };
          Color<F> now = product * Color<F>(kept(v.extinction[0]), kept(v.extinction[1]),
                                            kept(v.extinction[2]));
          const F largest = max_component(now);
          const F q = min(F(largest * (1.f / kLittle)), F(1.f));
          const Mask<F> ends = lanes & not_(numbers.next(lanes) < q);
          now = now * F(F(1.f) / select(q > 0.f, q, F(1.f)));
          product = select<F>(lanes, select<F>(ends, Color<F>(F(0.f)), now), product);
          on = on & not_(ends);
          return ends;
        });
  }
  return product;
}

/// Radiance that one volume sends along a way, by a point of it with density proportional to the
/// grid's greatest values of its cells, and the transmittance of all volumes up to there.
template <typename F>
inline Color<F> emission_of(const VolumeView& volumes, uint32_t index, const Way<F>& way,
                            const Vec3<F>& o, const Vec3<F>& d, const F& most,
                            const Mask<F>& active) {
  const VolumeRecord& v = volumes.volumes[index];
  const auto each_cell = [&](const auto& visit) {
    for (BrickWalk<F> walk(v.glow, o, d, most, active); any(walk.on());) {
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
  CollisionNumbers<F> numbers(way.branch(kMostVolumes), index);
  const F wanted = (index == 0 ? way.r.w : numbers.next(shines)) * total;
  F before(0.f), x(0.f), greatest(0.f);
  Vec3<F> p(F(0.f));
  each_cell([&](const BrickWalk<F>& walk, const F& share) {
    // The last cell that begins before what is wanted, so that rounding loses none.
    const Mask<F> here = walk.on() & (share > 0.f) & (before <= wanted);
    const F fraction = clamp(F((wanted - before) / select(here, share, F(1.f))), F(0.f), F(1.f));
    const F at = fma(fraction, F(walk.leave() - walk.x()), walk.x());
    x = select(here, at, x);
    greatest = select(here, walk.most(), greatest);
    p = select<F>(here, walk.at(at), p);
    before = select(walk.on(), F(before + share), before);
  });
  const Color<F> value = grid_color<F>(v.glow.grid, p, shines);
  const F weight = total / select(shines & (greatest > 0.f), greatest, F(1.f));
  const Color<F> emission{F(v.emission[0]), F(v.emission[1]), F(v.emission[2])};
  const Color<F> through = transmittance_through<F>(volumes, way.branch(index), o, d, x, shines);
  return select<F>(shines, value * emission * weight * through, Color<F>(F(0.f)));
}

}  // namespace wavecomb
