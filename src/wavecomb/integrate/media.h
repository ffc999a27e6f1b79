// SPDX-License-Identifier: Apache-2.0
/// What lies between surfaces. The stages that follow rays are templates on a class `Media`, so
/// that scenes without any run kernels that know of none. It has
///
///   static constexpr bool kAny;            whether there is anything; if not, Programs is all else
///   static constexpr bool kShines;         whether it may send out light; if so, it has
///     bool shines() const;                   whether it does
///     Color<F> emission(const Passage<F>&, const Mask<F>& active) const;    radiance on the way
///   template <typename F> using Programs;  what may be met, surfaces included: ProgramList
///   template <typename F> Flight<F> fly(const Passage<F>&, const Color<F>& throughput, const
///   Mask<F>& active) const; template <typename F> Color<F> transmittance(const Passage<F>&, const
///   Mask<F>& active) const;
///
/// Where `kStreams` says so it does the same for all rays of a wave at once, whose packets would
/// else wait for their longest ways:
///
///   void fly_all(Wave&, uint32_t depth, SamplerKind) const;      before the rays are collected
///   Flight<F> flight(const Wave&, size_t ray, const Color<F>& throughput) const;
///   void pass_all(Wave&, uint32_t depth, SamplerKind) const;     of shadow rays that are free
///   Color<F> passed(const Wave&, size_t ray) const;
///
/// A program of its own shades what happens on the way (BsdfTraits::kOnSurface is false).
///
/// Contract: all functions give a lane what its own passage says, whatever the others are, and
/// draw from VertexSet::kFlight and kShadow alone, so that no schedule shows.
#pragma once

#include "wavecomb/core/sampler.h"
#include "wavecomb/material/program_list.h"

namespace wavecomb {

/// A straight way without surfaces: points o + x d, 0 < x < t. It leads to the vertex of `depth`,
/// or, for a shadow ray, from it to a light.
template <typename F>
struct Passage {
  SamplerKind sampler;
  const SampleKey<F>& key;
  uint32_t depth;
  const Vec3<F>&o, &d;
  const F& t;   ///< infinite where the scene ends
  F time{0.f};  ///< of the shutter, where something moves
};

/// What becomes of a path on a passage.
template <typename F>
struct Flight {
  Mask<F> stopped;   ///< it meets something on the way
  F t;               ///< where, if so
  UInt<F> material;  ///< and what: its program shades the vertex
  Color<F> weight;   ///< of the throughput: transmittance over the probability of this outcome,
                     ///< or over the density of t, times the extinction there
  Mask<F> walked{false};  ///< it is elsewhere now, by collisions that are no vertices
};

/// Nothing between surfaces.
struct NoMedia {
  static constexpr bool kAny = false, kShines = false, kStreams = false;
  template <typename F>
  using Programs = wavecomb::Programs<F>;
};

}  // namespace wavecomb
