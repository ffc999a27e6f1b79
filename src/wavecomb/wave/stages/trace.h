// SPDX-License-Identifier: Apache-2.0
/// Wave stage 2 finds the closest hits of rays, and wave stage 4 tests shadow rays.
#pragma once

#include "wavecomb/core/settings.h"
#include "wavecomb/path/media.h"
#include "wavecomb/wave/wave.h"

namespace wavecomb {

/// For all queued slots, copies the first fields of the slot's row into the columns of a queue.
template <template <typename> class Head, template <typename> class Row, typename F, typename Queue,
          size_t C>
void fetch(const Queue& q, const float* rows, float* const (&columns)[C]) {
  for (size_t i = 0; i < q.size; i += kWidth<F>) {
    const Mask<F> active = first_lanes<F>(q.size - i);
    store_columns<Head, F>(load_head<Head, Row, F>(rows, load<UInt<F>>(q.slot + i), active),
                           columns, i);
  }
}

/// Copies the rays of the queued slots into columns.
template <typename F>
void fetch_rays(Wave& wave) {
  RayQueue& q = wave.rays;
  fetch<RayHead, PathRow, F>(q, wave.pool.paths, {q.ox, q.oy, q.oz, q.dx, q.dy, q.dz});
}

/// Copies the shadow rays of the queued slots into columns.
template <typename F>
void fetch_shadows(Wave& wave) {
  ShadowQueue& q = wave.shadows;
  fetch<ShadowHead, ShadowRow, F>(q, wave.pool.shadows,
                                  {q.ox, q.oy, q.oz, q.dx, q.dy, q.dz, q.tfar, q.r, q.g, q.b});
}

/// Copies the shutter times of the paths in a queue into a column. Returns null if the scene has no
/// motion.
template <typename F, typename Queue>
const float* fetch_times(Wave& wave, const Queue& q) {
  float* times = wave.times.floats(0);
  if (!times) return nullptr;
  for (size_t i = 0; i < q.size; i += kWidth<F>) {
    const Mask<F> active = first_lanes<F>(q.size - i);
    store(times + i, gather_field<F>(wave.pool.cold, &PathColdRow<float>::time,
                                     load<UInt<F>>(q.slot + i), active));
  }
  return times;
}

/// Returns the keys of the random numbers that decide stochastic presence for rays at `depth`.
/// Shadow rays use different random numbers than path rays. With `uses_linking`, each shadow ray
/// hits only the geometry in its shadow set.
inline PresenceKeys presence_keys(const PathPool& pool, uint32_t depth, bool shadow,
                                  bool uses_linking = false) {
  const auto* path = reinterpret_cast<const PathRow<float>*>(pool.paths);
  PresenceKeys keys{&path->key.pixel_hash, &path->key.sample, kRowWords<PathRow>,
                    2 * depth + (shadow ? 1u : 0u)};
  keys.ray_kind = ray_kind(depth, shadow);
  keys.passes_straight = true;
  if (shadow) keys.optical_depth = pool.optical_depths;
  if (!shadow && depth > 0) keys.bounce_pdf = &path->pdf;
  if (uses_linking) {
    keys.shadow_set = &reinterpret_cast<const ShadowRow<float>*>(pool.shadows)->set;
    keys.shadow_stride = kRowWords<ShadowRow>;
  }
  return keys;
}

/// Traces the ray queue and stores the closest hits in the hit buffer. `times` is the result of
/// fetch_times(), and `keys` that of presence_keys().
inline void trace(Wave& wave, const WaveContext& context, uint32_t depth, const float* tfar,
                  const float* times, bool coherent, const PresenceKeys& keys) {
  const RayQueue& q = wave.rays;
  const RaySpan rays{q.ox, q.oy, q.oz, q.dx, q.dy, q.dz, tfar, q.slot, q.size, times};
  if (context.recorder) context.recorder->closest(&wave, rays, depth, coherent);
  const HitBuffer& h = wave.hits;
  const auto start = wave.aovs.start_time();
  context.accel->intersect(rays, {h.t, h.u, h.v, h.prim, h.geom, h.inst}, context.traversal_width,
                           coherent, keys);
  const auto slot_of = [&](size_t i) { return q.slot[i]; };
  wave.aovs.charge_rays(q.size, slot_of);
  wave.aovs.spread_time(q.size, start, slot_of);
  wave.counts.add_rays(depth, q.size);
}

/// Multiplies the contributions of unblocked shadow rays by the transmittance T of the partly
/// transparent surfaces that the rays pass. Light that these surfaces hold back is tinted: with
/// shadow tints t, the factor is t + (1 - t) T. `tints` are PathPool::shadow_tints, or null. Does
/// not change the contributions of blocked rays.
template <typename F>
[[gnu::noinline, gnu::cold]] void attenuate_by_surfaces(Wave& wave, const float* tints) {
  using U = UInt<F>;
  const ShadowQueue& q = wave.shadows;
  for (size_t i = 0; i < q.size; i += kWidth<F>) {
    const Mask<F> free = first_lanes<F>(q.size - i) & Mask<F>(load<U>(q.occluded + i) == U(0u));
    const Mask<U> on(free);
    const U slot = load<U>(q.slot + i);
    const U depth = select(on, gather<U>(wave.pool.optical_depths, slot, on), U(0u));
    Color<F> tint(F(0.f));
    if (tints) tint = load_row<RadianceRow, F>(tints, slot, free).sum;
    const Color<F> passed = tinted_transmittance<F>(tint, surface_transmittance<F>(depth));
    const auto dim = [&](float* c, const F& by) { store(c + i, F(load<F>(c + i) * by)); };
    dim(q.r, passed.x);
    dim(q.g, passed.y);
    dim(q.b, passed.z);
  }
}

/// Tests the shadow rays for occlusion, and attenuates the contributions of rays that pass partly
/// transparent surfaces. `uses_linking` is passed to presence_keys(), and `tints` to
/// attenuate_by_surfaces().
template <typename F>
void occlude(Wave& wave, const WaveContext& context, uint32_t depth, bool uses_linking,
             const float* tints = nullptr) {
  const ShadowQueue& q = wave.shadows;
  const RaySpan rays{q.ox, q.oy,   q.oz,   q.dx,   q.dy,
                     q.dz, q.tfar, q.slot, q.size, fetch_times<F>(wave, q)};
  if (context.recorder) context.recorder->occluded(&wave, rays, depth, false);
  const auto start = wave.aovs.start_time();
  if (uint32_t* depths = wave.pool.optical_depths)
    for (size_t i = 0; i < q.size; ++i) depths[q.slot[i]] = 0;
  context.accel->occluded(rays, q.occluded, context.traversal_width, false,
                          presence_keys(wave.pool, depth, true, uses_linking));
  const auto slot_of = [&](size_t i) { return q.slot[i]; };
  wave.aovs.charge_rays(q.size, slot_of);
  wave.aovs.spread_time(q.size, start, slot_of);
  wave.counts.add_shadow_rays(depth, q.size);
  if (wave.pool.optical_depths) [[unlikely]]
    attenuate_by_surfaces<F>(wave, tints);
}

/// Adds the contributions of unblocked shadow rays to the radiance of their paths, multiplied by
/// the transmittance of volumes and media. Each slot has at most one shadow ray, so the order of
/// the queue does not matter.
template <typename F, typename Media>
void shadow(Wave& wave, const WaveContext& context, uint32_t depth,
            [[maybe_unused]] const Media& media) {
  using U = UInt<F>;
  const ShadowQueue& q = wave.shadows;
  occlude<F>(wave, context, depth, context.scene.lights.links.members != nullptr,
             wave.pool.shadow_tints);
  if constexpr (Media::kStreams)
    media.template attenuate_shadow_rays<F>(wave, depth, context.settings->sampler);
  const PathEvents events = wave.events(context);
  for (size_t i = 0; i < q.size; i += kWidth<F>) {
    Mask<F> active = first_lanes<F>(q.size - i) & Mask<F>(load<U>(q.occluded + i) == U(0u));
    const U slot = load<U>(q.slot + i);
    Color<F> c{load<F>(q.r + i), load<F>(q.g + i), load<F>(q.b + i)};
    if constexpr (Media::kAny) {
      if constexpr (Media::kStreams) {
        c = c * media.template shadow_transmittance<F>(wave, i);
      } else {
        const Mask<F> tested = wave.pool.shadow_tints ? first_lanes<F>(q.size - i) : active;
        const auto path = load_row<PathRow, F>(wave.pool.paths, slot, tested);
        const Vec3<F> o{load<F>(q.ox + i), load<F>(q.oy + i), load<F>(q.oz + i)};
        const Vec3<F> d{load<F>(q.dx + i), load<F>(q.dy + i), load<F>(q.dz + i)};
        const F t = load<F>(q.tfar + i) * (1.f / kShadowRayFraction);
        c = c * media.template transmittance<F>(
                    {context.settings->sampler, path.key, depth, o, d, t}, tested);
      }
    }
    if (wave.pool.shadow_tints) [[unlikely]] {
      // With shadow tints, a blocked shadow ray still contributes a fraction of its light.
      const Mask<F> blocked = first_lanes<F>(q.size - i) & not_(active);
      const Color<F> tint = load_row<RadianceRow, F>(wave.pool.shadow_tints, slot, blocked).sum;
      c = select<F>(blocked, c * tint, c);
      active = active | (blocked & (max_component(tint) > 0.f));
    }
    const auto group = [&] {
      return gather_field<F>(wave.pool.shadows, &ShadowRow<float>::group, slot, active);
    };
    events.light<Technique::kLightSample, F>({depth, slot, c}, group, active);
  }
}

}  // namespace wavecomb
