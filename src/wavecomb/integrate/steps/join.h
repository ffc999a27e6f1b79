// SPDX-License-Identifier: Apache-2.0
/// What camera paths carry where paths from the lights share in their weights
/// (docs/light-paths.md).
///
/// A path x_0 (lens) x_1 .. x_n x_L (light) can come of the camera's bounces, of its light sample
/// at x_n, or of a path from the light that ends at x_1. With w_i the direction from x_i to the
/// camera and l_i that to the light, g the geometric normal, p->_i the density of the bounce w_i ->
/// l_i and p<-_i that of l_i -> w_i, all over solid angle, the third is as dense, over the first,
/// as
///   R = N / G  prod_{i=1..n} |g l_i| / (|g w_i| p->_i)  prod_{i=2..n} p<-_i   times  D,
/// G the camera's density (camera_connection.h), N how many paths start at lights for each of a
/// pixel's, and D the light's (light/emission.h). R is one number, of which each vertex multiplies
/// in its own. At a delta lobe the ratio of densities is that of the solid angles,
///   p<- / p-> = |w z| / (|l z| eta^2),   z the shading normal, eta that of w -> l.
/// R is 0 where paths from lights do not go: x_1 a mirror, a normal that is bent towards who looks,
/// a fibre.
#pragma once

#include "wavecomb/integrate/steps/interact.h"

namespace wavecomb {

inline constexpr float kMostRatio = 1e30f;

/// Whether light goes through delta lobes of program `Bsdf` alike in both directions.
template <typename Bsdf, typename F>
inline Mask<F> passes_one_way(const Bsdf& bsdf, const Vec3<F>& wo, const Vec3<F>& wi) {
  if constexpr (requires { bsdf.is_layered(); })
    return (F(wo.z * wi.z) < 0.f) & bsdf.is_layered();
  else
    return Mask<F>(false);
}

/// A vertex of a camera path: R up to the bounce before, 0 where paths from lights do not go.
template <typename F>
struct JointVertex {
  F ratio;
  F inverse_cos;  ///< 1 / |g w|

  /// R with this vertex for a direction `world` to the light, `local` in the frame, which light
  /// samples or bounces take with density 1: p<- |g l| / |g w|.
  template <typename Bsdf, uint32_t kFeatures, typename Interaction>
  WAVECOMB_INLINE F towards(const Vertex<F, kFeatures>& v, const Interaction& at, const Vec3<F>& wo,
                            const Vec3<F>& world, const Vec3<F>& local) const {
    F r = ratio * F(abs(dot(at.s.ng, world)) * inverse_cos);
    if (v.depth > 0) r *= at.bsdf.eval(at.bsdf.view(local), wo).pdf;
    return r;
  }
};

template <typename Bsdf, typename F, uint32_t kFeatures, typename Interaction>
WAVECOMB_INLINE JointVertex<F> joint_vertex(const Vertex<F, kFeatures>& v, const Interaction& at,
                                            const Frame<F>& frame) {
  if constexpr (Bsdf::kOnFibre) return {F(0.f), F(0.f)};
  const Vec3<F>& dir = v.path.dir;
  const F seen = dot(at.s.ng, dir);
  const Frame<F> unbent = at.unbent_frame(v);
  Mask<F> reached = not_(at.bends(v, unbent, dir)) & (seen != 0.f);
  reached = reached & Mask<F>(frame.n.x == unbent.n.x) & Mask<F>(frame.n.y == unbent.n.y) &
            Mask<F>(frame.n.z == unbent.n.z);
  // Who looks out of what absorbs: paths from lights do not know how far it is.
  if (Bsdf::kAbsorbs && v.depth == 0) reached = reached & (seen < 0.f);
  return {select(reached, v.path.ratio, F(0.f)), F(1.f / select(seen != 0.f, abs(seen), F(1.f)))};
}

/// R after the bounce `b`, along `world`.
template <typename Bsdf, typename F, uint32_t kFeatures, typename Interaction>
WAVECOMB_INLINE F next_ratio(const Vertex<F, kFeatures>& v, const Interaction& at,
                             const JointVertex<F>& joint, const Vec3<F>& wo, const Vec3<F>& world,
                             const BsdfSample<F>& b) {
  const F by_density =
      joint.template towards<Bsdf>(v, at, wo, world, b.wi) / select(b.pdf > 0.f, b.pdf, F(1.f));
  F r = by_density;
  if (any(b.is_delta)) {
    const F z = abs(b.wi.z) * F(b.eta * b.eta);
    F by_angle = joint.ratio * F(abs(dot(at.s.ng, world)) * joint.inverse_cos) *
                 F(abs(wo.z) / select(z > 0.f, z, F(1.f)));
    by_angle = select(passes_one_way<Bsdf, F>(at.bsdf, wo, b.wi), F(0.f), by_angle);
    r = select(b.is_delta, v.depth == 0 ? F(0.f) : by_angle, r);
  }
  return min(max(r, F(0.f)), F(kMostRatio));
}

}  // namespace wavecomb
