// SPDX-License-Identifier: Apache-2.0
/// Random walks below surfaces, in even media, collision by collision.
///
/// A walk begins where a diffuse lobe leads below a surface (OpenPbrBsdf::enters) and ends where it
/// meets the surface of the same object from below: there a white diffuse surface takes over,
/// seen from outside, with its light samples and its bounce. Nothing is refracted at either end.
/// So light that arrives evenly leaves evenly, and a flat wall has the colour that is asked for
/// (scene/walk_data.h).
///
/// Colour: a channel decides how far light goes, each as often as it has of the throughput (hero
/// wavelengths, Wilkie et al. 2014), as in volumes (medium/tracking.h).
#pragma once

#include "wavecomb/core/frame.h"
#include "wavecomb/core/math.h"
#include "wavecomb/medium/henyey_greenstein.h"
#include "wavecomb/medium/tracking.h"
#include "wavecomb/scene/walk_data.h"

namespace wavecomb {

/// Collisions after which a walk goes on by halves only: it is sure to end, and on the mean as
/// bright.
inline constexpr uint32_t kLongWalk = 512;
/// A walk that has less than this of the light that it began with goes on by chance.
inline constexpr float kFaintWalk = 0.25f;

/// A walk before its next collision.
template <typename F>
struct Walk {
  Vec3<F> o, d;
  Color<F> throughput;
  F first;         ///< sum of the channels of the throughput that it began with
  F gone;          ///< on the way since the last collision
  F rest;          ///< to the next one; 0: not yet known
  UInt<F> seed;    ///< of its random numbers
  UInt<F> number;  ///< of collisions so far
};

/// Four random numbers of collision `number`.
template <typename F>
inline Sample4<F> walk_numbers(const UInt<F>& seed, const UInt<F>& number) {
  using U = UInt<F>;
  const U a = hash_u32<U>(seed, number);
  return {unit_float<F>(hash_u32<U>(a ^ 0x68bc21ebu)), unit_float<F>(hash_u32<U>(a ^ 0x02e5be93u)),
          unit_float<F>(hash_u32<U>(a ^ 0x967a889bu)), unit_float<F>(hash_u32<U>(a ^ 0x368cc8b7u))};
}

/// Chooses how far a walk goes that does not know it.
template <typename F>
inline void begin_flight(const WalkMedium<F>& medium, Walk<F>& w) {
  using U = UInt<F>;
  const Sample4<F> r = walk_numbers<F>(w.seed, w.number);
  const U hero = hero_of<F>(r.x, w.throughput);
  const F extinction = select(hero == U(0u), medium.extinction.x,
                              select(hero == U(1u), medium.extinction.y, medium.extinction.z));
  const F distance = max(F(-log(F(1.f - r.y)) / extinction), F(1e-30f));
  w.rest = select(w.rest > 0.f, w.rest, distance);
}

/// Takes a walk on by `t`: to a collision, where `collides`, or to the surface. Gives the lanes
/// that go on; those of walks that have come to the surface are not among them.
template <typename F>
inline Mask<F> end_flight(const WalkMedium<F>& medium, const F& t, const Mask<F>& collides,
                          Walk<F>& w) {
  using U = UInt<F>;
  const F length = w.gone + t;
  const auto ratio = [&](const F& extinction) {
    const F through = exp(F(-extinction * length));
    return select(collides, F(through * extinction), through);
  };
  const Color<F>& e = medium.extinction;
  Color<F> weight = flight_weight<F>({ratio(e.x), ratio(e.y), ratio(e.z)}, w.throughput);
  weight = select<F>(collides, weight * medium.albedo, weight);
  w.throughput = w.throughput * weight;
  w.o = fma(w.d, t, w.o);
  w.gone = F(0.f);
  w.rest = F(0.f);

  // After the numbers of the flight come those of the collision.
  const Sample4<F> r = walk_numbers<F>(w.seed, U(w.number + 0x80000000u));
  const F sum = w.throughput.x + w.throughput.y + w.throughput.z;
  F q = select(sum < F(kFaintWalk) * w.first, F(sum / w.first), F(1.f));
  q = select(w.number >= kLongWalk, F(0.5f * q), q);
  const Mask<F> on = collides & (r.z < q);
  w.throughput = select<F>(on, w.throughput * F(F(1.f) / select(on, q, F(1.f))), w.throughput);

  const F g = select(abs(medium.anisotropy) < F(kLeastMeanCosine), F(0.f), medium.anisotropy);
  const F c = sample_henyey_greenstein<F>(g, r.x);
  const F s = safe_sqrt(F(1.f - c * c));
  const SinCos<F> turn = sincos_2pi(r.y);
  const Vec3<F> next =
      normalize(make_frame<F>(w.d).to_world(Vec3<F>(F(s * turn.cos), F(s * turn.sin), c)));
  w.d = select<F>(on, next, w.d);
  w.number = select(Mask<U>(on), w.number + 1u, w.number);
  return on;
}

/// The medium of a material below whose surface light walks.
template <typename F>
inline WalkMedium<F> walk_medium(const WalkView& view, const UInt<F>& material,
                                 const Mask<F>& active) {
  return load_row<WalkMedium, F>(reinterpret_cast<const float*>(view.media), material, active);
}

}  // namespace wavecomb
