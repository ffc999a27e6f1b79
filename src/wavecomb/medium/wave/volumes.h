// SPDX-License-Identifier: Apache-2.0
/// Transport through the volumes of a scene, through media inside its meshes, and through
/// subsurface bodies.
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
class Volumes : public SubsurfaceScattering {
 public:
  static constexpr bool kAny = true, kHasEmission = true, kStreams = true;
  template <typename F>
  using Programs = AppendedProgram<wavecomb::Programs<F>, VolumeBsdf<F>>;

  /// `counts` receives the statistics of ray segments. `walks` has WalkQueue::kColumns columns for
  /// random walks, and `nested_media` holds the buffers for media inside meshes.
  Volumes(const WaveContext& context, Counts& counts, const SoaBlock& walks,
          const NestedMediaBuffers& nested_media)
      : SubsurfaceScattering(context, counts, walks),
        volumes_(context.scene.volumes),
        distance_lights_(context.settings->equiangular && has_finite_lights(context.scene.lights) &&
                                 std::any_of(volumes_.volumes, volumes_.volumes + volumes_.count,
                                             supports_equiangular)
                             ? &context.scene.lights
                             : nullptr),
        nested_media_(context.scene, *context.accel, context.traversal_width, nested_media, counts,
                      context.settings->equiangular && has_finite_lights(context.scene.lights)) {}

  /// Samples the free flight of one path of the reference integrator, in scenes with nested
  /// dielectrics. `stack` is the medium stack of `path`, `keys` are the presence keys of its ray,
  /// and `hit` is the hit of the ray. Query `p` describes the ray segment to the hit. The function
  /// may change both the path and the hit.
  template <typename Hit>
  Flight<float> sample_nested_flight(const MediumQuery<float>& p, const PresenceKeys& keys,
                                     PathState<float>& path, Hit& hit,
                                     MediumStackRow<float>& stack) const;
  /// Returns the transmittance of media inside meshes along a shadow ray of the reference
  /// integrator.
  Color<float> nested_transmittance(const PresenceKeys& keys, float time,
                                    const MediumStackRow<float>& stack, const Vec3<float>& o,
                                    const Vec3<float>& d, float t) const;

  template <typename F>
  Flight<F> sample_flight(const MediumQuery<F>& p, const Color<F>& throughput,
                          const Mask<F>& active) const {
    return sample_flights<F>(volumes_, p, throughput, active, distance_lights_, counts_.volumes);
  }
  template <typename F>
  Color<F> transmittance(const MediumQuery<F>& p, const Mask<F>& active) const {
    const SegmentRandom<F> random(p, VertexSet::kShadow);
    return transmittance_through<F>(volumes_, random, segment_of(p), active, counts_.volumes);
  }

  bool has_emission() const { return volumes_.emits; }
  template <typename F>
  Color<F> emission(const MediumQuery<F>& p, const Mask<F>& active) const {
    Color<F> sum(F(0.f));
    const SegmentRandom<F> random(p, VertexSet::kFlight);
    const RaySegment<F> segment = segment_of(p);
    for (uint32_t i = 0; i < volumes_.count; ++i)
      if (volumes_.volumes[i].emits)
        sum += emission_of<F>(volumes_, i, random, segment, active, counts_.volumes);
    return sum;
  }

  // The following functions process all rays or all unblocked shadow rays of a wave together.

  template <typename F>
  void sample_wave_flights(Wave& wave, uint32_t depth, SamplerKind sampler) const {
    run_subsurface_walks<F>(wave, depth, sampler);
    const RayQueue& q = wave.rays;
    const Flights flights = flights_of(wave);
    const bool has_medium_stack = context_.has_medium_stack();
    for (size_t i = 0; i < q.size; i += kWidth<F>) {
      const PathRow<F> path = path_at<F>(wave, q.slot, i, q.size);
      const SegmentRandom<F> random(sampler, path.key, depth, VertexSet::kFlight);
      store_random_numbers<F>(wave, i, random);
      store(flights.t + i, has_medium_stack ? F(kInfinity) : load<F>(wave.hits.t + i));
      store(flights.material + i, UInt<F>(uint32_t{Flights::kNoEvent}));
      for (size_t c = 0; c < 3; ++c) {
        store(flights.ratio[c] + i, F(1.f));
        store(flights.scale[c] + i, F(1.f));
      }
      store(wave.segments.uints(kHero) + i, hero_of<F>(random.r.y, path.throughput));
    }
    const RaySegments segments = segments_of(wave, q, flights.t);
    float* const scratch = wave.segments.floats(kScratch);
    if (!has_medium_stack)
      return sample_flights<F>(volumes_, segments, flights, scratch, distance_lights_,
                               counts_.volumes);
    sample_stops<F>(volumes_, segments, flights, scratch, distance_lights_, counts_.volumes);
    sample_nested_flights<F>(wave, depth, sampler);
    if (has_flight_weights(volumes_, distance_lights_))
      compute_flight_ratios<F>(volumes_, segments, flights, scratch, distance_lights_,
                               counts_.volumes);
  }
  /// Returns the free flights of the packet of rays that starts at index `i`. `throughput` is the
  /// throughput of their paths.
  template <typename F>
  Flight<F> flight(const Wave& wave, size_t i, const Color<F>& throughput) const {
    const Flights f = flights_of(wave);
    const UInt<F> material = load<UInt<F>>(f.material + i);
    const auto three = [&](float* const(&columns)[3]) {
      return Color<F>(load<F>(columns[0] + i), load<F>(columns[1] + i), load<F>(columns[2] + i));
    };
    const Color<F> weight = flight_weight<F>(three(f.ratio), throughput) * three(f.scale);
    const Mask<F> has_scattered(load<UInt<F>>(f.hero + i) == UInt<F>(uint32_t{Flights::kNoHero}));
    return {Mask<F>(material != UInt<F>(uint32_t{Flights::kNoEvent})), load<F>(f.t + i), material,
            weight, has_scattered};
  }

  template <typename F>
  void attenuate_shadow_rays(Wave& wave, uint32_t depth, SamplerKind sampler) const {
    const ShadowQueue& q = wave.shadows;
    float* const product[3] = {wave.segments.floats(kRatio), wave.segments.floats(kRatio + 1),
                               wave.segments.floats(kRatio + 2)};
    float* most = wave.segments.floats(kDistance);
    for (size_t i = 0; i < q.size; i += kWidth<F>) {
      Mask<F> traced(load<UInt<F>>(q.occluded + i) == UInt<F>(0u));
      // Also attenuate a blocked ray if its light has a shadow colour, since the light is then
      // tinted instead of blocked.
      if (wave.pool.shadow_tints) [[unlikely]]
        traced = traced | has_shadow_tint<F>(wave, i);
      store(most + i, select(traced, F(load<F>(q.tfar + i) * (1.f / kShadowRayFraction)), F(0.f)));
      for (float* one : product) store(one + i, F(1.f));
      const PathRow<F> path = path_at<F>(wave, q.slot, i, q.size);
      store_random_numbers<F>(wave, i,
                              SegmentRandom<F>(sampler, path.key, depth, VertexSet::kShadow));
    }
    const RaySegments segments = segments_of(wave, q, most);
    transmittance_through<F>(volumes_, segments, product, counts_.volumes);
    if (!context_.has_medium_stack()) return;
    if (wave.pool.shadow_tints) [[unlikely]]
      for (size_t i = 0; i < q.size; ++i)
        if (q.occluded[i] != 0) most[i] = 0;
    nested_media_.attenuate<F>({{q.ox, q.oy, q.oz},
                                {q.dx, q.dy, q.dz},
                                q.slot,
                                q.size,
                                wave.times.floats(0),
                                wave.pool.paths,
                                wave.pool.medium_stacks},
                               most, product,
                               presence_keys(wave.pool, depth, true, context_.links()));
  }
  template <typename F>
  Color<F> shadow_transmittance(const Wave& wave, size_t i) const {
    const auto column = [&](size_t k) { return load<F>(wave.segments.floats(kRatio + k) + i); };
    return {column(0), column(1), column(2)};
  }

 private:
  template <typename F>
  static RaySegment<F> segment_of(const MediumQuery<F>& p) {
    return {.o = p.o, .d = p.d, .length = p.t, .time = p.time};
  }
  /// Traces the rays of a wave through media inside meshes.
  template <typename F>
  void sample_nested_flights(Wave& wave, uint32_t depth, SamplerKind sampler) const {
    const RayQueue& q = wave.rays;
    const HitBuffer& h = wave.hits;
    const PresenceKeys keys = presence_keys(wave.pool, depth, false);
    const Flights f = flights_of(wave);
    const SoaBlock& c = wave.segments;
    const MediumStack<float> around = depth == 0 ? around_camera(keys) : MediumStack<float>();
    nested_media_.sample_flight<F>(
        {{q.ox, q.oy, q.oz},
         {q.dx, q.dy, q.dz},
         q.slot,
         q.size,
         wave.times.floats(0),
         wave.pool.paths,
         wave.pool.medium_stacks},
        {h.t, h.u, h.v, h.prim, h.geom, h.inst},
        {volumes_.count > 0,
         f.t,
         f.material,
         {f.ratio[0], f.ratio[1], f.ratio[2]},
         {c.floats(kAbsorbed), c.floats(kAbsorbed + 1), c.floats(kAbsorbed + 2)},
         c.uints(kHero)},
        depth == 0 ? &around : nullptr, keys, [&](size_t, const PathRow<F>& path) {
          return begin_nested_flight<F>(sampler, path.key, depth, path.throughput);
        });
  }
  /// Returns the hero channel and the random numbers for the start of a ray through media. In
  /// scenes without volumes, the random number of the first distance is stratified over the pixel's
  /// samples. Otherwise volumes use the stratified random number.
  template <typename F>
  NestedRayStart<F> begin_nested_flight(SamplerKind sampler, const SampleKey<F>& key,
                                        uint32_t depth, const Color<F>& throughput) const {
    const SegmentRandom<F> random(sampler, key, depth, VertexSet::kFlight);
    const UInt<F> seed = random.branch(0x1d3a7u).seed;
    const F first = volumes_.count == 0 ? random.r.z : walk_samples<F>(seed, UInt<F>(0u)).x;
    return {hero_of<F>(random.r.y, throughput), seed, first};
  }
  /// Returns the medium stack at the centre of the camera at the middle of the shutter interval.
  MediumStack<float> around_camera(const PresenceKeys& keys) const {
    const Settings& s = *context_.settings;
    const CameraRay<float> ray = camera_ray<float>(
        *context_.camera, 0.5f * static_cast<float>(s.width), 0.5f * static_cast<float>(s.height),
        {0.5f, 0.5f, 0.5f, 0.5f}, true, 0.5f);
    return nested_media_.stack_at(ray.o, 0.5f, keys);
  }
  static Flights flights_of(const Wave& wave) {
    const SoaBlock& c = wave.segments;
    return {c.floats(kDistance),
            c.uints(kMaterial),
            {c.floats(kRatio), c.floats(kRatio + 1), c.floats(kRatio + 2)},
            c.uints(kHero),
            {c.floats(kAbsorbed), c.floats(kAbsorbed + 1), c.floats(kAbsorbed + 2)}};
  }
  /// Returns the rays of a queue as segments with the given lengths and the random numbers of
  /// store_random_numbers().
  template <typename Queue>
  static RaySegments segments_of(const Wave& wave, const Queue& q, const float* most) {
    return {q.ox,
            q.oy,
            q.oz,
            q.dx,
            q.dy,
            q.dz,
            most,
            wave.segments.uints(kSeed),
            wave.segments.floats(kFirst),
            q.size,
            wave.times.floats(0)};
  }
  /// For the packet of shadow rays that starts at index `i`, returns the lanes whose light has a
  /// shadow colour.
  template <typename F>
  static Mask<F> has_shadow_tint(const Wave& wave, size_t i) {
    const ShadowQueue& q = wave.shadows;
    const Mask<F> lanes = first_lanes<F>(q.size - i);
    const UInt<F> slot = load<UInt<F>>(q.slot + i);
    return lanes &
           (max_component(load_row<RadianceRow, F>(wave.pool.shadow_tints, slot, lanes).sum) > 0.f);
  }
  template <typename F>
  static PathRow<F> path_at(const Wave& wave, const uint32_t* slots, size_t i, size_t size) {
    return load_row<PathRow, F>(wave.pool.paths, load<UInt<F>>(slots + i),
                                first_lanes<F>(size - i));
  }
  template <typename F>
  static void store_random_numbers(Wave& wave, size_t i, const SegmentRandom<F>& random) {
    store(wave.segments.uints(kSeed) + i, random.seed);
    store(wave.segments.floats(kFirst) + i, random.r.z);
  }

  const VolumeView volumes_;
  const LightView* const distance_lights_;  ///< lights for equiangular sampling, or null
  const NestedMedia nested_media_;
};

}  // namespace wavecomb

#include "wavecomb/medium/wave/scalar_flights.h"
