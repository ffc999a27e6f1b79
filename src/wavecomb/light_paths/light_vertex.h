// SPDX-License-Identifier: Apache-2.0
/// Shading of one vertex of a light path. The wave and the reference integrator share it.
///
/// A light path carries flux. Let w be the direction to the camera, l the direction to the light, g
/// the geometric normal, and f the BSDF as on camera paths (f(w, l) |cos l|, evaluated from w's
/// side, with radiance scaled by the indices of refraction). A bounce l -> w with density p<-
/// changes the flux T by
///   T <- T f(w, l) |cos l| / p<-  |g w| / |g l|
/// (E. Veach, "Robust Monte Carlo Methods", 1997, section 5.3: shading normals and refraction of
/// adjoint BSDFs). The contribution of the vertex to a pixel, with the camera density G
/// (camera_connection.h), is
///   T f(w, l) |cos l|  |g w| / |g l|  G  v,   v = 1 / (1 + S (p-> + p_light) |g w| / |g l| G / N).
/// S is 1 / D at the light, and each vertex multiplies it:
///   S <- S p-> |g w| / (|g l| p<-);   the first one with p-> + p_light in place of p->.
/// S is the density of the camera's techniques (light_paths/join.h) relative to this one.
///
/// With connections between vertices, S also sums over the connections closer to the light, and
/// both formulas have (S p-> + F) in place of S p->, with
///   F = d^2 / p<-   of the bounce that led here over the distance d, or 0 if it was a delta.
/// A connection to a vertex of a camera path with throughput T', BSDF f' and density p->' of a
/// bounce towards this vertex contributes
///   T' f' |cos|  T f(w, l) |cos l|  |g w| / |g l|  v / d^2,
///   v = 1 / (1 + r p<- / d^2 + (S (p-> + p_light) + F) |g w| / |g l|  p->' / d^2),
/// where r is JointVertex::towards of the camera path's vertex: R p<- |g l'| / |g w'|.
///
/// Light paths also predict the noise of camera paths that would have to find the same light alone.
/// Let c be the contribution of a light path with weight v = 1 / (1 + x), where x is the density of
/// camera paths relative to light paths. Its unweighted contribution is c (1 + x), and the sample
/// of a camera path has the second moment
///   E[sum over light paths of (c (1 + x))^2 / x].
/// The fraction v of it that belongs to light paths is c^2 (1 + x) / x.
#pragma once

#include <array>

#include "wavecomb/light/emission/emission.h"
#include "wavecomb/light_paths/camera_connection.h"
#include "wavecomb/light_paths/connection.h"
#include "wavecomb/light_paths/light_path.h"
#include "wavecomb/path/steps/note_events.h"
#include "wavecomb/path/vertex.h"

namespace wavecomb {

namespace detail {

/// Lower bound for the density of camera paths relative to light paths.
inline constexpr float kLeastRatio = 1e-9f;
/// Least cosine between the normals of a visible point and of a vertex that is merged with it.
inline constexpr float kLeastAlike = 0.7f;

/// Shading point of a light path, with the direction that the light arrives from.
template <typename Bsdf, typename F, typename Interaction>
struct LitPlace {
  const Interaction& at;
  Frame<F> frame;
  Vec3<F> l;  ///< local direction to the light, computed as a connection (light_paths/connection.h)
  F inverse_cos;          ///< 1 / |g l|
  Color<F> flux;          ///< flux that arrives
  F linked;               ///< F, see above
  F sampled;              ///< p_light at the first vertex, else 0
  Mask<F> by_light_only;  ///< lanes with a light that bounces cannot hit
  Mask<F> active;

  /// Returns |g w| / |g l| for a world direction.
  F turn(const Vec3<F>& w) const { return abs(dot(at.s.ng, w)) * inverse_cos; }
  /// Returns p-> + p_light, where `bounce` is p->.
  F found(const F& bounce) const { return select(by_light_only, F(0.f), bounce) + sampled; }
  /// Returns S (p-> + p_light) + F, where `s` is S before this vertex.
  F others(const F& s, const F& bounce) const { return s * found(bounce) + linked; }
};

template <typename Bsdf, typename F, uint32_t kFeatures, typename Interaction>
WAVECOMB_INLINE LitPlace<Bsdf, F, Interaction> lit_place(const Vertex<F, kFeatures>& v,
                                                         const Interaction& at,
                                                         const Mask<F>& is_first) {
  const Vec3<F> back = -v.path.dir;
  const F cosine = abs(dot(at.s.ng, back));
  // Direction to the origin of the flux, as a bounce of a camera path would reach it.
  Connection<F> c = connect_to_point<F>(at, v.path.o);
  const Mask<F> afar = is_first & Mask<F>(v.path.light < UInt<F>(v.scene.lights.infinite_count));
  c.o = select<F>(afar, at.origin(back), c.o);
  c.d = select<F>(afar, back, c.d);
  const F distance = select(afar, v.t, sqrt(c.distance2));
  LitPlace<Bsdf, F, Interaction> place{at,
                                       at.unbent_frame(v),
                                       {},
                                       F(1.f / select(cosine > 0.f, cosine, F(1.f))),
                                       select<F>(is_first, v.path.throughput, at.throughput),
                                       F(0.f),
                                       F(0.f),
                                       Mask<F>(false),
                                       Mask<F>(false)};
  place.l = place.frame.to_local(c.d);
  place.active = v.active & (cosine > 0.f) & (afar | c.valid) & at.is_consistent(c.d, place.l);
  if (const Mask<F> first = place.active & is_first; any(first)) {
    LightReceiver<F> receiver(c.o);
    if (v.scene.lights.by_tree && !Bsdf::kTransmits)
      receiver.normal = pack_normal<F>(select<F>(place.l.z < 0.f, -place.frame.n, place.frame.n));
    const LightReach<F> reach =
        light_reach<F>(v.scene.lights, v.path.light, receiver, c.d, distance, first);
    // Vertices that have only delta lobes do not sample lights.
    place.sampled = select(first & at.bsdf.has_non_delta(), reach.density, F(0.f));
    place.by_light_only = first & reach.is_delta;
  }
  if (v.settings.connects) {
    const Mask<F> links = place.active & (v.path.bounce_pdf > 0.f);
    const F linked = F(distance * distance) / select(links, v.path.bounce_pdf, F(1.f));
    place.linked = select(links, min(linked, F(kMostRatio)), F(0.f));
  }
  return place;
}

/// Viewer of a vertex: the direction from the vertex to the viewer, and whether the vertex scatters
/// towards it.
template <typename F>
struct Looker {
  Vec3<F> w, local;
  F distance2;
  Mask<F> sees;
};

template <typename Bsdf, typename F, uint32_t kFeatures, typename Place>
WAVECOMB_INLINE Looker<F> looker_at(const Vertex<F, kFeatures>& v, const Place& place,
                                    const Vec3<F>& to, const Mask<F>& wanted) {
  const auto& at = place.at;
  Looker<F> out;
  const Vec3<F> way = to - at.s.p;
  out.distance2 = length_squared(way);
  out.w = way * F(1.f / sqrt(select(out.distance2 > 0.f, out.distance2, F(1.f))));
  out.local = place.frame.to_local(out.w);
  out.sees = wanted & (out.distance2 > 0.f) & at.is_consistent(out.w, out.local) &
             not_(at.bends(v, place.frame, -out.w));
  if (Bsdf::kAbsorbs) out.sees = out.sees & (dot(at.s.ng, out.w) > 0.f);
  return out;
}

/// Sets up the shadow ray towards the viewer at `to`, which carries the contribution `light`.
template <typename F, typename Place>
WAVECOMB_INLINE void ask_whether_seen(const Place& place, const Looker<F>& looker,
                                      const Vec3<F>& to, const Color<F>& light,
                                      VertexResult<F>& out) {
  out.direct = clean<F>(light, 0.f);
  out.has_shadow = looker.sees & (max_component(out.direct) > 0.f);
  out.shadow_o = place.at.light_path_origin(looker.w);
  const Vec3<F> ray = to - out.shadow_o;
  const F length2 = length_squared(ray);
  const F size = sqrt(select(length2 > 0.f, length2, F(1.f)));
  out.shadow_d = ray * F(1.f / size);
  out.shadow_tfar = size * kShadowReach;
}

/// Classifies the scattering towards the viewer, if light path expressions need it.
template <typename F, uint32_t kFeatures, typename Place>
WAVECOMB_INLINE void note_shown(const Vertex<F, kFeatures>& v, const Place& place,
                                const Looker<F>& looker) {
  if (v.wants_events()) [[unlikely]]
    v.aovs->lit = note_event<std::remove_cvref_t<decltype(place.at.bsdf)>, F>(
        place.at.bsdf, looker.local, place.l);
}

/// Returns the value of a light splat: its contribution `light` or, with camera_squares, the
/// addition to the variance of camera paths. `others` is the density of camera paths relative to
/// light paths.
template <typename F>
WAVECOMB_INLINE Color<F> shown_light(const LightPathSetup& setup, const Color<F>& light,
                                     const F& others) {
  if (setup.camera_squares <= 0.f) [[likely]]
    return light;
  const F y = luminance<F>(light);
  const F y2 = y * F(y * F(1.f / setup.camera_squares));
  return Color<F>(F(y2 * F(F(1.f + others) / max(others, F(kLeastRatio)))));
}

/// Connects the vertex to the camera.
template <typename Bsdf, typename F, uint32_t kFeatures, typename Place>
WAVECOMB_INLINE void show_to_camera(const Vertex<F, kFeatures>& v, const LightPathSetup& setup,
                                    const Place& place, const Sample4<F>& r,
                                    LightVertexResult<F>& out) {
  const auto& at = place.at;
  const Mask<F> wanted = place.active & at.bsdf.has_non_delta();
  if (!Bsdf::kHasNonDelta || none(wanted)) return;
  out.offered = wanted;
  out.p = at.s.p;
  const CameraConnection<F> c =
      connect_to_camera<F>(setup.camera, at.s.p, r.y, r.z, v.hit.time, wanted);
  const Looker<F> looker = looker_at<Bsdf, F>(
      v, place, c.to, Mask<F>(wanted & c.valid & setup.filter.reaches(c.x, c.y)));
  if (none(looker.sees)) return;
  const BsdfEval<F> e = at.bsdf.eval(at.bsdf.view(looker.local), place.l);
  const F seen = place.turn(looker.w) * c.density;
  const F others = place.others(v.path.mis_sum, e.pdf) * F(seen * setup.share);
  const F brightness = seen * (setup.share * setup.camera.exposure) / F(1.f + others);
  const Color<F> light = place.flux * e.f_cos * brightness;
  ask_whether_seen<F>(place, looker, c.to, shown_light<F>(setup, light, others), out.v);
  out.x = c.x;
  out.y = c.y;
  note_shown<F>(v, place, looker);
}

/// Merges the path with nearby points that the camera sees in mirrors and through glass
/// (merge_point.h). Each lane handles one point at a time.
template <typename Bsdf, typename F, uint32_t kFeatures, typename Place>
WAVECOMB_INLINE void merge(const Vertex<F, kFeatures>& v, const LightPathSetup& setup,
                           const Place& place) {
  using U = UInt<F>;
  constexpr size_t kLanes = kWidth<F>;
  const auto& at = place.at;
  const Mask<F> wanted = place.active & at.bsdf.has_non_delta();
  if (!Bsdf::kHasNonDelta || none(wanted)) return;
  const VisibleGrid& grid = *setup.merger->grid;
  alignas(64) float x[kLanes], y[kLanes], z[kLanes], on[kLanes];
  alignas(64) uint32_t pixel[kLanes] = {};
  store(x, at.s.p.x);
  store(y, at.s.p.y);
  store(z, at.s.p.z);
  store(on, select(wanted, F(1.f), F(0.f)));
  std::array<VisibleGrid::Search, kLanes> searches;
  for (size_t i = 0; i < kLanes; ++i)
    if (on[i] != 0) searches[i] = VisibleGrid::Search(grid, x[i], y[i], z[i]);
  for (;;) {
    bool goes_on = false;
    for (size_t i = 0; i < kLanes; ++i) {
      on[i] = on[i] != 0 && searches[i].next(pixel[i]) ? 1.f : 0.f;
      goes_on |= on[i] != 0;
    }
    if (!goes_on) return;
    const Mask<F> found = load<F>(on) > 0.f;
    const U index = load<U>(pixel);
    const auto point = load_row<VisiblePoint, F>(grid.points(), index, found);
    const Vec3<F> local = place.frame.to_local(point.w);
    const F turned = abs(dot(at.s.ng, unpack_normal<F>(point.normal)));
    const Mask<F> sees = found & at.is_consistent(point.w, local) & (turned > kLeastAlike) &
                         not_(at.bends(v, place.frame, -point.w)) &
                         Mask<F>(point.depth + (v.depth + 1u) <= U(v.settings.max_depth));
    if (none(sees)) continue;
    const BsdfEval<F> e = at.bsdf.eval(at.bsdf.view(local), place.l);
    const F area = F(point.radius * point.radius) * kPi;
    const F seen = place.inverse_cos / select(sees, area, F(1.f));
    const F others = place.others(v.path.mis_sum, e.pdf) * F(seen * setup.share);
    const F brightness = seen * (setup.share * setup.camera.exposure) / F(1.f + others);
    const Color<F> light = place.flux * e.f_cos * point.light * brightness;
    const Color<F> shown =
        select<F>(sees, clean<F>(shown_light<F>(setup, light, others), 0.f), Color<F>(F(0.f)));
    alignas(64) float r[kLanes], g[kLanes], b[kLanes];
    store(r, shown.x);
    store(g, shown.y);
    store(b, shown.z);
    for (size_t i = 0; i < kLanes; ++i)
      if (on[i] != 0 && (r[i] > 0 || g[i] > 0 || b[i] > 0))
        setup.merger->film->collect(*setup.merger->splats, {pixel[i], r[i], g[i], b[i]});
  }
}

/// Connects the vertex to a vertex of a camera path.
template <typename Bsdf, typename F, uint32_t kFeatures, typename Place>
WAVECOMB_INLINE void connect(const Vertex<F, kFeatures>& v, const Place& place,
                             const ConnectionRow<F>& target, VertexResult<F>& out) {
  const auto& at = place.at;
  const Mask<F> wanted = place.active & at.bsdf.has_non_delta();
  if (!Bsdf::kHasNonDelta || none(wanted)) return;
  const Looker<F> looker = looker_at<Bsdf, F>(v, place, target.from, wanted);
  if (none(looker.sees)) return;
  const BsdfEval<F> e = at.bsdf.eval(at.bsdf.view(looker.local), place.l);
  const F back = at.bsdf.eval(at.bsdf.view(place.l), looker.local).pdf;
  const F nearness = 1.f / select(looker.sees, looker.distance2, F(1.f));
  const F turn = place.turn(looker.w) * nearness;
  const F before = min(F(target.ratio * F(back * nearness)), F(kMostRatio));
  const F others =
      min(F(place.others(v.path.mis_sum, e.pdf) * F(turn * target.pdf)), F(kMostRatio));
  const F brightness = turn / F(F(1.f + before) + others);
  ask_whether_seen<F>(place, looker, target.from,
                      Color<F>(place.flux * e.f_cos * target.light * brightness), out);
  note_shown<F>(v, place, looker);
}

/// Samples the bounce and the next ray.
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
  F s = v.path.mis_sum * F(place.found(e.pdf) * over_pdf);
  if (v.settings.connects) s = fma(place.linked, over_pdf, s);
  Mask<F> goes = v.active;
  if (any(b.is_delta)) {
    const F eta2 = b.eta * b.eta;
    const F z = abs(b.wi.z);
    const F angles = turn * F(abs(place.l.z) / select(z > 0.f, z, F(1.f)));
    weight = select<F>(b.is_delta, b.weight * F(angles * eta2), weight);
    const F by_angle = select(place.by_light_only, F(0.f), F(angles / eta2));
    s = select(b.is_delta, F(v.path.mis_sum * by_angle), s);
    goes = not_(b.is_delta & passes_one_way<Bsdf, F>(at.bsdf, place.l, b.wi));
  }
  if (v.wants_events()) [[unlikely]] {
    v.aovs->bounce = note_event<std::remove_cvref_t<decltype(at.bsdf)>, F>(at.bsdf, b.wi, place.l);
    v.aovs->bounce.is_delta = b.is_delta;
  }
  out.next.dir = d;
  out.next.throughput = place.flux * weight;
  out.next.mis_sum = min(s, F(kMostRatio));
  out.next.bounce_pdf = F(0.f);
  if (v.settings.connects) {
    Mask<F> may_look = not_(b.is_delta);
    if (Bsdf::kAbsorbs) may_look = may_look & (dot(at.s.ng, d) > 0.f);
    out.next.bounce_pdf = select(may_look, b.pdf, F(0.f));
  }
  out.next.eta_scale = v.path.eta_scale;
  out.next.light = v.path.light;
  out.next.cone_width = out.next.cone_spread = F(0.f);
  out.next.o = at.light_path_origin(d);
  const F largest = max_component(out.next.throughput);
  out.alive = place.active & goes & (b.pdf > 0.f) & at.is_consistent(d, b.wi) &
              not_(at.bends(v, place.frame, -d)) & (largest > 0.f) & is_finite(largest);
}

}  // namespace detail

/// Runs the steps of a vertex of the active lanes' light paths, with shading program `Bsdf`.
/// `v.hit.time` is the shutter time of the path, and `v.path.cone_width` is the width of a camera
/// ray's cone at the hit. If `v.aovs` wants events, classifies the scattering towards the viewer
/// (`lit`) and of the bounce (`bounce`). With a null `target`, the vertex is connected to the
/// camera and the path continues; otherwise it is connected to the camera path's vertices in
/// `target`, and `v.depth` has no meaning.
template <typename Bsdf, typename F, uint32_t kFeatures>
WAVECOMB_INLINE LightVertexResult<F> take_light_steps(const Vertex<F, kFeatures>& v,
                                                      const LightPathSetup& setup,
                                                      const ConnectionTarget<F>* target) {
  LightVertexResult<F> out;
  out.x = out.y = F(0.f);
  out.v.direct = Color<F>(F(0.f));
  out.v.has_shadow = Mask<F>(false);
  out.v.alive = Mask<F>(false);
  out.offered = Mask<F>(false);
  if constexpr (Bsdf::kOnFibre) return out;
  const auto at = interact<Bsdf, F>(v);
  const auto place =
      detail::lit_place<Bsdf, F>(v, at, target ? target->is_first : Mask<F>(v.depth == 0));
  if (target) [[unlikely]] {
    detail::connect<Bsdf, F>(v, place, target->row, out.v);
    return out;
  }
  const Sample4<F> r_light =
      sample_4d<F>(v.settings.sampler, v.key, vertex_set(VertexSet::kLight, v.depth));
  detail::show_to_camera<Bsdf, F>(v, setup, place, r_light, out);
  if (setup.merger) [[unlikely]]
    detail::merge<Bsdf, F>(v, setup, place);
  if (v.depth + 1 >= v.settings.max_depth) return out;
  const Sample4<F> r_bsdf =
      sample_4d<F>(v.settings.sampler, v.key, vertex_set(VertexSet::kBsdf, v.depth));
  detail::scatter_flux<Bsdf, F>(v, place, r_bsdf, out.v);
  survive<F>(v, GuidePlace<F>{}, max_component(place.flux), r_light.w, out.v);
  return out;
}

/// Runs take_light_steps() without inlining, for the reference integrator.
template <typename Bsdf, typename F, uint32_t kFeatures>
LightVertexResult<F> shade_light_vertex(const Vertex<F, kFeatures>& v, const LightPathSetup& setup,
                                        const ConnectionTarget<F>* target) {
  return take_light_steps<Bsdf, F>(v, setup, target);
}

}  // namespace wavecomb
