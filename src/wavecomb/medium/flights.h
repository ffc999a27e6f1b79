// SPDX-License-Identifier: Apache-2.0
/// What becomes of flights through volumes, as data.
#pragma once

#include "wavecomb/core/math.h"

namespace wavecomb {

/// What becomes of flights, side by side. Before: `t` is how far they may go, `material` kNoEvent,
/// `ratio` 1.
struct Flights {
  static constexpr uint32_t kNoEvent = 0xffffffffu;
  static constexpr uint32_t kNoHero = 4;  ///< of a flight that is none of volumes any more

  float* t;
  uint32_t* material;  ///< of the volume that stopped a flight
  float* ratio[3];     ///< by channel: probability of what happened, over that by the channel that
                       ///< decided
  const uint32_t* hero;  ///< the channel that decides
  /// By channel: what it weighs beside, of what is drawn otherwise or not at all. Before: 1.
  float* scale[3];
};
/// What flights through one volume are told of.
enum class FlightKeeps : uint8_t { kStops, kRatios, kBoth };

/// The channel that decides: each as often as it has of the throughput.
template <typename F>
inline UInt<F> hero_of(const F& u, const Color<F>& throughput) {
  using U = UInt<F>;
  const F at = u * (throughput.x + throughput.y + throughput.z);
  return select(at < throughput.x, U(0u),
                select(at < F(throughput.x + throughput.y), U(1u), U(2u)));
}

/// Each channel decides in so many flights as it has of the path's throughput T (hero wavelengths,
/// Wilkie et al., "Hero Wavelength Spectral Sampling", 2014). So the weight of a flight is, with
/// the probabilities p_c of what happened,
///   p_c sum(T) / sum over channels k of T_k p_k
/// which leaves sum(T) as it was, however often the path is scattered.
template <typename F>
inline Color<F> flight_weight(const Color<F>& ratio, const Color<F>& throughput) {
  const F sum = throughput.x + throughput.y + throughput.z, shares = dot(ratio, throughput);
  return ratio * F(sum / select(shares > 0.f, shares, F(1.f)));
}

}  // namespace wavecomb
