// SPDX-License-Identifier: Apache-2.0
/// Free flights and transmittance along ray segments through volumes.
///
/// Uses null scattering (Miller, Georgiev and Jarosz, "A null-scattering path integral formulation
/// of light transport", 2019): null collisions increase the extinction to a majorant that is
/// constant in each cell of a grid, so that distances to collisions are exponential. Volumes are
/// sampled one after the other. Where volumes overlap, the nearest of their sampled collisions is
/// used, since the minimum of independent exponential distances is exponential with the sum of
/// their rates.
///
/// The random numbers of collision i in volume v are hashes of v, i and the path's random numbers,
/// so that the order of processing has no effect.
#pragma once

#include "wavecomb/medium/volume/homogeneous.h"
#include "wavecomb/medium/volume/moving_lookup.h"
#include "wavecomb/medium/volume/ray_segments.h"

namespace wavecomb {

/// Random numbers of a ray segment. `r` are the sample values of the segment, stratified over a
/// pixel's samples; the first volume uses some of them directly. `seed` generates all other random
/// numbers.
template <typename F>
struct SegmentRandom {
  Sample4<F> r;
  UInt<F> seed;

  SegmentRandom(SamplerKind sampler, const SampleKey<F>& key, uint32_t depth, VertexSet set)
      : r(sample_4d<F>(sampler, key, vertex_set(set, depth))),
        seed(float_bits<F>(r.x) ^ path_hash<F>(key)) {}
  SegmentRandom(const MediumQuery<F>& p, VertexSet set)
      : SegmentRandom(p.sampler, p.key, p.depth, set) {}
  /// Returns a copy whose `seed` generates independent random numbers.
  SegmentRandom branch(uint32_t number) const {
    SegmentRandom other = *this;
    other.seed = hash_u32<UInt<F>>(seed, UInt<F>(0x2545f491u + number));
    return other;
  }
};

namespace detail {

/// Time in seconds at which a visitor looks up a moving volume, one for each lane.
template <typename F>
class SegmentSeconds {
 public:
  /// `times` is RaySegments::times.
  SegmentSeconds(const VolumeRecord& v, const float* times) : v_(v), times_(times) {}
  void start(const UInt<F>& segment, const Mask<F>& lanes) {
    if (v_.moves && times_)
      seconds_ = select(lanes, seconds_at<F>(v_, gather<F>(times_, segment, lanes)), seconds_);
  }
  const F& operator()() const { return seconds_; }

 private:
  const VolumeRecord& v_;
  const float* times_;
  F seconds_{0.f};
};

}  // namespace detail

// ---- flights -----------------------------------------------------------------------------------

namespace detail {

/// Visitor that samples free flights through one volume.
template <typename F>
class FlightVisitor {
  using U = UInt<F>;

 public:
  /// `times` is RaySegments::times.
  FlightVisitor(const VolumeRecord& v, uint32_t material, const Flights& flights,
                FlightResults results, const float* times)
      : v_(v), seconds_(v, times), material_(material), flights_(flights), results_(results) {}

  void start(const U& segment, const Mask<F>& lanes) {
    const U hero = gather<U>(flights_.hero, segment, Mask<U>(lanes));
    const F own = select(hero == U(0u), F(v_.extinction[0]),
                         select(hero == U(1u), F(v_.extinction[1]), F(v_.extinction[2])));
    of_hero_ = select(lanes, own, of_hero_);
    ratio_ = select<F>(lanes, Color<F>(F(1.f)), ratio_);
    stopped_ = stopped_ & not_(lanes);
    seconds_.start(segment, lanes);
  }
  Mask<F> collide(const Mask<F>& lanes, const F& x, const Vec3<F>& p, const F& majorant,
                  CollisionSequence<F>& numbers) {
    const F density = density_at<F>(v_, p, seconds_(), lanes) / select(lanes, majorant, F(1.f));
    const F real = min(F(density * of_hero_), F(1.f));
    const Mask<F> stops = lanes & (numbers.next(lanes) < real);
    if (!v_.is_grey) {
      const F by_hero = F(1.f) / select(stops, real, F(1.f - real));
      const auto channel = [&](const F& ratio, float extinction) {
        const F share = min(F(density * extinction), F(1.f));
        return select(lanes, F(ratio * select(stops, share, F(1.f - share)) * by_hero), ratio);
      };
      ratio_ = {channel(ratio_.x, v_.extinction[0]), channel(ratio_.y, v_.extinction[1]),
                channel(ratio_.z, v_.extinction[2])};
    }
    stopped_ = stopped_ | stops;
    x_ = select(stops, x, x_);
    return stops;
  }
  void finish(const U& segment, const Mask<F>& lanes) {
    if (none(lanes)) return;
    if (results_ != FlightResults::kRatios) {
      const Mask<F> stops = lanes & stopped_;
      scatter<F>(flights_.t, x_, segment, stops);
      scatter<U>(flights_.material, U(material_), segment, Mask<U>(stops));
    }
    if (results_ == FlightResults::kStops || v_.is_grey) return;
    const F* const ratio[3] = {&ratio_.x, &ratio_.y, &ratio_.z};
    for (int k = 0; k < 3; ++k)
      scatter<F>(flights_.ratio[k], F(gather<F>(flights_.ratio[k], segment, lanes) * *ratio[k]),
                 segment, lanes);
  }

 private:
  const VolumeRecord& v_;
  SegmentSeconds<F> seconds_;
  uint32_t material_;
  const Flights& flights_;
  FlightResults results_;
  F of_hero_{0.f}, x_{0.f};
  Color<F> ratio_{F(1.f)};
  Mask<F> stopped_{false};
};

}  // namespace detail

namespace detail {

/// Samples free flights through one volume.
template <typename F>
inline void sample_flights_in(const VolumeView& volumes, uint32_t i, const RaySegments& segments,
                              const Flights& flights, FlightResults results, VolumeCounts& counts) {
  const VolumeRecord& v = volumes.volumes[i];
  FlightVisitor<F> visitor(v, volumes.first_material + i, flights, results, segments.times);
  each_collision<F>(extinction_cells(v), v.max_extinction, i, segments, counts, visitor);
}

}  // namespace detail

/// Returns whether all volumes have the same extinction in all channels.
inline bool are_grey(const VolumeView& volumes) {
  return std::all_of(volumes.volumes, volumes.volumes + volumes.count,
                     [](const VolumeRecord& v) { return v.is_grey; });
}
/// Returns whether free flights can have weights other than 1. `distance_lights` are the lights for
/// equiangular sampling, or null.
inline bool has_flight_weights(const VolumeView& volumes, const LightView* distance_lights) {
  return distance_lights || !are_grey(volumes);
}

/// Samples, for all volumes, the distances at which flights stop, without computing weights. On
/// entry, `segments.most` and `flights.t` hold the lengths of the segments. The function copies
/// these lengths to `scratch`.
template <typename F>
inline void sample_stops(const VolumeView& volumes, const RaySegments& segments,
                         const Flights& flights, float* scratch, const LightView* distance_lights,
                         VolumeCounts& counts) {
  std::copy_n(flights.t, segments.count, scratch);
  RaySegments original = segments;
  original.most = scratch;
  for (uint32_t i = 0; i < volumes.count; ++i)
    if (distance_lights && supports_equiangular(volumes.volumes[i]))
      sample_homogeneous_flights<F>(volumes, i, original, flights, FlightResults::kStops,
                                    *distance_lights, counts);
    else
      detail::sample_flights_in<F>(volumes, i, segments, flights, FlightResults::kStops, counts);
}

/// Computes the ratios of the flights after their final stops are known. Only one volume stops a
/// flight; in all other volumes, the sampled flight may have gone beyond the stop. In these
/// volumes, the flight is repeated up to the stop, with the same random numbers. In the volume that
/// stopped the flight, the flight is repeated with its original length.
template <typename F>
inline void compute_flight_ratios(const VolumeView& volumes, const RaySegments& segments,
                                  const Flights& flights, float* scratch,
                                  const LightView* distance_lights, VolumeCounts& counts) {
  RaySegments original = segments, once_more = segments;
  original.most = scratch;
  once_more.most = scratch + segments.count;
  for (uint32_t i = 0; i < volumes.count; ++i) {
    if (distance_lights && supports_equiangular(volumes.volumes[i])) {
      sample_homogeneous_flights<F>(volumes, i, original, flights, FlightResults::kRatios,
                                    *distance_lights, counts);
      continue;
    }
    if (volumes.volumes[i].is_grey) continue;
    for (size_t k = 0; k < segments.count; ++k) {
      scratch[segments.count + k] =
          flights.material[k] == volumes.first_material + i ? scratch[k] : flights.t[k];
      if (flights.hero[k] == Flights::kNoHero) scratch[segments.count + k] = 0;
    }
    detail::sample_flights_in<F>(volumes, i, once_more, flights, FlightResults::kRatios, counts);
  }
}

/// Samples the free flights through all volumes, and computes their weights. `segments.most` must
/// point to `flights.t`, and `scratch` must have room for two values per segment.
template <typename F>
inline void sample_flights(const VolumeView& volumes, const RaySegments& segments,
                           const Flights& flights, float* scratch, const LightView* distance_lights,
                           VolumeCounts& counts) {
  if (distance_lights || (volumes.count > 1 && !are_grey(volumes))) {
    sample_stops<F>(volumes, segments, flights, scratch, distance_lights, counts);
    compute_flight_ratios<F>(volumes, segments, flights, scratch, distance_lights, counts);
    return;
  }
  for (uint32_t i = 0; i < volumes.count; ++i)
    detail::sample_flights_in<F>(volumes, i, segments, flights, FlightResults::kBoth, counts);
}

/// Samples the free flight of one ray segment in each lane.
template <typename F>
inline Flight<F> sample_flights(const VolumeView& volumes, const MediumQuery<F>& p,
                                const Color<F>& throughput, const Mask<F>& active,
                                const LightView* distance_lights, VolumeCounts& counts) {
  using U = UInt<F>;
  constexpr size_t kLanes = kWidth<F>;
  const SegmentRandom<F> random(p, VertexSet::kFlight);
  const PacketSegments<F> packet(p.o, p.d, p.t, random.seed, random.r.z, p.time, active);
  alignas(64) float t[kLanes], ratio[3][kLanes], scale[3][kLanes], scratch[2 * kLanes];
  alignas(64) uint32_t material[kLanes], hero[kLanes];
  RaySegments segments = packet.segments();
  std::copy_n(segments.most, kLanes, t);
  segments.most = t;
  store(material, U(uint32_t{Flights::kNoEvent}));
  store(hero, hero_of<F>(random.r.y, throughput));
  for (auto& one : ratio) store(one, F(1.f));
  for (auto& one : scale) store(one, F(1.f));
  sample_flights<F>(
      volumes, segments,
      {t, material, {ratio[0], ratio[1], ratio[2]}, hero, {scale[0], scale[1], scale[2]}}, scratch,
      distance_lights, counts);
  const U stopped_by = load<U>(material);
  const auto three = [](const float (&columns)[3][kLanes]) {
    return Color<F>(load<F>(columns[0]), load<F>(columns[1]), load<F>(columns[2]));
  };
  return {Mask<F>(stopped_by != U(uint32_t{Flights::kNoEvent})), load<F>(t), stopped_by,
          flight_weight<F>(three(ratio), throughput) * three(scale)};
}

// ---- transmittance -----------------------------------------------------------------------------

namespace detail {

/// Visitor that multiplies by the transmittance of one volume.
template <typename F>
class TransmittanceVisitor {
  using U = UInt<F>;
  static constexpr float kLittle = 0.1f;

 public:
  /// `times` is RaySegments::times.
  TransmittanceVisitor(const VolumeRecord& v, float* const (&product)[3], const float* times)
      : v_(v), seconds_(v, times), columns_(product) {}

  void start(const U& segment, const Mask<F>& lanes) {
    const auto column = [&](int k) { return gather<F>(columns_[k], segment, lanes); };
    product_ = select<F>(lanes, Color<F>(column(0), column(1), column(2)), product_);
    seconds_.start(segment, lanes);
  }
  Mask<F> collide(const Mask<F>& lanes, const F& /*x*/, const Vec3<F>& p, const F& majorant,
                  CollisionSequence<F>& numbers) {
    const F density = density_at<F>(v_, p, seconds_(), lanes) / select(lanes, majorant, F(1.f));
    const auto transmitted = [&](float extinction) {
      return max(F(1.f - density * extinction), F(0.f));
    };
    Color<F> now = product_ * Color<F>(transmitted(v_.extinction[0]), transmitted(v_.extinction[1]),
                                       transmitted(v_.extinction[2]));
    const F q = min(F(max_component(now) * (1.f / kLittle)), F(1.f));
    const Mask<F> ends = lanes & not_(numbers.next(lanes) < q);
    now = now * F(F(1.f) / select(q > 0.f, q, F(1.f)));
    product_ = select<F>(lanes, select<F>(ends, Color<F>(F(0.f)), now), product_);
    return ends;
  }
  void finish(const U& segment, const Mask<F>& lanes) {
    const F* const product[3] = {&product_.x, &product_.y, &product_.z};
    for (int k = 0; k < 3; ++k) scatter<F>(columns_[k], *product[k], segment, lanes);
  }

 private:
  const VolumeRecord& v_;
  SegmentSeconds<F> seconds_;
  float* const (&columns_)[3];
  Color<F> product_{F(0.f)};
};

}  // namespace detail

/// Multiplies each `product` by the transmittance of a ray segment: exactly for homogeneous
/// volumes, and otherwise by ratio tracking (Novak, Selle and Jarosz, "Residual Ratio Tracking",
/// 2014, eq. 9) with Russian roulette at low transmittance.
template <typename F>
inline void transmittance_through(const VolumeView& volumes, const RaySegments& segments,
                                  float* const (&product)[3], VolumeCounts& counts) {
  for (uint32_t i = 0; i < volumes.count; ++i) {
    const VolumeRecord& v = volumes.volumes[i];
    if (is_homogeneous(v)) {
      multiply_homogeneous_transmittance<F>(v, segments, product, counts);
      continue;
    }
    detail::TransmittanceVisitor<F> visitor(v, product, segments.times);
    each_collision<F>(extinction_cells(v), v.max_extinction, i, segments, counts, visitor);
  }
}

/// Returns the transmittance of one ray segment in each lane, with the random numbers of `random`.
template <typename F>
inline Color<F> transmittance_through(const VolumeView& volumes, const SegmentRandom<F>& random,
                                      const RaySegment<F>& segment, const Mask<F>& active,
                                      VolumeCounts& counts) {
  const PacketSegments<F> packet(segment.o, segment.d, segment.length, random.seed, random.r.z,
                                 segment.time, active);
  alignas(64) float product[3][kWidth<F>];
  for (auto& one : product) store(one, F(1.f));
  float* const columns[3] = {product[0], product[1], product[2]};
  transmittance_through<F>(volumes, packet.segments(), columns, counts);
  return {load<F>(product[0]), load<F>(product[1]), load<F>(product[2])};
}

}  // namespace wavecomb
