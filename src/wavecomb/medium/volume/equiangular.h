// SPDX-License-Identifier: Apache-2.0
/// Equiangular sampling of distances along a ray segment with respect to a light (Kulla and
/// Fajardo, "Importance Sampling Techniques for Path Tracing in Participating Media", 2012).
///
/// In a homogeneous medium a distance is sampled from a mixture: by the exponential distribution of
/// the hero channel (medium/volume/tracking.h) and, with probability q, by equal angles as seen
/// from a point c on a light,
///   e(x) = D / ((b - a) (D^2 + (x - delta)^2)),
/// where D is the distance of c from the ray, delta the position closest to c, and a and b the
/// angles of the ends of the medium as seen from c. The densities of both techniques and their
/// integrals have closed forms. Samples of both techniques, and passing the medium without a
/// collision, are therefore weighted exactly (balance heuristic). q and c depend only on the ray
/// segment.
#pragma once

#include "wavecomb/core/math.h"
#include "wavecomb/core/sampler.h"
#include "wavecomb/light/sampling/light_sample.h"

namespace wavecomb {

/// Maximum probability of equiangular sampling.
inline constexpr float kMaxEquiangular = 0.5f;
/// Minimum probability of equiangular sampling; smaller values are treated as 0.
inline constexpr float kMinEquiangular = 0.02f;

/// Returns whether a scene has finite lights.
inline bool has_finite_lights(const LightView& lights) {
  return lights.count > lights.infinite_count;
}

/// Equiangular distribution of distances along a ray segment, for one light.
template <typename F>
struct EquiangularDistribution {
  F share{0.f};  ///< probability q of equiangular sampling
  F nearest{0.f}, height{1.f}, from{0.f}, span{1.f};

  /// Samples a distance with a random number in [0, 1).
  F sample_distance(const F& u) const {
    const SinCos<F> turn = sincos_2pi(F(fma(u, span, from) * (0.5f / kPi)));
    return nearest + height * turn.sin / max(turn.cos, F(1e-6f));
  }
  F density(const F& x) const {
    const F along = x - nearest;
    return height / F(span * fma(height, height, F(along * along)));
  }
  /// Returns the probability of distances below `x`.
  F before(const F& x) const {
    return clamp(F((atan2(F(x - nearest), height) - from) / span), F(0.f), F(1.f));
  }
};

/// Part of a ray in a homogeneous medium: points o + x d with begin < x < end.
template <typename F>
struct MediumSegment {
  Vec3<F> o, d;
  F begin, end;
  F extinction;  ///< extinction of the least attenuated channel, per unit of length
};

/// Returns the equiangular distribution for a ray segment in a medium. The sample values `r` select
/// a light and a point on the light.
template <typename F>
inline EquiangularDistribution<F> equiangular_distribution(const LightView& lights,
                                                           const MediumSegment<F>& segment,
                                                           const Sample4<F>& r,
                                                           const Mask<F>& active) {
  const auto& [o, d, begin, end, extinction] = segment;
  EquiangularDistribution<F> distribution;
  const Mask<F> some = active & (begin < end) & (end < F(kFarAway));
  if (none(some)) return distribution;
  const F middle = select(some, F(0.5f * (begin + end)), F(0.f));
  const LightReceiver<F> receiver(fma(d, middle, o));
  const LightSample<F> l = sample_light<F>(lights, receiver, r.x, r.y, r.z, some);
  const Mask<F> usable = some & l.valid & (l.distance < kFarAway);
  const Vec3<F> to = fma(l.wi, select(usable, l.distance, F(0.f)), receiver.p) - o;
  distribution.nearest = dot(to, d);
  const Vec3<F> across = to - d * distribution.nearest;
  const F length = end - begin;
  distribution.height = max(F(sqrt(dot(across, across))), F(1e-4f * length));
  distribution.from = atan2(F(begin - distribution.nearest), distribution.height);
  distribution.span = max(
      F(atan2(F(end - distribution.nearest), distribution.height) - distribution.from), F(1e-6f));
  // The probability q is proportional to the angle that the segment subtends from the light. It is
  // also proportional to the transmittance along the ray from `begin` to the point closest to the
  // light, and from there to the light.
  const F before = clamp(F(distribution.nearest - begin), F(0.f), length);
  const F q = F(kMaxEquiangular / kPi) * distribution.span *
              exp(F(-extinction * (before + distribution.height)));
  distribution.share = select(usable & (q > kMinEquiangular), q, F(0.f));
  return distribution;
}

/// For one colour channel, the probability that a ray travels the length `x` in a homogeneous
/// medium and stops at distance `at` along the ray. `exact` is the physical probability, and
/// `sampled` the probability of the sampling technique with the channel as hero. In lanes where a
/// collision `stopped` the ray, the values are densities over distance.
template <typename F>
struct OutcomeDensity {
  F exact, sampled;
};
template <typename F>
inline OutcomeDensity<F> outcome_density(const EquiangularDistribution<F>& distribution,
                                         const F& extinction, const F& x, const F& at,
                                         const Mask<F>& stopped) {
  const F through = exp(F(-extinction * x));
  const F exact = select(stopped, F(through * extinction), through);
  const F other = select(stopped, distribution.density(at), F(1.f - distribution.before(at)));
  return {exact, fma(distribution.share, F(other - exact), exact)};
}

}  // namespace wavecomb
