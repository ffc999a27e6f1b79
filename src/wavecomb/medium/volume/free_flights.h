// SPDX-License-Identifier: Apache-2.0
/// Data of free flights through volumes.
#pragma once

#include "wavecomb/core/math.h"

namespace wavecomb {

/// Results of free flights, in columns. Initially `t` is the length of each segment, `material` is
/// kNoEvent and `ratio` is 1.
struct Flights {
  static constexpr uint32_t kNoEvent = 0xffffffffu;
  /// Hero channel of flights whose volume event was dropped.
  static constexpr uint32_t kNoHero = 4;

  float* t;
  uint32_t* material;  ///< material of the volume that stopped the flight
  /// Probability of the outcome in each channel, divided by the probability in the hero channel.
  float* ratio[3];
  const uint32_t* hero;  ///< channel whose extinction determines the sampled distance
  /// Additional factor of the weight of each channel, for outcomes that the hero channel did not
  /// sample. Initially 1.
  float* scale[3];
};
/// Results of free flights that a call computes: the stops, the ratios, or both.
enum class FlightResults : uint8_t { kStops, kRatios, kBoth };

/// Selects the hero channel, in proportion to the throughput.
template <typename F>
inline UInt<F> hero_of(const F& u, const Color<F>& throughput) {
  using U = UInt<F>;
  const F at = u * (throughput.x + throughput.y + throughput.z);
  return select(at < throughput.x, U(0u),
                select(at < F(throughput.x + throughput.y), U(1u), U(2u)));
}

/// Returns the weight of a flight. The hero channel is selected in proportion to the path's
/// throughput T (hero wavelengths, Wilkie et al., "Hero Wavelength Spectral Sampling", 2014). If
/// p_c is the probability of the sampled outcome in channel c, the weight of channel c is
///   p_c sum(T) / sum over channels k of T_k p_k
/// which keeps sum(T) constant over any number of scatterings.
template <typename F>
inline Color<F> flight_weight(const Color<F>& ratio, const Color<F>& throughput) {
  const F sum = throughput.x + throughput.y + throughput.z, shares = dot(ratio, throughput);
  return ratio * F(sum / select(shares > 0.f, shares, F(1.f)));
}

}  // namespace wavecomb
