// SPDX-License-Identifier: Apache-2.0
/// Shading of one vertex of a light path, for both integrators.
///
/// The throughput of a light path is a flux. Let w be the direction to the camera, l the direction
/// to the light, g the geometric normal, and f the BSDF as on camera paths (f(w, l) |cos l|,
/// evaluated from w's side, with radiance scaled by the indices of refraction). A bounce from l to
/// w with density p<- changes the flux T by
///   T <- T f(w, l) |cos l| / p<-  |g w| / |g l|
/// (E. Veach, "Robust Monte Carlo Methods", 1997, section 5.3: shading normals and refraction of
/// adjoint BSDFs). The contribution of the vertex to a pixel, with the camera density G
/// (camera_connection.h), is
///   T f(w, l) |cos l|  |g w| / |g l|  G  v,   v = 1 / (1 + S (p-> + p_light) |g w| / |g l| G / N).
/// S is 1 / D at the light, and each vertex updates it:
///   S <- S p-> |g w| / (|g l| p<-);
/// the first vertex uses p-> + p_light in place of p->. S is the density of the techniques of
/// camera paths (join.h) relative to the density of the light path.
///
/// With connections between vertices, S also includes the connections at vertices closer to the
/// light, and both formulas contain (S p-> + F) in place of S p->, where
///   F = d^2 / p<-
/// for the bounce that led to this vertex over the distance d, or 0 if it was a delta. A connection
/// to a vertex of a camera path with throughput T', BSDF f' and density p->' of a bounce towards
/// this vertex contributes
///   T' f' |cos|  T f(w, l) |cos l|  |g w| / |g l|  v / d^2,
///   v = 1 / (1 + r p<- / d^2 + (S (p-> + p_light) + F) |g w| / |g l|  p->' / d^2),
/// where r is JointVertex::towards of the camera path's vertex: R p<- |g l'| / |g w'|.
///
/// Light paths are also used to estimate the noise of a render in which only camera paths sample
/// the same light. Let c be the contribution of a light path with weight v = 1 / (1 + x), where x
/// is the density of camera paths relative to light paths. Its unweighted contribution is c (1 +
/// x), and the sample of a camera path has the second moment
///   E[sum over light paths of (c (1 + x))^2 / x].
/// The contributions of light paths account for the fraction v of this moment, c^2 (1 + x) / x.
#pragma once

#include <array>

#include "wavecomb/light_paths/join.h"
#include "wavecomb/light_paths/light_path_point.h"
#include "wavecomb/light_paths/scattering.h"
#include "wavecomb/path/camera/camera_connection.h"
#include "wavecomb/path/steps/interact.h"
#include "wavecomb/path/steps/survive.h"

namespace wavecomb {

namespace detail {

/// Lower bound of the ratio of the density of camera paths to that of light paths.
inline constexpr float kMinRatio = 1e-9f;
/// Minimum cosine between the normals of a merge point and of a vertex that is merged with it.
inline constexpr float kMinNormalCosine = 0.7f;

/// Classifies the scattering towards the viewer, if light path expressions need it.
template <typename F, uint32_t kFeatures, typename PathPoint>
WAVECOMB_INLINE void record_scattering(const Vertex<F, kFeatures>& v, const PathPoint& path_point,
                                       const Viewer<F>& viewer) {
  if (v.wants_events()) [[unlikely]]
    v.aovs->light_scattering = classify_event<std::remove_cvref_t<decltype(path_point.at.bsdf)>, F>(
        path_point.at.bsdf, viewer.local, path_point.l);
}

/// Returns the value of a light splat. This is the contribution `light` or, if `camera_squares` is
/// not 0, the variance that a pixel sample would have if only camera paths sampled this light.
/// `relative_density` is the density of camera paths relative to light paths.
template <typename F>
WAVECOMB_INLINE Color<F> splat_value(const LightPathSetup& setup, const Color<F>& light,
                                     const F& relative_density) {
  if (setup.paths.camera_squares <= 0.f) [[likely]]
    return light;
  const F y = luminance<F>(light);
  const F y2 = y * F(y * F(1.f / setup.paths.camera_squares));
  return Color<F>(F(y2 * F(F(1.f + relative_density) / max(relative_density, F(kMinRatio)))));
}

/// Connects a vertex of a light path to the camera.
template <typename Bsdf, typename F, uint32_t kFeatures, typename PathPoint>
WAVECOMB_INLINE void connect_vertex_to_camera(const Vertex<F, kFeatures>& v,
                                              const LightPathSetup& setup,
                                              const PathPoint& path_point, const Sample4<F>& r,
                                              LightVertexResult<F>& out) {
  const auto& at = path_point.at;
  const Mask<F> wanted = path_point.active & at.bsdf.has_non_delta();
  if (!Bsdf::kHasNonDelta || none(wanted)) return;
  out.is_candidate = wanted;
  out.p = at.s.p;
  const CameraConnection<F> c =
      connect_to_camera<F>(setup.camera, at.s.p, r.y, r.z, v.hit.time, wanted);
  const Viewer<F> viewer = viewer_at<Bsdf, F>(
      v, path_point, c.to, Mask<F>(wanted & c.valid & setup.paths.filter->reaches(c.x, c.y)));
  if (none(viewer.is_visible)) return;
  const BsdfEval<F> e = at.bsdf.eval(at.bsdf.view(viewer.local), path_point.l);
  const F camera_factor = path_point.cosine_ratio(viewer.w) * c.density;
  const F bounce = path_point.camera_bounce(v, viewer.local, e.pdf).pdf;
  const F relative_density =
      path_point.relative_density(bounce) * F(camera_factor * setup.paths.share);
  const F brightness =
      camera_factor * (setup.paths.share * setup.camera.exposure) / F(1.f + relative_density);
  const Color<F> light = path_point.flux * e.f_cos * brightness;
  set_visibility_ray<F>(path_point, viewer, c.to, splat_value<F>(setup, light, relative_density),
                        out.v);
  out.x = c.x;
  out.y = c.y;
  record_scattering<F>(v, path_point, viewer);
}

/// Merges a vertex of a light path with nearby points that the camera sees in mirrors or through
/// glass (merge_point.h). Each lane processes its points one after the other.
template <typename Bsdf, typename F, uint32_t kFeatures, typename PathPoint>
WAVECOMB_INLINE void merge(const Vertex<F, kFeatures>& v, const LightPathSetup& setup,
                           const PathPoint& path_point) {
  using U = UInt<F>;
  constexpr size_t kLanes = kWidth<F>;
  const auto& at = path_point.at;
  const Mask<F> wanted = path_point.active & at.bsdf.has_non_delta();
  if (!Bsdf::kHasNonDelta || none(wanted)) return;
  const MergeGrid& grid = *setup.merger->grid;
  alignas(64) float x[kLanes], y[kLanes], z[kLanes], on[kLanes];
  alignas(64) uint32_t pixel[kLanes] = {};
  store(x, at.s.p.x);
  store(y, at.s.p.y);
  store(z, at.s.p.z);
  store(on, select(wanted, F(1.f), F(0.f)));
  std::array<MergeGrid::Search, kLanes> searches;
  for (size_t i = 0; i < kLanes; ++i)
    if (on[i] != 0) searches[i] = MergeGrid::Search(grid, x[i], y[i], z[i]);
  for (;;) {
    bool continues = false;
    for (size_t i = 0; i < kLanes; ++i) {
      on[i] = on[i] != 0 && searches[i].next(pixel[i]) ? 1.f : 0.f;
      continues |= on[i] != 0;
    }
    if (!continues) return;
    const Mask<F> has_point = load<F>(on) > 0.f;
    const U index = load<U>(pixel);
    const auto point = load_row<MergePoint, F>(grid.points(), index, has_point);
    const Vec3<F> local = path_point.frame.to_local(point.w);
    const F normal_cosine = abs(dot(at.s.ng, unpack_normal<F>(point.normal)));
    const Mask<F> is_visible = has_point & at.is_consistent(point.w, local) &
                               (normal_cosine > kMinNormalCosine) &
                               not_(at.is_adjusted(v, path_point.frame, -point.w)) &
                               Mask<F>(point.depth + (v.depth + 1u) <= U(v.settings.max_depth));
    if (none(is_visible)) continue;
    const BsdfEval<F> e = at.bsdf.eval(at.bsdf.view(local), path_point.l);
    const F area = F(point.radius * point.radius) * kPi;
    const F camera_factor = path_point.inverse_cos / select(is_visible, area, F(1.f));
    const F bounce = path_point.camera_bounce(v, local, e.pdf).pdf;
    const F relative_density =
        path_point.relative_density(bounce) * F(camera_factor * setup.paths.share);
    const F brightness =
        camera_factor * (setup.paths.share * setup.camera.exposure) / F(1.f + relative_density);
    const Color<F> light = path_point.flux * e.f_cos * point.light * brightness;
    const Color<F> value =
        select<F>(is_visible, clean<F>(splat_value<F>(setup, light, relative_density), 0.f),
                  Color<F>(F(0.f)));
    alignas(64) float r[kLanes], g[kLanes], b[kLanes];
    store(r, value.x);
    store(g, value.y);
    store(b, value.z);
    for (size_t i = 0; i < kLanes; ++i)
      if (on[i] != 0 && (r[i] > 0 || g[i] > 0 || b[i] > 0))
        setup.merger->film->collect(*setup.merger->splats, {pixel[i], r[i], g[i], b[i]});
  }
}

/// Connects a vertex of a light path to a vertex of a camera path.
template <typename Bsdf, typename F, uint32_t kFeatures, typename PathPoint>
WAVECOMB_INLINE void connect(const Vertex<F, kFeatures>& v, const PathPoint& path_point,
                             const ConnectionRow<F>& target, VertexResult<F>& out) {
  const auto& at = path_point.at;
  const Mask<F> wanted = path_point.active & at.bsdf.has_non_delta();
  if (!Bsdf::kHasNonDelta || none(wanted)) return;
  const Viewer<F> viewer = viewer_at<Bsdf, F>(v, path_point, target.from, wanted);
  if (none(viewer.is_visible)) return;
  const BsdfEval<F> e = at.bsdf.eval(at.bsdf.view(viewer.local), path_point.l);
  const F back = at.bsdf.eval(at.bsdf.view(path_point.l), viewer.local).pdf;
  const F inverse_distance2 = 1.f / select(viewer.is_visible, viewer.distance2, F(1.f));
  const F cosine_ratio = path_point.cosine_ratio(viewer.w) * inverse_distance2;
  const F before = min(F(target.ratio * F(back * inverse_distance2)), F(kMaxRatio));
  const F bounce = path_point.camera_bounce(v, viewer.local, e.pdf).pdf;
  const F relative_density =
      min(F(path_point.relative_density(bounce) * F(cosine_ratio * target.pdf)), F(kMaxRatio));
  const F brightness = cosine_ratio / F(F(1.f + before) + relative_density);
  set_visibility_ray<F>(path_point, viewer, target.from,
                        Color<F>(path_point.flux * e.f_cos * target.light * brightness), out);
  record_scattering<F>(v, path_point, viewer);
}

/// Samples the bounce of a light path and its next ray.
template <typename Bsdf, typename F, uint32_t kFeatures, typename PathPoint>
WAVECOMB_INLINE void scatter_flux(const Vertex<F, kFeatures>& v, const LightPathSetup& setup,
                                  const PathPoint& path_point, const Sample4<F>& r,
                                  LightVertexResult<F>& result) {
  VertexResult<F>& out = result.v;
  const LightPathState<F>& from = path_point.from;
  const bool connects = setup.paths.connects;
  const auto& at = path_point.at;
  const BsdfSample<F> b = at.bsdf.sample(at.bsdf.view(path_point.l), r.x, r.y, r.z);
  const Vec3<F> d = normalize(path_point.frame.to_world(b.wi));
  const F cosine_ratio = path_point.cosine_ratio(d);
  const F over_pdf = cosine_ratio / select(b.pdf > 0.f, b.pdf, F(1.f));
  const BsdfEval<F> e = at.bsdf.eval(at.bsdf.view(b.wi), path_point.l);
  Color<F> weight = e.f_cos * over_pdf;
  const CameraBounce<F> bounce = path_point.camera_bounce(v, b.wi, e.pdf);
  F s = from.mis_sum * F(path_point.camera_density(bounce.pdf) * over_pdf);
  if (connects) s = fma(path_point.connection_density, over_pdf, s);
  Mask<F> continues = v.active;
  if (any(b.is_delta)) {
    const F eta2 = b.eta * b.eta;
    const F z = abs(b.wi.z);
    const F angles = cosine_ratio * F(abs(path_point.l.z) / select(z > 0.f, z, F(1.f)));
    weight = select<F>(b.is_delta, b.weight * F(angles * eta2), weight);
    const F by_angle =
        select(path_point.by_light_only, F(0.f), F(F(angles / eta2) * bounce.bsdf_share));
    s = select(b.is_delta, F(from.mis_sum * by_angle), s);
    continues = not_(b.is_delta & is_asymmetric<Bsdf, F>(at.bsdf, path_point.l, b.wi));
  }
  if (v.wants_events()) [[unlikely]] {
    v.aovs->bounce =
        classify_event<std::remove_cvref_t<decltype(at.bsdf)>, F>(at.bsdf, b.wi, path_point.l);
    v.aovs->bounce.is_delta = b.is_delta;
  }
  out.next.dir = d;
  out.next.throughput = path_point.flux * weight;
  result.next = {min(s, F(kMaxRatio)), F(0.f), from.light};
  if (connects) {
    Mask<F> can_connect = not_(b.is_delta);
    if (Bsdf::kAbsorbs) can_connect = can_connect & (dot(at.s.ng, d) > 0.f);
    result.next.bounce_pdf = select(can_connect, b.pdf, F(0.f));
  }
  out.next.eta_scale = v.path.eta_scale;
  out.next.cone_width = out.next.cone_spread = F(0.f);
  out.next.o = at.clear_origin(d);
  const F largest = max_component(out.next.throughput);
  out.alive = path_point.active & continues & (b.pdf > 0.f) & at.is_consistent(d, b.wi) &
              not_(at.is_adjusted(v, path_point.frame, -d)) & (largest > 0.f) & is_finite(largest);
}

}  // namespace detail

/// Shades a vertex of the light path in each active lane with shading program `Bsdf`. `v.hit.time`
/// is the shutter time of the path, and `v.path.cone_width` is the width of a camera ray's cone at
/// the hit; `from` is the state of the light path in addition to `v.path`. If `v.aovs` needs
/// scattering events, classifies the scattering towards the viewer (`light_scattering`) and the
/// bounce (`bounce`). With a null `target`, the vertex is connected to the camera and the path
/// continues; otherwise the vertex is connected to the camera path's vertices in `target`, and
/// `v.depth` is not used.
template <typename Bsdf, typename F, uint32_t kFeatures>
WAVECOMB_INLINE LightVertexResult<F> light_path_steps(const Vertex<F, kFeatures>& v,
                                                      const LightPathState<F>& from,
                                                      const LightPathSetup& setup,
                                                      const ConnectionTarget<F>* target) {
  LightVertexResult<F> out;
  out.x = out.y = F(0.f);
  out.v.direct = Color<F>(F(0.f));
  out.v.has_shadow = Mask<F>(false);
  out.v.alive = Mask<F>(false);
  out.is_candidate = Mask<F>(false);
  if constexpr (Bsdf::kOnFibre) return out;
  const auto at = interact<Bsdf, F>(v);
  const auto path_point = detail::light_path_point<Bsdf, F>(
      v, at, from, setup.paths.connects, target ? target->is_first : Mask<F>(v.depth == 0));
  if (target) [[unlikely]] {
    detail::connect<Bsdf, F>(v, path_point, target->row, out.v);
    return out;
  }
  const Sample4<F> r_light = v.sample(VertexSet::kLight);
  detail::connect_vertex_to_camera<Bsdf, F>(v, setup, path_point, r_light, out);
  if (setup.merger) [[unlikely]]
    detail::merge<Bsdf, F>(v, setup, path_point);
  if (v.depth + 1 >= v.settings.max_depth) return out;
  const Sample4<F> r_bsdf = v.sample(VertexSet::kBsdf);
  detail::scatter_flux<Bsdf, F>(v, setup, path_point, r_bsdf, out);
  survive<F>(v, GuidingLookup<F>{}, max_component(path_point.flux), r_light.w, out.v);
  return out;
}

/// Runs light_path_steps() without inlining, for the reference integrator.
template <typename Bsdf, typename F, uint32_t kFeatures>
LightVertexResult<F> shade_light_vertex(const Vertex<F, kFeatures>& v,
                                        const LightPathState<F>& from, const LightPathSetup& setup,
                                        const ConnectionTarget<F>* target) {
  return light_path_steps<Bsdf, F>(v, from, setup, target);
}

}  // namespace wavecomb
