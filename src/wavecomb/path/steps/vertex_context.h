// SPDX-License-Identifier: Apache-2.0
/// Values that the steps of a vertex share.
#pragma once

#include <utility>

#include "wavecomb/guiding/lookup.h"
#include "wavecomb/path/steps/interact.h"

namespace wavecomb {

/// Context of all steps after `interact`. The members refer to values of the vertex that
/// vertex_steps() (path/vertex.h) computes once.
///
/// Contract: the context is valid only within vertex_steps(). Steps read the context, and write
/// VertexResult and the outputs of Vertex. Since the steps are inlined, the references cause no
/// memory accesses.
template <typename Bsdf, typename F, uint32_t kFeatureSet, typename Coupling>
struct VertexContext {
  using Program = Bsdf;
  using Float = F;
  using Interaction = decltype(interact<Bsdf, F>(std::declval<const Vertex<F, kFeatureSet>&>()));
  /// BSDF of the interaction. For volume programs this is the type of the phase function, which
  /// differs from the program's class.
  using Scattering = std::remove_cvref_t<decltype(std::declval<const Interaction&>().bsdf)>;
  using View = decltype(std::declval<const Scattering&>().view(std::declval<const Vec3<F>&>()));
  static constexpr uint32_t kFeatures = kFeatureSet;

  const Vertex<F, kFeatures>& vertex;
  const Interaction& at;             ///< shading point or volume event
  const Frame<F>& frame;             ///< frame of the BSDF's local directions
  const Vec3<F>& wo;                 ///< direction to the viewer, in `frame`
  const View& view;                  ///< result of view(wo) of the BSDF
  const GuidingLookup<F>& guide;     ///< result of the lookup in the guiding field
  const LightReceiver<F>& receiver;  ///< receiver for light sampling, without a position
  Coupling& joint;                   ///< coupling to the joint transport (joint_transport.h)
};

}  // namespace wavecomb
