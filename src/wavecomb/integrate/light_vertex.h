// SPDX-License-Identifier: Apache-2.0
/// One vertex of a path from a light. Both integrators run this and nothing else for such paths.
///
/// The path carries flux. With the direction w to the camera and l to the light, g the geometric
/// normal, and the BSDF as the camera's paths have it (f(w, l) |cos l|, radiance scaled by indices
/// of refraction: evaluated from w's side), a bounce l -> w of density p<- makes
///   T <- T f(w, l) |cos l| / p<-  |g w| / |g l|
/// (E. Veach, "Robust Monte Carlo Methods", 1997, section 5.3: shading normals and refraction of
/// adjoint BSDFs), and what a pixel gets of the vertex, seen with the density G
/// (camera_connection.h), is
///   T f(w, l) |cos l|  |g w| / |g l|  G  v,   v = 1 / (1 + S (p-> + p_light) |g w| / |g l| G / N).
/// S is 1 / D at the light, and each vertex multiplies in
///   S <- S p-> |g w| / (|g l| p<-);   the first one with p-> + p_light in place of p->:
/// what the camera's techniques (steps/join.h) are as dense over this one.
#pragma once

#include "wavecomb/integrate/camera_connection.h"
#include "wavecomb/integrate/light_path.h"
#include "wavecomb/integrate/vertex.h"
#include "wavecomb/light/emission.h"

namespace wavecomb {

namespace detail {

/// What a path from a light finds at a vertex: the surface, and the light's side.
template <typename Bsdf, typename F, typename Interaction>
struct LitPlace {
  const Interaction& at;
  Frame<F> frame;
  Vec3<F> l;              ///< to the light, local
  F inverse_cos;          ///< 1 / |g l|
  Color<F> flux;          ///< that arrives
  F sampled;              ///< p_light, of the first vertex
  Mask<F> by_light_only;  ///< bounces do not find the light
  Mask<F> active;

  /// |g w| / |g l| for a world direction.
  F turn(const Vec3<F>& w) const { return abs(dot(at.s.ng, w)) * inverse_cos; }
  /// p-> + p_light.
  F found(const F& bounce) const { return select(by_light_only, F(0.f), bounce) + sampled; }
};

template <typename Bsdf, typename F, uint32_t kFeatures, typename Interaction>
WAVECOMB_INLINE LitPlace<Bsdf, F, Interaction> lit_place(const Vertex<F, kFeatures>& v,
                                                         const Interaction& at) {
  const Vec3<F> back = -v.path.dir;
  const F cosine = abs(dot(at.s.ng, back));
  LitPlace<Bsdf, F, Interaction> place{at,
                                       at.unbent_frame(v),
                                       {},
                                       F(1.f / select(cosine > 0.f, cosine, F(1.f))),
                                       v.depth == 0 ? v.path.throughput : at.throughput,
                                       F(0.f),
                                       Mask<F>(false),
                                       Mask<F>(false)};
  place.l = place.frame.to_local(back);
  place.active = v.active & (cosine > 0.f) & at.is_consistent(back, place.l);
  if (v.depth == 0) {
    LightReceiver<F> receiver(at.origin(back));
    if (v.scene.lights.by_tree && !Bsdf::kTransmits)
      receiver.normal = pack_normal<F>(select<F>(place.l.z < 0.f, -place.frame.n, place.frame.n));
    const LightReach<F> reach =
        light_reach<F>(v.scene.lights, v.path.receiver, receiver, back, v.t, place.active);
    // Where nothing but deltas is, no light is sampled.
    place.sampled = select(at.bsdf.has_non_delta(), reach.density, F(0.f));
    place.by_light_only = reach.is_delta;
  }
  return place;
}

/// Shows the vertex to the camera.
template <typename Bsdf, typename F, uint32_t kFeatures, typename Place>
WAVECOMB_INLINE void connect(const Vertex<F, kFeatures>& v, const LightPathSetup& setup,
                             const Place& place, const Sample4<F>& r, LightVertexResult<F>& out) {
  const auto& at = place.at;
  const Mask<F> wanted = place.active & at.bsdf.has_non_delta();
  if (!Bsdf::kHasNonDelta || none(wanted)) return;
  const CameraConnection<F> c =
      connect_to_camera<F>(setup.camera, at.s.p, r.y, r.z, v.hit.time, wanted);
  const Vec3<F> way = c.to - at.s.p;
  const F distance2 = length_squared(way);
  const Vec3<F> w = way * F(1.f / sqrt(select(distance2 > 0.f, distance2, F(1.f))));
  const Vec3<F> local = place.frame.to_local(w);
  Mask<F> shown = wanted & c.valid & (distance2 > 0.f) & setup.filter.reaches(c.x, c.y) &
                  at.is_consistent(w, local) & not_(at.bends(v, place.frame, -w));
  if (Bsdf::kAbsorbs) shown = shown & (dot(at.s.ng, w) > 0.f);
  if (none(shown)) return;
  const BsdfEval<F> e = at.bsdf.eval(at.bsdf.view(local), place.l);
  const F seen = place.turn(w) * c.density;
  const F others = v.path.pdf * place.found(e.pdf) * F(seen * setup.share);
  const F brightness = seen * (setup.share * setup.camera.exposure) / F(1.f + others);
  out.v.direct = clean<F>(place.flux * e.f_cos * brightness, 0.f);
  out.v.has_shadow = shown & (max_component(out.v.direct) > 0.f);
  out.v.shadow_o = at.origin(w);
  const Vec3<F> ray = c.to - out.v.shadow_o;
  const F length2 = length_squared(ray);
  const F size = sqrt(select(length2 > 0.f, length2, F(1.f)));
  out.v.shadow_d = ray * F(1.f / size);
  out.v.shadow_tfar = size * kShadowReach;
  out.x = c.x;
  out.y = c.y;
}

/// The bounce, and the ray that goes on.
template <typename Bsdf, typename F, uint32_t kFeatures, typename Place>
WAVECOMB_INLINE void scatter_flux(const Vertex<F, kFeatures>& v, const Place& place,
                                  const Sample4<F>& r, VertexResult<F>& out) {
  const auto& at = place.at;
  const BsdfSample<F> b = at.bsdf.sample(at.bsdf.view(place.l), r.x, r.y, r.z);
  const Vec3<F> d = normalize(place.frame.to_world(b.wi));
  const F turn = place.turn(d);
  const F over_pdf = turn / select(b.pdf > 0.f, b.pdf, F(1.f));
  const BsdfEval<F> e = at.bsdf.eval(at.bsdf.view(b.wi), place.l);
  Color<F> weight = e.f_cos * over_pdf;
  F ratio = place.found(e.pdf) * over_pdf;
  Mask<F> goes = v.active;
  if (any(b.is_delta)) {
    const F eta2 = b.eta * b.eta;
    const F z = abs(b.wi.z);
    const F angles = turn * F(abs(place.l.z) / select(z > 0.f, z, F(1.f)));
    weight = select<F>(b.is_delta, b.weight * F(angles * eta2), weight);
    const F by_angle = select(place.by_light_only, F(0.f), F(angles / eta2));
    ratio = select(b.is_delta, by_angle, ratio);
    goes = not_(b.is_delta & passes_one_way<Bsdf, F>(at.bsdf, place.l, b.wi));
  }
  out.next.dir = d;
  out.next.throughput = place.flux * weight;
  out.next.pdf = min(F(v.path.pdf * ratio), F(kMostRatio));
  out.next.eta_scale = v.path.eta_scale;
  out.next.receiver = v.path.receiver;
  out.next.cone_width = out.next.cone_spread = F(0.f);
  out.next.o = at.origin(d);
  const F largest = max_component(out.next.throughput);
  out.alive = place.active & goes & (b.pdf > 0.f) & at.is_consistent(d, b.wi) &
              not_(at.bends(v, place.frame, -d)) & (largest > 0.f) & is_finite(largest);
}

}  // namespace detail

/// The steps of a vertex of the active lanes' paths from lights, with program `Bsdf`. `v.hit.time`
/// is the path's, and `v.path.cone_width` the camera's.
template <typename Bsdf, typename F, uint32_t kFeatures>
WAVECOMB_INLINE LightVertexResult<F> take_light_steps(const Vertex<F, kFeatures>& v,
                                                      const LightPathSetup& setup) {
  LightVertexResult<F> out;
  out.x = out.y = F(0.f);
  out.v.direct = Color<F>(F(0.f));
  out.v.has_shadow = Mask<F>(false);
  out.v.alive = Mask<F>(false);
  if constexpr (Bsdf::kOnFibre) return out;
  const auto at = interact<Bsdf, F>(v);
  const auto place = detail::lit_place<Bsdf, F>(v, at);
  const Sample4<F> r_light =
      sample_4d<F>(v.settings.sampler, v.key, vertex_set(VertexSet::kLight, v.depth));
  detail::connect<Bsdf, F>(v, setup, place, r_light, out);
  if (v.depth + 1 >= v.settings.max_depth) return out;
  const Sample4<F> r_bsdf =
      sample_4d<F>(v.settings.sampler, v.key, vertex_set(VertexSet::kBsdf, v.depth));
  detail::scatter_flux<Bsdf, F>(v, place, r_bsdf, out.v);
  survive<F>(v, GuidePlace<F>{}, max_component(place.flux), r_light.w, out.v);
  return out;
}

/// The same as a function of its own: the reference integrator's.
template <typename Bsdf, typename F, uint32_t kFeatures>
LightVertexResult<F> shade_light_vertex(const Vertex<F, kFeatures>& v,
                                        const LightPathSetup& setup) {
  return take_light_steps<Bsdf, F>(v, setup);
}

}  // namespace wavecomb
