// SPDX-License-Identifier: Apache-2.0
/// Interface to a joint transport: a second light transport algorithm, such as light paths
/// (light_paths/coupling.h), that samples some of the same transport paths as camera paths, by
/// another technique.
///
/// A joint transport affects camera paths in two ways:
///
/// - The joint transport adds a technique to the MIS weights of camera paths. With R the density
///   with which it samples a path, relative to the density of bounces and up to the density D of
///   the light's emission (light/emission/emission.h), the balance heuristic gives the weights
///     bounce        1 / (1 + p_light / p_bounce + R D),
///     light sample  1 / (1 + p_bounce / p_light + R' D / p_light),
///   where R' is R with p_light in place of p_bounce.
///   Each vertex multiplies its factors into R (PathState::ratio), which is 0 where the joint
///   transport does not reach.
/// - The joint transport receives each camera path vertex after the light sample and before the
///   bounce. It may store the vertex, for example to connect other vertices to the stored one.
///
/// A joint transport is a class with three member types:
///
///   Context      data of a render that all waves read; is_active() returns whether the render
///                has a joint transport
///   Buffers      data of one worker, which
///                  begin_ratios<F>(context, camera, slot, FirstHit, active)  starts R, and
///                  ratio<F>(slot, active)                                   returns it
///   Coupling<F>  couples a packet of vertices to both; has the members of NoCoupling
///
/// Vertex kernels are templates on the class, so that there are no virtual calls, and kernels with
/// NoJointTransport contain no code for joint transport. wave/joint_transport.h registers the class
/// that general kernels use.
#pragma once

#include "wavecomb/path/path_state.h"

namespace wavecomb {

/// First hit point of a camera path.
template <typename F>
struct FirstHit {
  Vec3<F> p, dir;  ///< the point, and the direction of the ray
  F time;          ///< shutter time, if the camera moves
};

/// Coupling for renders without a joint transport. The functions do nothing. The functions are
/// called in the order in which they are declared.
template <typename F>
struct NoCoupling {
  template <typename... Data>
  explicit NoCoupling(const Data&... /*context_and_buffers*/) {}

  /// Sets the ratio R of the paths in `slot`, before their vertices at `depth` are shaded.
  void load(const UInt<F>& /*slot*/, uint32_t /*depth*/, uint32_t /*max_depth*/,
            const Mask<F>& /*active*/, PathState<F>& /*state*/) {}

  /// Returns the MIS weight of the emission that the paths hit at vertex `v`. `light` is the
  /// emitter, if the lane is in `known`. `weight` is the MIS weight without the joint transport,
  /// against light samples with density `light_pdf`.
  template <typename V>
  F emission_weight(const V& /*v*/, const UInt<F>& /*light*/, const Mask<F>& /*known*/,
                    const F& /*light_pdf*/, const F& weight) const {
    return weight;
  }

  /// Begins the light sampling of a vertex.
  template <typename Bsdf, typename V, typename Interaction>
  void begin(const V& /*v*/, const Interaction& /*at*/, const Frame<F>& /*frame*/) {}

  /// Returns the MIS weight of the light sample `to_light` with direction `wi` in the frame of the
  /// vertex, against bounces with density `p_bounce`. `weight` is the MIS weight without the joint
  /// transport.
  template <typename Context, typename Light>
  F light_weight(const Context& /*c*/, const Light& /*to_light*/, const Vec3<F>& /*wi*/,
                 const F& /*p_bounce*/, const F& weight) const {
    return weight;
  }

  /// Passes the vertex to the joint transport, which may store the vertex.
  template <typename Context>
  void offer(const Context& /*c*/) {}

  /// Sets the ratio R of `next` after the bounce `b` along `world`.
  template <typename Context, typename Bounce>
  void bounce(const Context& /*c*/, const Vec3<F>& /*world*/, const Bounce& /*b*/,
              PathState<F>& /*next*/) {}

  /// Stores the ratios R, and the vertices that were passed to offer(). `next` is the state of the
  /// paths that continue, in the lanes `alive`. `aovs` are the AOV values of the wave, which do not
  /// include this vertex yet.
  template <typename Aovs>
  void store(const UInt<F>& /*slot*/, const PathState<F>& /*next*/, const Mask<F>& /*alive*/,
             const Aovs& /*aovs*/, const Mask<F>& /*active*/) const {}
};

/// Camera paths alone.
struct NoJointTransport {
  template <typename F>
  using Coupling = NoCoupling<F>;
};

}  // namespace wavecomb
