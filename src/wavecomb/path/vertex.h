// SPDX-License-Identifier: Apache-2.0
/// Shading of one path vertex as a sequence of steps. The wavefront and reference integrators share
/// this code.
#pragma once

#include "wavecomb/core/sampler.h"
#include "wavecomb/guiding/bounce/guided_bounce.h"
#include "wavecomb/path/joint_transport.h"
#include "wavecomb/path/path_pool.h"
#include "wavecomb/path/steps/emit.h"
#include "wavecomb/path/steps/interact.h"
#include "wavecomb/path/steps/note_events.h"
#include "wavecomb/path/steps/sample_light.h"
#include "wavecomb/path/steps/scatter.h"
#include "wavecomb/path/steps/survive.h"

namespace wavecomb {

/// Returns the value of MediumStackRow::crossed for a vertex. `out` holds the bounce and the shadow
/// ray of the vertex.
template <typename F, uint32_t kFeatures>
inline UInt<F> crossed_at(const Vertex<F, kFeatures>& v, const Frame<F>& frame, const Vec3<F>& wo,
                          const VertexResult<F>& out) {
  using U = UInt<F>;
  const auto bit = [&](const Mask<F>& on, Crossing what) {
    return select(Mask<U>(on), U(uint32_t{what}), U(0u));
  };
  const auto crosses = [&](const Vec3<F>& d) { return Mask<F>(F(dot(frame.n, d) * wo.z) < 0.f); };
  return (v.material << kCrossingBits) | bit(wo.z > 0.f, kEnters) |
         bit(out.alive & crosses(out.next.dir), kBounceCrosses) |
         bit(out.has_shadow & crosses(out.shadow_d), kShadowCrosses);
}

/// Runs the steps of a vertex for the paths in active lanes. All of these vertices have the shading
/// program `Bsdf`. `joint` couples the paths to a joint transport (joint_transport.h).
template <typename Bsdf, typename F, uint32_t kFeatures, typename Coupling>
WAVECOMB_INLINE VertexResult<F> vertex_steps(const Vertex<F, kFeatures>& v, Coupling& joint) {
  using U = UInt<F>;
  using V = Vertex<F, kFeatures>;
  VertexResult<F> out;
  out.emitted = Color<F>(F(0.f));
  out.direct = Color<F>(F(0.f));
  out.has_shadow = Mask<F>(false);
  out.alive = Mask<F>(false);
  out.shadow_set = U(0u);
  if constexpr (V::has(kMeshLights)) out.shadow_tint = Color<F>(F(0.f));
  out.next.link = U(0u);
  out.axis = U(0u);
  out.bsdf_pdf = F(0.f);
  if constexpr (V::has(kNestedMedia)) out.crossed = U(0u);
  if (v.wants_lights()) {
    v.aovs->emitter = v.aovs->light_id = U(kNoLight);
    v.aovs->light_weight = F(-1.f);
  }
  if (v.wants_bounces()) v.aovs->survival = F(-1.f);

  const auto at = interact<Bsdf, F>(v);
  if constexpr (Bsdf::kEmits) out.emitted = emit<Bsdf, F>(v, at, joint);
  const Frame<F> frame = at.frame(v);
  const Vec3<F> wo = frame.to_local(-v.path.dir);
  at.record_aovs(v, frame);
  if (v.depth >= v.settings.max_depth) return out;
  if (v.has_links()) [[unlikely]]
    out.next.link = at.link_class(v);

  const auto view = at.bsdf.view(wo);
  const GuidingLookup<F> guiding = guiding_lookup<Bsdf, F>(v, at, frame, wo);
  joint.template begin<Bsdf>(v, at, frame);

  const Sample4<F> r_light = v.sample(VertexSet::kLight);
  const LightReceiver<F> receiver = light_receiver<Bsdf, F>(v, frame, wo);
  const VertexContext<Bsdf, F, kFeatures, Coupling> context{.vertex = v,
                                                            .at = at,
                                                            .frame = frame,
                                                            .wo = wo,
                                                            .view = view,
                                                            .guide = guiding,
                                                            .receiver = receiver,
                                                            .joint = joint};
  sample_light(context, r_light, out);
  joint.offer(context);
  const Sample4<F> r_bsdf = v.sample(VertexSet::kBsdf);
  scatter(context, r_bsdf, out);
  survive<F>(v, guiding, luminance(at.throughput), r_light.w, out);
  if constexpr (Bsdf::kOnSurface && Bsdf::kTransmits)
    if (v.has_medium_stack()) [[unlikely]]
      out.crossed = crossed_at<F>(v, frame, wo, out);
  if (v.wants_events()) [[unlikely]]
    classify_events(context, out);
  return out;
}

/// Runs vertex_steps() without inlining, for the reference integrator.
template <typename Bsdf, typename F, uint32_t kFeatures, typename Joint>
VertexResult<F> shade_vertex(const Vertex<F, kFeatures>& v,
                             typename Joint::template Coupling<F>& joint) {
  return vertex_steps<Bsdf, F>(v, joint);
}

}  // namespace wavecomb
