// SPDX-License-Identifier: Apache-2.0
/// Ratio R of the density of light paths to the density of camera paths (`PathState::ratio`), from
/// which MIS weights are computed (docs/light-paths.md).
///
/// Three techniques sample a path x_0 (lens) x_1 .. x_n x_L (light): the bounces of a camera path,
/// the light sample at x_n, and a light path that is connected to the camera at x_1. Let w_i be the
/// direction from x_i towards the camera and l_i the direction towards the light, g the geometric
/// normal, p->_i the density of the bounce from w_i to l_i and p<-_i the density of the bounce from
/// l_i to w_i, all over solid angle. The density of the third technique divided by that of the
/// first is
///   R = N / G  prod_{i=1..n} |g l_i| / (|g w_i| p->_i)  prod_{i=2..n} p<-_i   times  D,
/// where G is the density of camera paths (camera_connection.h), N the number of light paths in the
/// image for each sample of a pixel, and D the density of the light (light/emission/emission.h).
/// The density ratio R is multiplied by the factors of each vertex of the path. At a delta lobe the
/// ratio of densities is the ratio of the solid angles,
///   p<- / p-> = |w z| / (|l z| eta^2),
/// where z is the shading normal, and eta the relative index of refraction from w to l; if the
/// bounce of the camera path is guided, this is divided by the share of bounces that the BSDF
/// samples. The density ratio R is 0 if light paths cannot be connected to the camera. This is the
/// case if x_1 is specular or on a fibre, or if its shading normal is adjusted to the viewer.
///
/// With connections between vertices of camera paths and light paths, R is the sum over the third
/// technique and all connections of x_i to x_i+1. For such a connection,
///   E_i = d^2 / p->_i   (d is the distance)
/// replaces p<-_i+1 and all earlier factors of R:
///   R_n = |g l_n| / (|g w_n| p->_n) (R_n-1 p<-_n + E_n-1).
/// The term E_i is 0 if one of the two connected vertices scatters by a delta lobe, if light paths
/// cannot reach x_i+1, or if the viewer is inside an absorbing material.
///
/// With merging, camera paths whose bounces were all deltas have a different third technique: a
/// light path that ends within r of x_k, the first vertex with a non-delta lobe. For this
/// technique, R starts with pi r^2 in place of 1 / (G |g w_k|). A delta bounce at x_k sets the
/// density ratio R to 0.
#pragma once

#include "wavecomb/guiding/bounce/guided_bounce.h"
#include "wavecomb/light/emission/emission.h"
#include "wavecomb/light_paths/connection.h"
#include "wavecomb/light_paths/context.h"
#include "wavecomb/light_paths/light_vertices.h"
#include "wavecomb/light_paths/merge_point.h"
#include "wavecomb/light_paths/scattering.h"
#include "wavecomb/path/steps/light_connection.h"
#include "wavecomb/path/steps/vertex_context.h"

namespace wavecomb {

inline constexpr float kMaxRatio = 1e30f;

/// Returns the lanes whose delta transmission has different densities in the two directions of the
/// light, as in layered materials.
template <typename Bsdf, typename F>
inline Mask<F> is_asymmetric(const Bsdf& bsdf, const Vec3<F>& wo, const Vec3<F>& wi) {
  if constexpr (requires { bsdf.is_layered(); })
    return (F(wo.z * wi.z) < 0.f) & bsdf.is_layered();
  else
    return Mask<F>(false);
}

/// Density ratio R (see above) at a vertex of a camera path. `ratio` is the value of R after the
/// previous bounce, or 0 if light paths cannot reach the vertex.
template <typename F>
struct JointVertex {
  F ratio;
  F inverse_cos;       ///< 1 / |g w|
  F connection_ratio;  ///< term E of R for the connection of this vertex to the previous vertex
  Mask<F> merges;      ///< lanes where light paths may be merged (merge_point.h)
  F radius2;           ///< squared merge radius
  bool connects;       ///< LightPathContext::connects

  /// Returns the density ratio R including the factors of this vertex, R p<- |g l| / |g w|, for the
  /// direction `world` to the light (`local` in the shading frame). The caller divides the result
  /// by the density of the light sample or bounce in this direction. The result is undefined in
  /// lanes outside `wanted`.
  template <typename Bsdf, uint32_t kFeatures, typename Interaction>
  WAVECOMB_INLINE F towards(const Vertex<F, kFeatures>& v, const Interaction& at, const Vec3<F>& wo,
                            const Vec3<F>& world, const Vec3<F>& local,
                            const Mask<F>& wanted) const {
    const F cosine_ratio = abs(dot(at.s.ng, world)) * inverse_cos;
    F r = ratio * cosine_ratio;
    if (v.depth > 0) {
      const Mask<F> bounces = wanted & not_(merges) & (r > 0.f);
      if (any(bounces)) {
        const F back = at.bsdf.eval(at.bsdf.view(local), wo).pdf;
        r *= select(bounces, back, F(1.f));
      }
    }
    return connects ? fma(connection_ratio, cosine_ratio, r) : r;
  }
};

/// Computes the density ratio R of light paths to camera paths at a vertex of a camera path, before
/// the bounce of the vertex. `awaits_merge` holds the lanes whose bounces so far were all deltas.
template <typename Bsdf, typename F, uint32_t kFeatures, typename Interaction>
WAVECOMB_INLINE JointVertex<F> joint_vertex(const LightPathContext& context,
                                            const Vertex<F, kFeatures>& v, const Interaction& at,
                                            const Frame<F>& frame, const Mask<F>& awaits_merge) {
  const F zero(0.f);
  if constexpr (Bsdf::kOnFibre) return {zero, zero, zero, Mask<F>(false), zero, context.connects};
  const Vec3<F>& dir = v.path.dir;
  const F view_cosine = dot(at.s.ng, dir);
  const Frame<F> unadjusted = at.unadjusted_frame(v);
  Mask<F> reached = not_(at.is_adjusted(v, unadjusted, dir)) & (view_cosine != 0.f);
  reached = reached & Mask<F>(frame.n.x == unadjusted.n.x) & Mask<F>(frame.n.y == unadjusted.n.y) &
            Mask<F>(frame.n.z == unadjusted.n.z);
  F connection_ratio(0.f);
  if (context.connects && v.depth > 0) {
    Mask<F> can_connect = reached & (v.path.pdf > 0.f);
    if (Bsdf::kAbsorbs) can_connect = can_connect & (view_cosine < 0.f);
    connection_ratio =
        select(can_connect, F(F(v.t * v.t) / select(can_connect, v.path.pdf, F(1.f))), F(0.f));
  }
  // If the viewer is inside an absorbing material, the density ratio R is 0, since the length of
  // the absorbing segment is unknown on light paths.
  if (Bsdf::kAbsorbs && v.depth == 0) reached = reached & (view_cosine < 0.f);
  JointVertex<F> joint{select(reached, v.path.ratio, zero),
                       F(1.f / select(view_cosine != 0.f, abs(view_cosine), F(1.f))),
                       min(connection_ratio, F(kMaxRatio)),
                       Mask<F>(false),
                       zero,
                       context.connects};
  if (context.merge_scale > 0.f) [[unlikely]] {
    const F radius = v.path.cone_width * context.merge_scale;
    joint.radius2 = radius * radius;
    joint.merges = reached & awaits_merge & (joint.radius2 > 0.f);
    if constexpr (Bsdf::kHasNonDelta)
      joint.merges = joint.merges & at.bsdf.has_non_delta();
    else
      joint.merges = Mask<F>(false);
    joint.ratio =
        select(joint.merges, F(joint.radius2 * F(abs(view_cosine) * (kPi * (1.f / context.share)))),
               joint.ratio);
  }
  return joint;
}

/// Returns the MIS weight of the light sample `to_light` against bounces with density `p_bounce`
/// and light paths. `wi` is the sample's direction in the frame of the vertex. If R includes this
/// vertex with p_light in place of p_bounce, the weight is
///   w = 1 / (1 + p_bounce / p_light + R D / p_light);
/// for a point light, the last term contains p_light d^2 in place of p_light.
template <typename Context, typename F>
WAVECOMB_INLINE F joint_light_weight(const Context& c, const JointVertex<F>& joint,
                                     const LightConnection<F>& to_light, const Vec3<F>& wi,
                                     const F& p_bounce) {
  const LightView& lights = c.vertex.scene.lights;
  const LightSample<F>& l = to_light.light;
  const F pdf = select(l.pdf > 0.f, l.pdf, F(1.f));
  const F by_bounce = select(l.is_delta, F(0.f), F(p_bounce / pdf));
  if (!lights.emits_paths()) return 1.f / F(1.f + by_bounce);
  const F density =
      emission_density<F>(lights, l.light, to_light.origin, l.wi, l.distance, l.valid);
  const Mask<F> point = l.is_delta & (l.distance < kFarAway);
  const F nee = select(point, F(pdf * F(l.distance * l.distance)), pdf);
  const F by_path =
      F(joint.template towards<typename Context::Program>(c.vertex, c.at, c.wo, l.wi, wi, l.valid) *
        density) /
      nee;
  return 1.f / F(F(1.f + by_bounce) + min(by_path, F(kMaxRatio)));
}

/// Computes the connection that a vertex of a camera path offers to a vertex of a light path. Let w
/// be the direction to the light path's vertex. The offer contains the factors of the camera path
/// in the contribution
///   T f(w, l) |cos| |g w| / |g l| T_light f_light  v / d^2
/// and in its MIS weight v (light_vertex.h). This computation uses no random numbers.
template <typename Context, typename F>
WAVECOMB_INLINE void offer_connection(const Context& context, const JointVertex<F>& joint,
                                      ConnectionOffer<F>& offer) {
  using Bsdf = typename Context::Program;
  const auto& v = context.vertex;
  const auto& at = context.at;
  const Mask<F> wanted = offer.wanted & v.active & at.bsdf.has_non_delta();
  if (!Bsdf::kHasNonDelta || none(wanted)) return;
  const Connection<F> c = connect_to_point<F>(at, offer.to);
  const Vec3<F>& w = c.d;
  const Vec3<F> wi = context.frame.to_local(w);
  const BsdfEval<F> e = at.bsdf.eval(context.view, wi);
  const Mask<F> usable = wanted & c.valid & at.is_consistent(w, wi);
  const Color<F> light = at.throughput * e.f_cos * offer.vertices;
  const F bounce = mixed_pdf<Bsdf, F>(v, context.guide, w, wi, context.wo, e.pdf);
  offer.row = {c.o, bounce, select<F>(usable, clean<F>(light, 0.f), Color<F>(F(0.f))),
               joint.template towards<Bsdf>(v, at, context.wo, w, wi, usable)};
  if (v.wants_events()) [[unlikely]]
    offer.scattering =
        classify_event<std::remove_cvref_t<decltype(at.bsdf)>, F>(at.bsdf, context.wo, wi);
}

/// Returns the density ratio R of light paths to camera paths after the bounce `b` along `world`.
/// On input, `awaits_merge` holds the lanes whose bounces before `b` were all deltas. On output, it
/// holds the lanes whose bounces up to and including `b` were all deltas.
template <typename Context, typename F>
WAVECOMB_INLINE F next_ratio(const Context& c, const JointVertex<F>& joint, bool merges,
                             const Vec3<F>& world, const BsdfSample<F>& b, Mask<F>& awaits_merge) {
  using Bsdf = typename Context::Program;
  const auto& v = c.vertex;
  const auto& at = c.at;
  const Vec3<F>& wo = c.wo;
  const Mask<F> by_pdf = not_(b.is_delta) & (b.pdf > 0.f);
  const F by_density = joint.template towards<Bsdf>(v, at, wo, world, b.wi, by_pdf) /
                       select(b.pdf > 0.f, b.pdf, F(1.f));
  F r = by_density;
  if (any(b.is_delta)) {
    const F z = abs(b.wi.z) * F(b.eta * b.eta);
    F by_angle = joint.ratio * F(abs(dot(at.s.ng, world)) * joint.inverse_cos) *
                 F(abs(wo.z) / select(z > 0.f, z, F(1.f))) / c.guide.bsdf_share;
    by_angle = select(is_asymmetric<Bsdf, F>(at.bsdf, wo, b.wi), F(0.f), by_angle);
    r = select(b.is_delta, v.depth == 0 ? F(0.f) : by_angle, r);
  }
  r = min(max(r, F(0.f)), F(kMaxRatio));
  if (merges) [[unlikely]] {
    const Mask<F> waits_for_merge = v.depth == 0 ? b.is_delta : Mask<F>(b.is_delta & awaits_merge);
    awaits_merge = waits_for_merge & not_(joint.merges);
    r = select(awaits_merge | (b.is_delta & joint.merges), F(0.f), r);
  }
  return r;
}

}  // namespace wavecomb
