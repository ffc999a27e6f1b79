// SPDX-License-Identifier: Apache-2.0
/// The step `survive`: Russian roulette.
///
/// A path continues with probability q, and its throughput is then divided by q:
///   T_{k+1} <- T_{k+1} / q
/// so that the mean stays the same (Arvo and Kirk 1990).
#pragma once

#include "wavecomb/core/sampler.h"
#include "wavecomb/guiding/roulette.h"
#include "wavecomb/path/path_state.h"
#include "wavecomb/schedule/cost_snapshot.h"

namespace wavecomb {

/// Roulette terminates only paths whose throughput is below 1 / kRouletteGain. A gain of 1 saves
/// rays but adds too much noise: on the Cornell box, a gain of 3 has the least product of relMSE
/// and ray count (docs/decisions/roulette.md).
inline constexpr float kRouletteGain = 3.f;

/// Returns the probability of shading a vertex that a path has reached, by cost-aware roulette.
///
/// The efficiency 1 / (variance x cost) is greatest if the probability of continuing is
/// proportional to
///   sqrt(E[contribution^2] / cost)
/// of the remaining path (Bolin and Meyer 1997; Rath et al., "EARS", 2022, eq. 8). The contribution
/// is the throughput T times the incident radiance, which is unknown and assumed to be the same for
/// all paths. The probability q is therefore
///   q = kRouletteGain T / sqrt(cost of this material / mean cost),
/// clamped to [0.05, 1]. Emissive surfaces are always shaded.
template <typename F>
inline F cost_aware_survival(const SceneView& scene, const CostSnapshot& costs,
                             const UInt<F>& material, const PathState<F>& path,
                             const Mask<F>& active) {
  using U = UInt<F>;
  const F cost = gather<F>(costs.material_ns.data(), material, active);
  const F relative = max(F(cost * (1.f / costs.mean_ns)), F(1e-3f));
  const F t = max_component(path.throughput) * path.eta_scale * kRouletteGain;
  const U flags =
      gather_member<F>(scene.materials.materials, &MaterialRecord::flags, material, active);
  const Mask<F> emits = Mask<F>((flags & static_cast<uint32_t>(kEmits)) != U(0u));
  return select(active & not_(emits), clamp(F(t / sqrt(relative)), F(0.05f), F(1.f)), F(1.f));
}

/// Returns the random number of cost-aware roulette. A path continues if the number is below
/// cost_aware_survival(). This random number is independent of the sampler.
template <typename F>
inline F cost_aware_number(const SampleKey<F>& key, uint32_t depth) {
  using U = UInt<F>;
  const U path = path_hash<F>(key);
  return unit_float<F>(hash_u32<U>(path, U(0x5f3759dfu + depth)));
}

/// Writes to the AOVs the probability `q` with which the bounce survives roulette, and the
/// probability with which the guiding field sampled its direction.
template <typename F, uint32_t kFeatures>
WAVECOMB_INLINE void record_bounce(const Vertex<F, kFeatures>& v, const GuidingLookup<F>& guiding,
                                   const F& q, const VertexResult<F>& out) {
  if (!v.wants_bounces()) [[likely]]
    return;
  v.aovs->guided = select(guiding.guided, F(F(1.f) - guiding.bsdf_share), F(0.f));
  v.aovs->survival = select(out.alive, q, F(-1.f));
}

/// Applies roulette after a vertex, with the random number `u` in [0, 1). The survival probability
/// depends on the throughput or, where a trained estimate of the bounce's expected contribution
/// exists, on this estimate (guiding/roulette.h). The throughput after a guided bounce does not
/// predict the bounce's contribution, since the throughput is smallest in the directions that most
/// light comes from. `arrived` is the luminance of the throughput at the vertex.
template <typename F, uint32_t kFeatures>
WAVECOMB_INLINE void survive(const Vertex<F, kFeatures>& v, const GuidingLookup<F>& guiding,
                             const F& arrived, const F& u, VertexResult<F>& out) {
  if (!v.settings.roulette || v.depth + 1 < v.settings.roulette_depth) {
    record_bounce<F>(v, guiding, F(1.f), out);
    return;
  }
  const F largest = max_component(out.next.throughput);
  F q = min(F(largest * out.next.eta_scale * kRouletteGain), F(1.f));
  if (v.settings.efficient && v.guide && v.guide->tiles) [[unlikely]]
    q = select(guiding.known, efficient_survival<F>(guiding, F(arrived * v.path.importance)), q);
  record_bounce<F>(v, guiding, q, out);
  out.alive = out.alive & (u < q);
  out.next.throughput *= F(1.f / max(q, F(1e-10f)));
}

}  // namespace wavecomb
