// SPDX-License-Identifier: Apache-2.0
/// Volumes of a scene, media inside its meshes, and subsurface random walks.
#pragma once

#include <algorithm>

#include "wavecomb/material/program_list.h"
#include "wavecomb/medium/nested/nested_media.h"
#include "wavecomb/medium/volume/tracking.h"
#include "wavecomb/medium/volume/volume_bsdf.h"
#include "wavecomb/medium/volume/volume_emission.h"
#include "wavecomb/medium/wave/subsurface_walks.h"
#include "wavecomb/path/media.h"

namespace wavecomb {

/// Implementation of `Media` (path/media.h).
class Volumes : public WalksBelow {
 public:
  static constexpr bool kAny = true, kShines = true, kStreams = true;
  template <typename F>
  using Programs = AppendedProgram<wavecomb::Programs<F>, VolumeBsdf<F>>;

  /// `counts` receives the statistics of ray segments. `walks` has Walkers::kColumns columns for
  /// random walks, and `interiors` holds the buffers for media inside meshes.
  Volumes(const WaveContext& context, Counts& counts, const SoaBlock& walks,
          const InteriorBuffers& interiors)
      : WalksBelow(context, counts, walks),
        volumes_(context.scene.volumes),
        lamps_(context.settings->equiangular && has_lamps(context.scene.lights) &&
                       std::any_of(volumes_.volumes, volumes_.volumes + volumes_.count,
                                   is_drawn_by_lamps)
                   ? &context.scene.lights
                   : nullptr),
        interiors_(context.scene, *context.accel, context.traversal_width, interiors, counts,
                   context.settings->equiangular && has_lamps(context.scene.lights)) {}

  /// Samples the free flight of the reference integrator in scenes with nested dielectrics, for the
  /// path `path` with medium stack `inside`, whose ray with `keys` has hit `hit`. The passage leads
  /// to the hit. May change both the path and the hit.
  template <typename Hit>
  Flight<float> fly_inside(const Passage<float>& p, const PresenceKeys& keys,
                           PathState<float>& path, Hit& hit, InsideRow<float>& inside) const;
  /// Returns the transmittance of media inside meshes along a shadow ray of the reference
  /// integrator.
  Color<float> pass_inside(const PresenceKeys& keys, float time, const InsideRow<float>& inside,
                           const Vec3<float>& o, const Vec3<float>& d, float t) const;

  template <typename F>
  Flight<F> fly(const Passage<F>& p, const Color<F>& throughput, const Mask<F>& active) const {
    return fly_through<F>(volumes_, p, throughput, active, lamps_, counts_.volumes);
  }
  template <typename F>
  Color<F> transmittance(const Passage<F>& p, const Mask<F>& active) const {
    const Way<F> way(p, VertexSet::kShadow);
    return transmittance_through<F>(volumes_, way, segment_of(p), active, counts_.volumes);
  }

  bool shines() const { return volumes_.emits; }
  template <typename F>
  Color<F> emission(const Passage<F>& p, const Mask<F>& active) const {
    Color<F> sum(F(0.f));
    const Way<F> way(p, VertexSet::kFlight);
    const RaySegment<F> segment = segment_of(p);
    for (uint32_t i = 0; i < volumes_.count; ++i)
      if (volumes_.volumes[i].emits)
        sum += emission_of<F>(volumes_, i, way, segment, active, counts_.volumes);
    return sum;
  }

  // Versions for all rays of a wave, and for all its unblocked shadow rays.

  template <typename F>
  void fly_all(Wave& wave, uint32_t depth, SamplerKind sampler) const {
    walk_all<F>(wave, depth, sampler);
    const RayQueue& q = wave.rays;
    const Flights flights = flights_of(wave);
    const bool knows_inside = context_.knows_inside();
    for (size_t i = 0; i < q.size; i += kWidth<F>) {
      const PathRow<F> path = path_at<F>(wave, q.slot, i, q.size);
      const Way<F> way(sampler, path.key, depth, VertexSet::kFlight);
      put_numbers<F>(wave, i, way);
      store(flights.t + i, knows_inside ? F(kInfinity) : load<F>(wave.hits.t + i));
      store(flights.material + i, UInt<F>(uint32_t{Flights::kNoEvent}));
      for (size_t c = 0; c < 3; ++c) {
        store(flights.ratio[c] + i, F(1.f));
        store(flights.scale[c] + i, F(1.f));
      }
      store(wave.ways.uints(kHero) + i, hero_of<F>(way.r.y, path.throughput));
    }
    const Ways ways = ways_of(wave, q, flights.t);
    float* const scratch = wave.ways.floats(kScratch);
    if (!knows_inside)
      return fly_through<F>(volumes_, ways, flights, scratch, lamps_, counts_.volumes);
    stop_flights<F>(volumes_, ways, flights, scratch, lamps_, counts_.volumes);
    fly_inside_all<F>(wave, depth, sampler);
    if (weigh_anything(volumes_, lamps_))
      weigh_flights<F>(volumes_, ways, flights, scratch, lamps_, counts_.volumes);
  }
  /// Returns the flights of the packet of rays at `i`, whose paths have this throughput.
  template <typename F>
  Flight<F> flight(const Wave& wave, size_t i, const Color<F>& throughput) const {
    const Flights f = flights_of(wave);
    const UInt<F> material = load<UInt<F>>(f.material + i);
    const auto three = [&](float* const(&columns)[3]) {
      return Color<F>(load<F>(columns[0] + i), load<F>(columns[1] + i), load<F>(columns[2] + i));
    };
    const Color<F> weight = flight_weight<F>(three(f.ratio), throughput) * three(f.scale);
    const Mask<F> walked(load<UInt<F>>(f.hero + i) == UInt<F>(uint32_t{Flights::kNoHero}));
    return {Mask<F>(material != UInt<F>(uint32_t{Flights::kNoEvent})), load<F>(f.t + i), material,
            weight, walked};
  }

  template <typename F>
  void pass_all(Wave& wave, uint32_t depth, SamplerKind sampler) const {
    const ShadowQueue& q = wave.shadows;
    float* const product[3] = {wave.ways.floats(kRatio), wave.ways.floats(kRatio + 1),
                               wave.ways.floats(kRatio + 2)};
    float* most = wave.ways.floats(kDistance);
    for (size_t i = 0; i < q.size; i += kWidth<F>) {
      Mask<F> asked(load<UInt<F>>(q.occluded + i) == UInt<F>(0u));
      // Includes blocked rays with a coloured shadow, which attenuates the light instead of
      // removing it.
      if (wave.pool.shades) [[unlikely]]
        asked = asked | is_shaded<F>(wave, i);
      store(most + i, select(asked, F(load<F>(q.tfar + i) * (1.f / kShadowReach)), F(0.f)));
      for (float* one : product) store(one + i, F(1.f));
      const PathRow<F> path = path_at<F>(wave, q.slot, i, q.size);
      put_numbers<F>(wave, i, Way<F>(sampler, path.key, depth, VertexSet::kShadow));
    }
    const Ways ways = ways_of(wave, q, most);
    transmittance_through<F>(volumes_, ways, product, counts_.volumes);
    if (!context_.knows_inside()) return;
    if (wave.pool.shades) [[unlikely]]
      for (size_t i = 0; i < q.size; ++i)
        if (q.occluded[i] != 0) most[i] = 0;
    interiors_.pass<F>({{q.ox, q.oy, q.oz},
                        {q.dx, q.dy, q.dz},
                        q.slot,
                        q.size,
                        wave.times.floats(0),
                        wave.pool.paths,
                        wave.pool.inside},
                       most, product, presence_keys(wave.pool, depth, true, context_.links()));
  }
  template <typename F>
  Color<F> passed(const Wave& wave, size_t i) const {
    const auto column = [&](size_t k) { return load<F>(wave.ways.floats(kRatio + k) + i); };
    return {column(0), column(1), column(2)};
  }

 private:
  template <typename F>
  static RaySegment<F> segment_of(const Passage<F>& p) {
    return {.o = p.o, .d = p.d, .length = p.t, .time = p.time};
  }
  /// Traces the rays of a wave through media inside meshes.
  template <typename F>
  void fly_inside_all(Wave& wave, uint32_t depth, SamplerKind sampler) const {
    const RayQueue& q = wave.rays;
    const HitBuffer& h = wave.hits;
    const PresenceKeys keys = presence_keys(wave.pool, depth, false);
    const Flights f = flights_of(wave);
    const SoaBlock& c = wave.ways;
    const Inside<float> around = depth == 0 ? around_camera(keys) : Inside<float>();
    interiors_.fly<F>({{q.ox, q.oy, q.oz},
                       {q.dx, q.dy, q.dz},
                       q.slot,
                       q.size,
                       wave.times.floats(0),
                       wave.pool.paths,
                       wave.pool.inside},
                      {h.t, h.u, h.v, h.prim, h.geom, h.inst},
                      {volumes_.count > 0,
                       f.t,
                       f.material,
                       {f.ratio[0], f.ratio[1], f.ratio[2]},
                       {c.floats(kAbsorbed), c.floats(kAbsorbed + 1), c.floats(kAbsorbed + 2)},
                       c.uints(kHero)},
                      depth == 0 ? &around : nullptr, keys, [&](size_t, const PathRow<F>& path) {
                        return begin_inside<F>(sampler, path.key, depth, path.throughput);
                      });
  }
  /// Returns the start of a ray through media. The random number of the first distance is
  /// stratified over the pixel's samples, unless volumes use that number.
  template <typename F>
  InteriorStart<F> begin_inside(SamplerKind sampler, const SampleKey<F>& key, uint32_t depth,
                                const Color<F>& throughput) const {
    const Way<F> way(sampler, key, depth, VertexSet::kFlight);
    const UInt<F> seed = way.branch(0x1d3a7u).seed;
    const F first = volumes_.count == 0 ? way.r.z : walk_numbers<F>(seed, UInt<F>(0u)).x;
    return {hero_of<F>(way.r.y, throughput), seed, first};
  }
  /// Returns the medium stack at the centre of the camera at the middle of the shutter interval.
  Inside<float> around_camera(const PresenceKeys& keys) const {
    const Settings& s = *context_.settings;
    const CameraRay<float> ray = camera_ray<float>(
        *context_.camera, 0.5f * static_cast<float>(s.width), 0.5f * static_cast<float>(s.height),
        {0.5f, 0.5f, 0.5f, 0.5f}, true, 0.5f);
    return interiors_.surround(ray.o, 0.5f, keys);
  }
  static Flights flights_of(const Wave& wave) {
    const SoaBlock& c = wave.ways;
    return {c.floats(kDistance),
            c.uints(kMaterial),
            {c.floats(kRatio), c.floats(kRatio + 1), c.floats(kRatio + 2)},
            c.uints(kHero),
            {c.floats(kAbsorbed), c.floats(kAbsorbed + 1), c.floats(kAbsorbed + 2)}};
  }
  /// Returns the rays of a queue as segments of these lengths, with the random numbers of
  /// put_numbers().
  template <typename Queue>
  static Ways ways_of(const Wave& wave, const Queue& q, const float* most) {
    return {q.ox,
            q.oy,
            q.oz,
            q.dx,
            q.dy,
            q.dz,
            most,
            wave.ways.uints(kSeed),
            wave.ways.floats(kFirst),
            q.size,
            wave.times.floats(0)};
  }
  /// Returns the lanes of the shadow rays at `i` that have a coloured shadow.
  template <typename F>
  static Mask<F> is_shaded(const Wave& wave, size_t i) {
    const ShadowQueue& q = wave.shadows;
    const Mask<F> lanes = first_lanes<F>(q.size - i);
    const UInt<F> slot = load<UInt<F>>(q.slot + i);
    return lanes &
           (max_component(load_row<RadianceRow, F>(wave.pool.shades, slot, lanes).sum) > 0.f);
  }
  template <typename F>
  static PathRow<F> path_at(const Wave& wave, const uint32_t* slots, size_t i, size_t size) {
    return load_row<PathRow, F>(wave.pool.paths, load<UInt<F>>(slots + i),
                                first_lanes<F>(size - i));
  }
  template <typename F>
  static void put_numbers(Wave& wave, size_t i, const Way<F>& way) {
    store(wave.ways.uints(kSeed) + i, way.seed);
    store(wave.ways.floats(kFirst) + i, way.r.z);
  }

  const VolumeView volumes_;
  const LightView* const lamps_;  ///< lights that guide distances, or null
  const Interiors interiors_;
};

}  // namespace wavecomb

#include "wavecomb/medium/wave/scalar_flights.h"
