// SPDX-License-Identifier: Apache-2.0
/// Wave stage 3a: turns hits and volume events into shading records. Paths that leave the scene or
/// hit the shape of a light end in this stage.
#pragma once

#include "wavecomb/aov/path_events.h"
#include "wavecomb/core/rows/rows.h"
#include "wavecomb/geometry/hit/hit_material.h"
#include "wavecomb/path/media.h"
#include "wavecomb/path/shading_record.h"
#include "wavecomb/path/steps/emit.h"
#include "wavecomb/path/steps/escape.h"
#include "wavecomb/path/steps/survive.h"
#include "wavecomb/wave/stages/order_rays.h"
#include "wavecomb/wave/wave.h"

namespace wavecomb {

/// Packet of rays from the ray queue, starting at index `i`, with the type of hit of each ray.
template <typename F>
struct RayPacket {
  size_t i;
  Mask<F> active;
  UInt<F> slot, inst;
  Vec3<F> o, d;
  F t;  ///< distance of the hit or volume event
  // Masks of rays that leave the scene, that hit the shape of a light, and that hit a surface.
  Mask<F> missed, shape, surface;
  // Row and state of the paths; loaded only in lanes that need the path.
  PathRow<F> path;
  PathState<F> state;

  RayPacket(const RayQueue& rays, const HitBuffer& hits, size_t at)
      : i(at),
        active(first_lanes<F>(rays.size - at)),
        slot(load<UInt<F>>(rays.slot + at)),
        inst(load<UInt<F>>(hits.inst + at)),
        o(load<F>(rays.ox + at), load<F>(rays.oy + at), load<F>(rays.oz + at)),
        d(load<F>(rays.dx + at), load<F>(rays.dy + at), load<F>(rays.dz + at)),
        t(load<F>(hits.t + at)),
        missed(active & Mask<F>(inst == UInt<F>(kNoHit))),
        shape(active & Mask<F>(inst == UInt<F>(kLightShape))),
        surface(active & not_(missed) & not_(shape)) {}

  Vec3<F> end() const { return fma(d, t, o); }
};

/// Adds the emission of volumes along the rays of a packet, and samples the free flights of the
/// rays. Needs `p.path`.
template <typename F, typename Media>
WAVECOMB_INLINE Flight<F> fly_packet(Wave& wave, const PathEvents& events,
                                     const ShadeSettings& settings, uint32_t depth,
                                     const Media& media, RayPacket<F>& p) {
  if constexpr (Media::kHasEmission)
    if (media.has_emission()) {
      const float* const times = wave.times.floats(0);
      const F when = times ? load<F>(times + p.i) : F(0.f);
      const Color<F> c =
          clean<F>(p.path.throughput *
                       media.template emission<F>(
                           {settings.sampler, p.path.key, depth, p.o, p.d, p.t, when}, p.active),
                   clamp_limit(settings, depth));
      const Mask<F> bright = p.active & not_(is_black(c));
      events.light<Technique::kVolume, F>(
          {depth, p.slot, c}, [] { return UInt<F>(kNoLight); }, bright);
    }
  Flight<F> flight;
  if constexpr (Media::kStreams)
    flight = media.template flight<F>(wave, p.i, p.path.throughput);
  else
    flight = media.template sample_flight<F>({settings.sampler, p.path.key, depth, p.o, p.d, p.t},
                                             p.path.throughput, p.active);
  flight.stopped = p.active & flight.stopped;
  p.t = select(flight.stopped, flight.t, p.t);
  p.path.throughput = p.path.throughput * flight.weight;
  store_row<PathRow, F>(wave.pool.paths, p.slot, p.path, p.active);
  const Mask<F> through = not_(flight.stopped);
  events.segment<F>(depth, p.slot, flight, p.path.throughput, p.active);
  p.missed = p.missed & through;
  p.shape = p.shape & through;
  p.surface = p.surface & through;
  return flight;
}

/// Loads `p.state` for the lanes in `wanted`, from `p.path` and from the path pool.
template <typename F>
WAVECOMB_INLINE void load_arrival(const Wave& wave, const WaveContext& context, uint32_t depth,
                                  const Mask<F>& wanted, RayPacket<F>& p) {
  const PathPool& pool = wave.pool;
  p.state = path_state<F>(p.path, p.t);
  if (context.links() && depth > 0)
    p.state.link = gather_field<F>(pool.cold, &PathColdRow<float>::link, p.slot, wanted);
  if (context.joint.is_active() && depth > 0)
    p.state.ratio = wave.joint.template ratio<F>(p.slot, wanted);
  if (pool.diffuse && depth > 0) [[unlikely]]
    p.state.diffuse = load_row<RadianceRow, F>(pool.diffuse, p.slot, wanted).sum;
  if (context.scene.lights.motions) [[unlikely]]
    p.state.time = gather_field<F>(pool.cold, &PathColdRow<float>::time, p.slot, wanted);
}

/// Adds the light of the paths that leave the scene or hit the shape of a light.
template <typename F>
WAVECOMB_INLINE void add_ended(const Wave& wave, const PathEvents& events, const SceneView& scene,
                               const ShadeSettings& settings, uint32_t depth,
                               const RayPacket<F>& p) {
  if (any(p.missed)) events.environment<F>(settings, depth, p.slot, p.state, p.missed);
  if (none(p.shape)) return;
  const UInt<F> light = load<UInt<F>>(wave.hits.geom + p.i);
  const Color<F> c = shape_emission<F>(scene, settings, depth, light, p.t, p.state, p.shape);
  events.light<Technique::kEmitter, F>(
      {depth, p.slot, c}, [&] { return light; }, p.shape & not_(is_black(c)));
}

/// Returns the end points of a packet of camera rays, with their shutter times (0 if nothing
/// moves).
template <typename F>
WAVECOMB_INLINE RayEnd<F> ray_end(const Wave& wave, const WaveContext& context,
                                  const RayPacket<F>& p) {
  const F time = context.moves()
                     ? gather_field<F>(wave.pool.cold, &PathColdRow<float>::time, p.slot, p.active)
                     : F(0.f);
  return {p.slot, p.end(), time};
}

/// Ids of the surfaces that the rays of a packet hit. Values are undefined in lanes whose ray hit
/// no surface.
template <typename F>
struct HitIds {
  UInt<F> prim, geom, mesh;
  UInt<F> inherited;  ///< InstanceRecord::material

  HitIds(const SceneView& scene, const HitBuffer& hits, const RayPacket<F>& p)
      : prim(load<UInt<F>>(hits.prim + p.i)), geom(load<UInt<F>>(hits.geom + p.i)) {
    constexpr uint32_t kWords = sizeof(InstanceRecord) / 4;
    constexpr uint32_t kGeometry = offsetof(InstanceRecord, geometry) / 4;
    static_assert(offsetof(InstanceRecord, material) / 4 == kGeometry + 1);
    const auto row = load_rows<2, F>(scene.instances, p.inst * kWords + kGeometry, p.surface);
    inherited = float_bits<F>(row[1]);
    mesh = gather<UInt<F>>(scene.geometry_mesh, float_bits<F>(row[0]) + geom,
                           Mask<UInt<F>>(p.surface));
  }
};

/// Returns the materials at the hits of a packet. In lanes where a subsurface random walk ends,
/// this is the material of its exit point.
template <typename F, typename Media>
WAVECOMB_INLINE UInt<F> surface_material(const Wave& wave, const SceneView& scene,
                                         [[maybe_unused]] const Media& media, const RayPacket<F>& p,
                                         const HitIds<F>& ids) {
  using U = UInt<F>;
  const U material = hit_material<F>(scene, ids.inherited, ids.mesh, ids.prim, p.surface);
  if constexpr (Media::kStreams)
    if (media.has_subsurface())
      return select(Mask<U>(media.template left_body<F>(wave, p.i)), U(media.exit_material()),
                    material);
  return material;
}

/// Reports the camera rays that volumes or media stop.
template <typename F>
WAVECOMB_INLINE void note_volumes(const PathEvents& events, const SceneView& scene,
                                  const PathPool& pool, const RayEnd<F>& end,
                                  const Flight<F>& flight) {
  const VolumeHit<F> hit =
      volume_hit<F>(scene, pool.medium_stacks, end.slot, flight.material, flight.stopped);
  events.hit_volume<F>(end, hit, flight.stopped);
}

/// Reports the first hits of camera rays on surfaces.
template <typename F>
WAVECOMB_INLINE void note_surfaces(const PathEvents& events, const HitBuffer& hits,
                                   const RayEnd<F>& end, const RayPacket<F>& p,
                                   const HitIds<F>& ids, const UInt<F>& material) {
  events.hit_surface<F>(
      end, p.d, {.inst = p.inst, .geom = ids.geom, .material = material},
      {p.inst, ids.mesh, ids.prim, load<F>(hits.u + p.i), load<F>(hits.v + p.i), F(0.f)},
      p.surface);
}

/// Reads the ray queue and the hit buffer, and fills the shading queue in the order of the rays. If
/// `kOfJoint` is true, the paths are light paths of a joint transport, which receive no light from
/// the environment or from shapes of lights.
template <typename F, typename Media, bool kOfJoint = false>
void collect(Wave& wave, const WaveContext& context, const ShadeSettings& settings, uint32_t depth,
             [[maybe_unused]] const Media& media) {
  using U = UInt<F>;
  using Q = ShadingQueue;
  const HitBuffer& hits = wave.hits;
  ShadingQueue& queue = wave.shading;
  const SceneView& scene = context.scene;
  const bool cost_aware = settings.cost_aware && depth >= settings.roulette_depth;
  const bool is_first = !kOfJoint && depth == 0;
  const PathEvents events = wave.events(context);
  const bool records_hits = is_first && events.wants_hits();
  queue.clear();
  size_t n = 0;
  for (size_t i = 0; i < wave.rays.size; i += kWidth<F>) {
    RayPacket<F> p(wave.rays, hits, i);
    Mask<F> wanted = Media::kAny || cost_aware ? p.active : Mask<F>(p.missed | p.shape);
    if (kOfJoint && !cost_aware) wanted = Mask<F>(false);
    [[maybe_unused]] Flight<F> flight;
    if (any(wanted)) {
      p.path = load_row<PathRow, F>(wave.pool.paths, p.slot, wanted);
      if constexpr (Media::kAny) flight = fly_packet<F>(wave, events, settings, depth, media, p);
      load_arrival<F>(wave, context, depth, wanted, p);
    }
    if (!kOfJoint) add_ended<F>(wave, events, scene, settings, depth, p);
    if (is_first && context.joint.is_active()) [[unlikely]]
      wave.joint.template begin_ratios<F>(context.joint, *context.camera, p.slot,
                                          {p.end(), p.d, ray_end<F>(wave, context, p).time},
                                          p.surface);
    if (is_first && scene.visibility) [[unlikely]]
      p.surface = p.surface & not_(is_holdout<F>(scene, p.inst, load<U>(hits.geom + i), p.surface));
    if (records_hits && any(p.shape))
      events.hit_light<F>(ray_end<F>(wave, context, p), load<U>(hits.geom + i), p.shape);
    const auto recorded = [&] {
      if constexpr (Media::kAny)
        return Mask<F>(p.surface | flight.stopped);
      else
        return p.surface;
    };
    if constexpr (Media::kAny)
      if (records_hits)
        note_volumes<F>(events, scene, wave.pool, ray_end<F>(wave, context, p), flight);
    if (none(recorded())) continue;

    const HitIds<F> ids(scene, hits, p);
    U material = surface_material<F>(wave, scene, media, p, ids);
    if constexpr (Media::kAny)
      material = select(Mask<U>(flight.stopped), flight.material, material);
    const U program = gather<U>(scene.material_variant, material, Mask<U>(recorded()));
    if (records_hits)
      note_surfaces<F>(events, hits, ray_end<F>(wave, context, p), p, ids, material);
    if (cost_aware) {
      const F q =
          cost_aware_survival<F>(scene, *context.roulette_costs, material, p.state, p.surface);
      if (!kOfJoint) events.survive<F>(depth, p.slot, q, p.surface);
      p.surface = p.surface & (cost_aware_number<F>(p.path.key, depth) < q);
      p.path.throughput *= F(1.f) / q;
      if (none(recorded())) continue;
      store_row<PathRow, F>(wave.pool.paths, p.slot, p.path, p.surface);
    }

    const Mask<U> on(recorded());
    const auto put = [&](uint32_t* column, const U& x) { compress_store<U>(column + n, x, on); };
    put(queue.slot, p.slot);
    put(queue.uints(Q::kMaterial), material);
    put(queue.uints(Q::kProgram), program);
    if (context.wants_position)
      put(queue.uints(Q::kPositionKey), position_key<F>(context.grid, p.end()));
    ShadingRecord<F> record{
        p.t,   load<F>(hits.u + i), load<F>(hits.v + i), ids.prim, p.inst, ids.mesh, ids.geom,
        p.slot};
    if constexpr (Media::kAny)
      record = select_record<F>(flight.stopped, ShadingRecord<F>::event(p.t, p.slot), record);
    n += compress_row<ShadingRecord, F>(queue.row(n), record, recorded());
  }
  queue.size = n;
  wave.counts.add_records(depth, n);
  ++wave.queues;
}

}  // namespace wavecomb
