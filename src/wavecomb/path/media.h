// SPDX-License-Identifier: Apache-2.0
/// Interface to volumes and media between surfaces. The wave stages that follow rays are templates
/// on a class `Media`, so that scenes without volumes use kernels without that code. Its members
/// are
///
///   // Whether there are volumes; if not, only Programs is needed.
///   static constexpr bool kAny;
///   // Whether volumes may emit; if so, the next two functions are needed.
///   static constexpr bool kHasEmission;
///   bool has_emission() const;
///   // Radiance of the segment.
///   Color<F> emission(const MediumQuery<F>&, const Mask<F>& active) const;
///   // ProgramList of all programs, including surface programs.
///   template <typename F> using Programs;
///   template <typename F>
///   Flight<F> sample_flight(const MediumQuery<F>&, const Color<F>& throughput,
///                           const Mask<F>& active) const;
///   template <typename F>
///   Color<F> transmittance(const MediumQuery<F>&, const Mask<F>& active) const;
///
/// With `kStreams`, the class has functions that handle all rays of a wave at once, since packets
/// would wait for their longest segments:
///
///   void sample_wave_flights(Wave&, uint32_t depth, SamplerKind) const;  before collecting hits
///   Flight<F> flight(const Wave&, size_t ray, const Color<F>& throughput) const;
///   void attenuate_shadow_rays(Wave&, uint32_t depth, SamplerKind) const;  for free shadow rays
///   Color<F> shadow_transmittance(const Wave&, size_t ray) const;
///
/// Events in volumes are not shaded by surface programs but by a separate program, whose
/// BsdfTraits::kOnSurface is false.
///
/// Contract: the result of a lane depends only on its own segment, and random numbers come only
/// from VertexSet::kFlight and kShadow, so that the order of processing has no effect.
#pragma once

#include "wavecomb/core/sampler.h"
#include "wavecomb/material/program_list.h"

namespace wavecomb {

/// Ray segment that crosses no surface: the points o + x d with 0 < x < t. The segment ends at the
/// vertex of `depth` or, for a shadow ray, leads from that vertex to a light.
template <typename F>
struct MediumQuery {
  SamplerKind sampler;
  const SampleKey<F>& key;
  uint32_t depth;
  const Vec3<F>&o, &d;
  const F& t;   ///< infinite if the ray leaves the scene
  F time{0.f};  ///< shutter time, if the scene moves
};

/// Result of a free flight along a segment.
template <typename F>
struct Flight {
  Mask<F> stopped;   ///< whether an event ends the flight
  F t;               ///< distance of the event
  UInt<F> material;  ///< material of the event, whose program shades the vertex
  /// Factor of the throughput. Without an event, the factor is the transmittance divided by the
  /// probability of passing; with an event, transmittance times extinction divided by the density
  /// of t.
  Color<F> weight;
  Mask<F> has_scattered{false};  ///< whether the path has scattered without creating a vertex
};

/// `Media` class of scenes without volumes and media.
struct NoMedia {
  static constexpr bool kAny = false, kHasEmission = false, kStreams = false;
  template <typename F>
  using Programs = wavecomb::Programs<F>;
};

}  // namespace wavecomb
