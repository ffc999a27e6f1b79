// SPDX-License-Identifier: Apache-2.0
/// Wave stage 3a: turns hits and volume events into shading records. Paths that leave the scene or
/// hit a light's shape end here.
#pragma once

#include "wavecomb/aov/screen_motion.h"
#include "wavecomb/core/rows/rows.h"
#include "wavecomb/geometry/hit/hit_material.h"
#include "wavecomb/light_paths/camera_connection.h"
#include "wavecomb/path/media.h"
#include "wavecomb/path/shading_record.h"
#include "wavecomb/path/steps/emit.h"
#include "wavecomb/path/steps/escape.h"
#include "wavecomb/path/steps/survive.h"
#include "wavecomb/wave/stages/order_rays.h"
#include "wavecomb/wave/wave.h"

namespace wavecomb {

/// Initialises PathState::ratio of camera paths that have hit something.
template <typename F>
[[gnu::noinline, gnu::cold]] void begin_ratios(Wave& wave, const WaveContext& context,
                                               const UInt<F>& slot, const Vec3<F>& o,
                                               const Vec3<F>& d, const F& t,
                                               const Mask<F>& active) {
  F time(0.f);
  if (context.camera->moves())
    time = gather_field<F>(wave.pool.cold, &PathColdRow<float>::time, slot, active);
  scatter<F>(
      wave.pool.ratio,
      first_ratio<F>(*context.camera, context.light_path_share(), fma(d, t, o), d, time, active),
      slot, active);
}

/// Returns the volume events that stopped the flights of a packet.
template <typename F>
VolumeSeen<F> volume_seen(const Wave& wave, const WaveContext& context, const UInt<F>& slot,
                          const Flight<F>& flight) {
  using U = UInt<F>;
  const SceneView& scene = context.scene;
  VolumeSeen<F> seen{flight.material - scene.volumes.first_material, U(0u), flight.material,
                     Mask<F>(false)};
  if (!context.knows_inside()) return seen;
  seen.in_mesh = flight.stopped & Mask<F>(flight.material == U(scene.interiors.event_material));
  const auto of_path = [&](auto member) {
    return gather_field<F>(wave.pool.inside, member, slot, seen.in_mesh);
  };
  seen.place = of_path(&InsideRow<float>::place);
  seen.material = select(Mask<U>(seen.in_mesh), of_path(&InsideRow<float>::medium), seen.material);
  return seen;
}

/// Records for AOVs how paths passed through volumes and media. `throughput` is the throughput
/// after the flight.
template <typename F>
void note_way(Wave& wave, uint32_t depth, const UInt<F>& slot, const Flight<F>& flight,
              const Color<F>& throughput, const Mask<F>& active) {
  if (depth == 0 && wave.aovs.wants_transmittance())
    wave.aovs.pass<F>(slot, select<F>(flight.stopped | flight.walked, Color<F>(F(0.f)), throughput),
                      active);
  const Mask<F> walked = active & flight.walked;
  if (wave.aovs.expressions() && any(walked))
    wave.aovs.expressions().template walk<F>(slot, walked);
}

/// Reads the ray queue and the hit buffer, and fills the shading queue in the order of the rays.
/// Light paths (`kFromLights`) contribute nothing where they end.
template <typename F, typename Media, bool kFromLights = false>
void collect(Wave& wave, const WaveContext& context, const ShadeSettings& settings, uint32_t depth,
             [[maybe_unused]] const Media& media) {
  using U = UInt<F>;
  const RayQueue& rays = wave.rays;
  const HitBuffer& hits = wave.hits;
  ShadingQueue& queue = wave.shading;
  const SceneView& scene = context.scene;
  const bool cost_aware = settings.cost_aware && depth >= settings.roulette_depth;
  queue.clear();
  size_t n = 0;
  for (size_t i = 0; i < rays.size; i += kWidth<F>) {
    const Mask<F> active = first_lanes<F>(rays.size - i);
    const U inst = load<U>(hits.inst + i);
    Mask<F> missed = active & Mask<F>(inst == U(kNoHit));
    Mask<F> shape = active & Mask<F>(inst == U(kLightShape));
    Mask<F> surface = active & not_(missed) & not_(shape);
    F t = load<F>(hits.t + i);
    const U slot = load<U>(rays.slot + i);
    const Vec3<F> o{load<F>(rays.ox + i), load<F>(rays.oy + i), load<F>(rays.oz + i)};
    const Vec3<F> d{load<F>(rays.dx + i), load<F>(rays.dy + i), load<F>(rays.dz + i)};
    Mask<F> wanted = Media::kAny || cost_aware ? active : Mask<F>(missed | shape);
    if (kFromLights && !cost_aware) wanted = Mask<F>(false);
    PathRow<F> path;
    PathState<F> state;
    [[maybe_unused]] Flight<F> flight;
    if (any(wanted)) {
      path = load_row<PathRow, F>(wave.pool.paths, slot, wanted);
      if constexpr (Media::kAny) {
        if constexpr (Media::kShines)
          if (media.shines()) {
            const float* const times = wave.times.floats(0);
            const F when = times ? load<F>(times + i) : F(0.f);
            const Color<F> c = clean<F>(
                path.throughput * media.template emission<F>(
                                      {settings.sampler, path.key, depth, o, d, t, when}, active),
                clamp_limit(settings, depth));
            const Mask<F> bright = active & not_(is_black(c));
            add_radiance<F>(wave.pool.radiance, slot, c, bright);
            if (wave.aovs.wants_lights()) wave.aovs.add_glow<F>(slot, c, bright);
          }
        if constexpr (Media::kStreams)
          flight = media.template flight<F>(wave, i, path.throughput);
        else
          flight = media.template fly<F>({settings.sampler, path.key, depth, o, d, t},
                                         path.throughput, active);
        flight.stopped = active & flight.stopped;
        t = select(flight.stopped, flight.t, t);
        path.throughput = path.throughput * flight.weight;
        store_row<PathRow, F>(wave.pool.paths, slot, path, active);
        const Mask<F> through = not_(flight.stopped);
        note_way<F>(wave, depth, slot, flight, path.throughput, active);
        missed = missed & through;
        shape = shape & through;
        surface = surface & through;
      }
      state = path_state<F>(path, t);
      if (context.links() && depth > 0)
        state.link = gather_field<F>(wave.pool.cold, &PathColdRow<float>::link, slot, wanted);
      if (context.joins_light() && depth > 0)
        unpack_ratio<F>(gather<F>(wave.pool.ratio, slot, wanted), state);
      if (wave.pool.diffuse && depth > 0) [[unlikely]]
        state.diffuse = load_row<RadianceRow, F>(wave.pool.diffuse, slot, wanted).sum;
      if (scene.lights.motions) [[unlikely]]
        state.time = gather_field<F>(wave.pool.cold, &PathColdRow<float>::time, slot, wanted);
    }
    if (const Mask<F> ended = missed | shape; !kFromLights && any(ended)) {
      Color<F> c(F(0.f));
      const bool is_lit = any(missed) && settings.sees_sky(depth);
      if (is_lit)
        c = select<F>(missed, environment_emission<F>(scene, settings, depth, state, missed), c);
      if (any(shape)) {
        const U light = load<U>(hits.geom + i);
        c = select<F>(shape, shape_emission<F>(scene, settings, depth, light, t, state, shape), c);
      }
      add_radiance<F>(wave.pool.radiance, slot, c, ended & not_(is_black(c)));
      if (wave.aovs.wants_lights()) {
        if (is_lit) wave.aovs.add_environment<F>(scene, settings, depth, slot, state, missed);
        if (any(shape)) wave.aovs.add_light<F>(slot, load<U>(hits.geom + i), c, shape);
      }
    }
    if (!kFromLights && context.joins_light() && depth == 0) [[unlikely]]
      begin_ratios<F>(wave, context, slot, o, d, t, surface);
    if (!kFromLights && depth == 0 && scene.visibility) [[unlikely]]
      surface = surface & not_(held_out<F>(scene, inst, load<U>(hits.geom + i), surface));
    const bool notes_hits = !kFromLights && depth == 0 && wave.aovs.wants_hits();
    const auto time = [&] {
      return context.camera->moves()
                 ? gather_field<F>(wave.pool.cold, &PathColdRow<float>::time, slot, active)
                 : F(0.f);
    };
    if (notes_hits && any(shape))
      wave.aovs.hit_light<F>(*context.camera, slot, fma(d, t, o), time(), load<U>(hits.geom + i),
                             shape);
    if (notes_hits && wave.aovs.wants_motion() && any(shape)) [[unlikely]]
      wave.aovs.move<F>(
          slot,
          screen_motion_of_light<F>(scene.lights, *context.camera, load<U>(hits.geom + i),
                                    fma(d, t, o), state.time, shape),
          shape);
    const auto recorded = [&] {
      if constexpr (Media::kAny)
        return Mask<F>(surface | flight.stopped);
      else
        return surface;
    };
    if (!kFromLights && depth == 0 && wave.aovs.wants_alpha())
      wave.aovs.cover<F>(slot, shape | recorded());
    if constexpr (Media::kAny)
      if (notes_hits)
        wave.aovs.hit_volume<F>(*context.camera, slot, fma(d, t, o), time(),
                                volume_seen<F>(wave, context, slot, flight), flight.stopped);
    if (none(recorded())) continue;

    const U prim = load<U>(hits.prim + i);
    const U geom = load<U>(hits.geom + i);
    constexpr uint32_t kWords = sizeof(InstanceRecord) / 4;
    constexpr uint32_t kGeometry = offsetof(InstanceRecord, geometry) / 4;
    static_assert(offsetof(InstanceRecord, material) / 4 == kGeometry + 1);
    const auto row = load_rows<2, F>(scene.instances, inst * kWords + kGeometry, surface);
    const U first = float_bits<F>(row[0]), inherited = float_bits<F>(row[1]);
    const U mesh = gather<U>(scene.geometry_mesh, first + geom, Mask<U>(surface));
    U material = hit_material<F>(scene, inherited, mesh, prim, surface);
    if constexpr (Media::kAny) {
      if constexpr (Media::kStreams)
        if (media.has_walks())
          material = select(Mask<U>(media.template came_out<F>(wave, i)), U(media.exit_material()),
                            material);
      material = select(Mask<U>(flight.stopped), flight.material, material);
    }
    const U program = gather<U>(scene.material_variant, material, Mask<U>(recorded()));
    if (notes_hits)
      wave.aovs.hit_surface<F>(*context.camera, slot, fma(d, t, o), time(),
                               {.inst = inst, .geom = geom, .material = material}, surface);
    if (notes_hits && wave.aovs.wants_motion()) [[unlikely]]
      wave.aovs.move<F>(
          slot,
          screen_motion_of_hit<F>(
              scene, *context.camera,
              {inst, mesh, prim, load<F>(hits.u + i), load<F>(hits.v + i), F(0.f)}, d, surface),
          surface);
    if (cost_aware) {
      const F q = cost_aware_survival<F>(scene, *context.roulette_costs, material, state, surface);
      if (!kFromLights) wave.aovs.survive<F>(depth, slot, q, surface);
      surface = surface & (cost_aware_number<F>(path.key, depth) < q);
      path.throughput *= F(1.f) / q;
      if (none(recorded())) continue;
      store_row<PathRow, F>(wave.pool.paths, slot, path, surface);
    }

    using Q = ShadingQueue;
    const Mask<U> on(recorded());
    const auto put = [&](uint32_t* column, const U& x) { compress_store<U>(column + n, x, on); };
    put(queue.slot, slot);
    put(queue.uints(Q::kMaterial), material);
    put(queue.uints(Q::kProgram), program);
    if (context.wants_position)
      put(queue.uints(Q::kPositionKey), position_key<F>(context.grid, fma(d, t, o)));
    ShadingRecord<F> record{t,   load<F>(hits.u + i), load<F>(hits.v + i), prim, inst, mesh, geom,
                            slot};
    if constexpr (Media::kAny)
      record = select_record<F>(flight.stopped, ShadingRecord<F>::event(t, slot), record);
    n += compress_row<ShadingRecord, F>(queue.row(n), record, recorded());
  }
  queue.size = n;
  wave.counts.add_records(depth, n);
  ++wave.queues;
}

}  // namespace wavecomb
