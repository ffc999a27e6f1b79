// SPDX-License-Identifier: Apache-2.0
/// Equiangular sampling of distances along a ray segment, by a light beside it (Kulla and Fajardo,
/// "Importance Sampling Techniques for Path Tracing in Participating Media", 2012).
///
/// In a homogeneous medium a distance is sampled from a mixture: by the exponential distribution of
/// the hero channel (medium/volume/tracking.h) and, with probability q, by equal angles as seen
/// from a point c on a light,
///   e(x) = D / ((b - a) (D^2 + (x - delta)^2)),
/// where D is the distance of c from the ray, delta the position closest to c, and a and b the
/// angles at which c sees the ends of the medium. Both densities and their integrals have closed
/// forms. Samples of both techniques, and passing the medium without a collision, are therefore
/// weighted exactly (balance heuristic). q and c depend only on the ray segment.
#pragma once

#include "wavecomb/core/math.h"
#include "wavecomb/core/sampler.h"
#include "wavecomb/light/sampling/light_sample.h"

namespace wavecomb {

/// Largest probability of equiangular sampling.
inline constexpr float kMostEquiangular = 0.5f;
/// Below this probability equiangular sampling is not used.
inline constexpr float kLeastEquiangular = 0.02f;

/// Returns whether a scene has finite lights.
inline bool has_lamps(const LightView& lights) {
  return lights.count > lights.infinite_count;
}

/// Equiangular distribution of distances along a ray segment, for one light.
template <typename F>
struct LampWay {
  F share{0.f};  ///< q, or 0 without equiangular sampling
  F nearest{0.f}, aside{1.f}, from{0.f}, span{1.f};

  /// Samples a distance with a random number in [0, 1).
  F draw(const F& u) const {
    const SinCos<F> turn = sincos_2pi(F(fma(u, span, from) * (0.5f / kPi)));
    return nearest + aside * turn.sin / max(turn.cos, F(1e-6f));
  }
  F density(const F& x) const {
    const F along = x - nearest;
    return aside / F(span * fma(aside, aside, F(along * along)));
  }
  /// Returns the probability of distances below `x`.
  F before(const F& x) const {
    return clamp(F((atan2(F(x - nearest), aside) - from) / span), F(0.f), F(1.f));
  }
};

/// Part of a ray in a homogeneous medium: points o + x d with begin < x < end.
template <typename F>
struct MediumSegment {
  Vec3<F> o, d;
  F begin, end;
  F extinction;  ///< of the least attenuated channel, per unit of length
};

/// Returns the distribution for a segment. The sample values `r` select the light and the point on
/// it.
template <typename F>
inline LampWay<F> lamp_way(const LightView& lights, const MediumSegment<F>& segment,
                           const Sample4<F>& r, const Mask<F>& active) {
  const auto& [o, d, begin, end, extinction] = segment;
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
  // q grows with the angle that the segment subtends from the light, and with the transmittance of
  // the medium from `begin` to the closest point and on to the light.
  const F before = clamp(F(way.nearest - begin), F(0.f), length);
  const F q = F(kMostEquiangular / kPi) * way.span * exp(F(-extinction * (before + way.aside)));
  way.share = select(there & (q > kLeastEquiangular), q, F(0.f));
  return way;
}

/// Probabilities of the outcome of a segment through a homogeneous medium that ends after length
/// `x` in it, at distance `at`: the true one, and the one it was sampled with if this channel is
/// the hero. They are densities where the segment was `stopped`.
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
