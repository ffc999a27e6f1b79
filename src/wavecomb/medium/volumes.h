// SPDX-License-Identifier: Apache-2.0
/// What lies between surfaces: the volumes of a scene.
#pragma once

#include "wavecomb/integrate/media.h"
#include "wavecomb/integrate/wave.h"
#include "wavecomb/material/program_list.h"
#include "wavecomb/medium/tracking.h"
#include "wavecomb/medium/volume_bsdf.h"

namespace wavecomb {

/// What integrate/media.h asks for.
class Volumes {
 public:
  static constexpr bool kAny = true, kShines = true, kStreams = true;
  template <typename F>
  using Programs = AppendedProgram<wavecomb::Programs<F>, VolumeBsdf<F>>;

  /// `counts` gets what ways through them take.
  Volumes(const VolumeView& volumes, VolumeCounts& counts) : volumes_(volumes), counts_(counts) {}

  template <typename F>
  Flight<F> fly(const Passage<F>& p, const Color<F>& throughput, const Mask<F>& active) const {
    return fly_through<F>(volumes_, p, throughput, active, counts_);
  }
  template <typename F>
  Color<F> transmittance(const Passage<F>& p, const Mask<F>& active) const {
    const Way<F> way(p, VertexSet::kShadow);
    return transmittance_through<F>(volumes_, way, p.o, p.d, p.t, active, counts_);
  }

  bool shines() const { return volumes_.emits; }
  template <typename F>
  Color<F> emission(const Passage<F>& p, const Mask<F>& active) const {
    Color<F> sum(F(0.f));
    const Way<F> way(p, VertexSet::kFlight);
    for (uint32_t i = 0; i < volumes_.count; ++i)
      if (volumes_.volumes[i].emits)
        sum += emission_of<F>(volumes_, i, way, p.o, p.d, p.t, active, counts_);
    return sum;
  }

  // The same of all rays of a wave, and of all its shadow rays that are free.

  template <typename F>
  void fly_all(Wave& wave, uint32_t depth, SamplerKind sampler) const {
    const RayQueue& q = wave.rays;
    const Flights flights = flights_of(wave);
    for (size_t i = 0; i < q.size; i += kWidth<F>) {
      store(flights.t + i, load<F>(wave.hits.t + i));
      store(flights.material + i, UInt<F>(uint32_t{Flights::kNoEvent}));
      for (float* ratio : flights.ratio) store(ratio + i, F(1.f));
      const PathRow<F> path = path_at<F>(wave, q.slot, i, q.size);
      const Way<F> way(sampler, path.key, depth, VertexSet::kFlight);
      store(wave.ways.uints(kHero) + i, hero_of<F>(way.r.y, path.throughput));
      put_numbers<F>(wave, i, way);
    }
    const Ways ways{q.ox,
                    q.oy,
                    q.oz,
                    q.dx,
                    q.dy,
                    q.dz,
                    flights.t,
                    wave.ways.uints(kSeed),
                    wave.ways.floats(kFirst),
                    q.size};
    fly_through<F>(volumes_, ways, flights, wave.ways.floats(kScratch), counts_);
  }
  /// Of the rays from `i` on, whose paths have this throughput.
  template <typename F>
  Flight<F> flight(const Wave& wave, size_t i, const Color<F>& throughput) const {
    const Flights f = flights_of(wave);
    const UInt<F> material = load<UInt<F>>(f.material + i);
    const Color<F> ratio{load<F>(f.ratio[0] + i), load<F>(f.ratio[1] + i), load<F>(f.ratio[2] + i)};
    return {Mask<F>(material != UInt<F>(uint32_t{Flights::kNoEvent})), load<F>(f.t + i), material,
            flight_weight<F>(ratio, throughput)};
  }

  template <typename F>
  void pass_all(Wave& wave, uint32_t depth, SamplerKind sampler) const {
    const ShadowQueue& q = wave.shadows;
    float* const product[3] = {wave.ways.floats(kRatio), wave.ways.floats(kRatio + 1),
                               wave.ways.floats(kRatio + 2)};
    float* most = wave.ways.floats(kDistance);
    for (size_t i = 0; i < q.size; i += kWidth<F>) {
      const Mask<F> free(load<UInt<F>>(q.occluded + i) == UInt<F>(0u));
      store(most + i, select(free, F(load<F>(q.tfar + i) * (1.f / kShadowReach)), F(0.f)));
      for (float* one : product) store(one + i, F(1.f));
      const PathRow<F> path = path_at<F>(wave, q.slot, i, q.size);
      put_numbers<F>(wave, i, Way<F>(sampler, path.key, depth, VertexSet::kShadow));
    }
    const Ways ways{
        q.ox,  q.oy, q.oz, q.dx, q.dy, q.dz, most, wave.ways.uints(kSeed), wave.ways.floats(kFirst),
        q.size};
    transmittance_through<F>(volumes_, ways, product, counts_);
  }
  template <typename F>
  Color<F> passed(const Wave& wave, size_t i) const {
    const auto column = [&](size_t k) { return load<F>(wave.ways.floats(kRatio + k) + i); };
    return {column(0), column(1), column(2)};
  }

 private:
  /// Columns of Wave::ways.
  enum Column : size_t {
    kDistance,
    kMaterial,
    kRatio,
    kHero = kRatio + 3,
    kSeed,
    kFirst,
    kScratch
  };
  static_assert(kScratch + 2 == Wave::kWayColumns);

  static Flights flights_of(const Wave& wave) {
    const SoaBlock& c = wave.ways;
    return {c.floats(kDistance),
            c.uints(kMaterial),
            {c.floats(kRatio), c.floats(kRatio + 1), c.floats(kRatio + 2)},
            c.uints(kHero)};
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
  VolumeCounts& counts_;
};

}  // namespace wavecomb
