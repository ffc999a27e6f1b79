// SPDX-License-Identifier: Apache-2.0
/// The step `scatter`: samples the bounce and the next ray.
///
///   T_{k+1} = T_k f(wo, wi) |cos theta_i| / p(wi)
///
/// where p is the density of the BSDF, or of its mixture with the guiding distribution
/// (guiding/bounce/guided_bounce.h).
#pragma once

#include "wavecomb/accel/embree_accelerator.h"
#include "wavecomb/guiding/bounce/guided_bounce.h"
#include "wavecomb/path/steps/bounce_sampling.h"
#include "wavecomb/path/steps/interact.h"

namespace wavecomb {

/// Returns the diffuse fraction of the bounce `b` for each colour channel. The fraction is 0 for
/// delta bounces.
template <typename F, typename Bsdf, typename View>
WAVECOMB_INLINE Color<F> diffuse_share(const Bsdf& bsdf, const View& view, const BsdfSample<F>& b) {
  const Color<F> diffuse = bsdf.diffuse_f_cos(view, b.wi);
  const auto share = [&](const F& part, const F& weight) {
    const F whole = weight * b.pdf;
    const Mask<F> valid = not_(b.is_delta) & (whole > 0.f);
    return select(valid, clamp(F(part / select(valid, whole, F(1.f))), F(0.f), F(1.f)), F(0.f));
  };
  return {share(diffuse.x, b.weight.x), share(diffuse.y, b.weight.y), share(diffuse.z, b.weight.z)};
}

/// Samples the bounce with the sample values `r`, and sets up the next path segment.
template <typename Bsdf, typename F, uint32_t kFeatures, typename Coupling>
WAVECOMB_INLINE void scatter(const VertexContext<Bsdf, F, kFeatures, Coupling>& c,
                             const Sample4<F>& r, VertexResult<F>& out) {
  const Vertex<F, kFeatures>& v = c.vertex;
  const auto& at = c.at;
  const PathState<F>& path = v.path;
  BsdfSample<F> b = sample_bounce<Bsdf, F>(v, at.bsdf, c.wo, c.view, r);
  guided_bounce(c, r, b, out);
  const Vec3<F> d = normalize(c.frame.to_world(b.wi));
  out.next.dir = d;
  out.next.throughput = at.throughput * b.weight;
  out.next.pdf = select(b.is_delta, F(0.f), b.pdf);
  out.next.eta_scale = path.eta_scale * b.eta * b.eta;
  out.next.receiver = c.receiver.normal;
  out.next.cone_width = path.cone_width;
  if (v.has(kMeshLights) && v.scene.lights.has_multipliers) [[unlikely]]
    out.next.diffuse = diffuse_share<F>(at.bsdf, c.view, b);
  if constexpr ((kFeatures & kSubsurface) != 0 && Bsdf::kHasSubsurface) {
    // Start a subsurface random walk (medium/subsurface/random_walk.h) if the bounce enters the
    // body.
    out.next.enters_body = at.bsdf.enters(c.wo, b.wi) & (out.next.pdf > 0.f);
    out.next.entry = {object_of(v.hit.inst, v.hit.mesh),
                      pack_normal<F>(select<F>(c.wo.z < 0.f, -c.frame.n, c.frame.n))};
  }
  // A rough bounce widens the ray cone: the half width of the lobe is about alpha = roughness^2.
  out.next.cone_spread = max(path.cone_spread, F(b.roughness * b.roughness * 0.25f));
  out.next.o = at.origin(d);
  c.joint.bounce(c, d, b, out.next);
  const F largest = max_component(out.next.throughput);
  out.alive =
      v.active & (b.pdf > 0.f) & at.is_consistent(d, b.wi) & (largest > 0.f) & is_finite(largest);
}

}  // namespace wavecomb
