// SPDX-License-Identifier: Apache-2.0
/// Interface to volumes and media between surfaces. The wave stages that follow rays are templates
/// on a class `Media`, so that scenes without volumes use kernels without that code. Its members
/// are
///
///   static constexpr bool kAny;      whether there are volumes; if not, only Programs is needed
///   static constexpr bool kShines;   whether volumes may emit; if so, it needs the next two
///   bool shines() const;             whether they do
///   Color<F> emission(const Passage<F>&, const Mask<F>& active) const;   radiance of the segment
///   template <typename F> using Programs;      ProgramList of all programs, with those of surfaces
///   template <typename F> Flight<F> fly(const Passage<F>&, const Color<F>& throughput,
///                                       const Mask<F>& active) const;
///   template <typename F> Color<F> transmittance(const Passage<F>&, const Mask<F>& active) const;
///
/// With `kStreams`, the class instead handles all rays of a wave at once, since packets would wait
/// for their longest segments:
///
///   void fly_all(Wave&, uint32_t depth, SamplerKind) const;      before the hits are collected
///   Flight<F> flight(const Wave&, size_t ray, const Color<F>& throughput) const;
///   void pass_all(Wave&, uint32_t depth, SamplerKind) const;     for free shadow rays
///   Color<F> passed(const Wave&, size_t ray) const;
///
/// A separate shading program shades events in volumes (BsdfTraits::kOnSurface is false).
///
/// Contract: the result of a lane depends only on its own passage, and random numbers come only
/// from VertexSet::kFlight and kShadow, so that the schedule has no effect.
#pragma once

#include "wavecomb/core/sampler.h"
#include "wavecomb/material/program_list.h"

namespace wavecomb {

/// Ray segment without surfaces: points o + x d with 0 < x < t. It ends at the vertex of `depth`
/// or, for a shadow ray, leads from that vertex to a light.
template <typename F>
struct Passage {
  SamplerKind sampler;
  const SampleKey<F>& key;
  uint32_t depth;
  const Vec3<F>&o, &d;
  const F& t;   ///< infinite if the ray leaves the scene
  F time{0.f};  ///< shutter time, if the scene moves
};

/// Result of a free flight along a passage.
template <typename F>
struct Flight {
  Mask<F> stopped;   ///< whether an event ends the flight
  F t;               ///< distance of the event
  UInt<F> material;  ///< material of the event, whose program shades the vertex
  /// Factor of the throughput. Without an event, it is transmittance over the probability of
  /// passing; with an event, transmittance times extinction over the density of t.
  Color<F> weight;
  Mask<F> walked{false};  ///< whether the path has moved by collisions that are no vertices
};

/// Scene without volumes and media.
struct NoMedia {
  static constexpr bool kAny = false, kShines = false, kStreams = false;
  template <typename F>
  using Programs = wavecomb::Programs<F>;
};

}  // namespace wavecomb
