// SPDX-License-Identifier: Apache-2.0
/// Distances along a way that are chosen by a lamp beside it (Kulla and Fajardo, "Importance
/// Sampling Techniques for Path Tracing in Participating Media", 2012).
///
/// In an even medium a distance is drawn from a mixture: of the exponential of the channel that
/// decides (medium/tracking.h), and, in a share q, of a density in which a lamp's point c sees
/// equal angles,
///   e(x) = D / ((b - a) (D^2 + (x - delta)^2)),
/// D the distance of c from the way, delta where it is nearest, a and b the angles at which c sees
/// the ends of the medium. Both densities and their integrals are closed, so what is drawn weighs
/// exactly what it should, whichever of the two it came from (balance heuristic), and so does not
/// having stopped before what lies behind. q and c depend on the way alone.
#pragma once

#include "wavecomb/core/math.h"
#include "wavecomb/core/sampler.h"
#include "wavecomb/light/light.h"

namespace wavecomb {

/// The greatest share of equal angles.
inline constexpr float kMostEquiangular = 0.5f;
/// Where less is worth it, there is none.
inline constexpr float kLeastEquiangular = 0.02f;

/// Whether a scene has lamps that are somewhere.
inline bool has_lamps(const LightView& lights) {
  return lights.count > lights.infinite_count;
}

/// A part of a way as a lamp sees it.
template <typename F>
struct LampWay {
  F share{0.f};  ///< q, 0 where it is not worth it
  F nearest{0.f}, aside{1.f}, from{0.f}, span{1.f};

  /// A distance, with a number in [0, 1).
  F draw(const F& u) const {
    const SinCos<F> turn = sincos_2pi(F(fma(u, span, from) * (0.5f / kPi)));
    return nearest + aside * turn.sin / max(turn.cos, F(1e-6f));
  }
  F density(const F& x) const {
    const F along = x - nearest;
    return aside / F(span * fma(aside, aside, F(along * along)));
  }
  /// The share of distances below `x`.
  F before(const F& x) const {
    return clamp(F((atan2(F(x - nearest), aside) - from) / span), F(0.f), F(1.f));
  }
};

/// The part between `begin` and `end` of o + x d, for a medium of that extinction (of the channel
/// that it dims least), and a lamp that numbers `r` choose.
template <typename F>
inline LampWay<F> lamp_way(const LightView& lights, const Vec3<F>& o, const Vec3<F>& d,
                           const F& begin, const F& end, const F& extinction, const Sample4<F>& r,
                           const Mask<F>& active) {
  LampWay<F> way;
  const Mask<F> some = active & (begin < end) & (end < F(kFarAway));
  if (none(some)) return way;
  const F middle = select(some, F(0.5f * (begin + end)), F(0.f));
  const LightReceiver<F> receiver(fma(d, middle, o));
  const LightSample<F> l = sample_light<F>(lights, receiver, r.x, r.y, r.z, some);
  const Mask<F> there = some & l.valid & (l.distance < kFarAway);
  const Vec3<F> to = fma(l.wi, select(there, l.distance, F(0.f)), receiver.p) - o;
  way.nearest = dot(to, d);
  const Vec3<F> across = to - d * way.nearest;
  const F length = end - begin;
  way.aside = max(F(sqrt(dot(across, across))), F(1e-4f * length));
  way.from = atan2(F(begin - way.nearest), way.aside);
  way.span = max(F(atan2(F(end - way.nearest), way.aside) - way.from), F(1e-6f));
  // As often as the lamp sees the way as near, and as light comes there and back through the
  // medium.
  const F before = clamp(F(way.nearest - begin), F(0.f), length);
  const F q = F(kMostEquiangular / kPi) * way.span * exp(F(-extinction * (before + way.aside)));
  way.share = select(there & (q > kLeastEquiangular), q, F(0.f));
  return way;
}

/// What became of a way through an even medium, where it ended after length `x` in it, at distance
/// `at`: the true share of it, and with which it was drawn where this channel decides; by density
/// where it has `stopped`.
template <typename F>
struct EvenChance {
  F truth, drawn;
};
template <typename F>
inline EvenChance<F> even_chance(const LampWay<F>& lamp, const F& extinction, const F& x,
                                 const F& at, const Mask<F>& stopped) {
  const F through = exp(F(-extinction * x));
  const F truth = select(stopped, F(through * extinction), through);
  const F other = select(stopped, lamp.density(at), F(1.f - lamp.before(at)));
  return {truth, fma(lamp.share, F(other - truth), truth)};
}

}  // namespace wavecomb
