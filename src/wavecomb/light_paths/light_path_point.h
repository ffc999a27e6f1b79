// SPDX-License-Identifier: Apache-2.0
/// Shading point of a light path, and the viewers (the camera, or vertices of camera paths) to
/// which it is connected. The notation is that of light_vertex.h.
#pragma once

#include "wavecomb/light/emission/emission.h"
#include "wavecomb/light_paths/camera_density.h"
#include "wavecomb/light_paths/connection.h"
#include "wavecomb/light_paths/join.h"
#include "wavecomb/light_paths/light_path.h"
#include "wavecomb/path/steps/interact.h"

namespace wavecomb {

namespace detail {

/// Shading point of a light path, with the direction from which light arrives.
template <typename Bsdf, typename F, typename Interaction>
struct LightPathPoint {
  const Interaction& at;
  const LightPathState<F>& from;  ///< state of the light path before the vertex
  Frame<F> frame;
  Vec3<F> l;      ///< direction to the light in the shading frame (see light_paths/connection.h)
  F inverse_cos;  ///< 1 / |g l|
  Color<F> flux;  ///< flux that arrives at the vertex
  F connection_density;   ///< term F = d^2 / p<- (light_vertex.h)
  F sampled;              ///< density of light samples at the first vertex; 0 at later vertices
  Mask<F> by_light_only;  ///< lanes with a light that bounces cannot hit
  Mask<F> active;

  /// Returns the ratio |g w| / |g l| of cosines for a world direction w.
  F cosine_ratio(const Vec3<F>& w) const { return abs(dot(at.s.ng, w)) * inverse_cos; }
  /// Returns the density of camera paths, where `bounce` is the density of their bounces.
  F camera_density(const F& bounce) const {
    return select(by_light_only, F(0.f), bounce) + sampled;
  }
  /// Returns the density of camera paths relative to light paths, S (p-> + p_light) + F.
  F relative_density(const F& bounce) const {
    return from.mis_sum * camera_density(bounce) + connection_density;
  }
  /// Returns the density of bounces of camera paths from `w` in the shading frame to the light.
  /// `p_bsdf` is the density of the BSDF for this bounce.
  template <uint32_t kFeatures>
  WAVECOMB_INLINE CameraBounce<F> camera_bounce(const Vertex<F, kFeatures>& v, const Vec3<F>& w,
                                                const F& p_bsdf) const {
    return wavecomb::camera_bounce<Bsdf, F>(v, at, frame, w, l, p_bsdf);
  }
};

template <typename Bsdf, typename F, uint32_t kFeatures, typename Interaction>
WAVECOMB_INLINE LightPathPoint<Bsdf, F, Interaction> light_path_point(const Vertex<F, kFeatures>& v,
                                                                      const Interaction& at,
                                                                      const LightPathState<F>& from,
                                                                      bool connects,
                                                                      const Mask<F>& is_first) {
  const Vec3<F> back = -v.path.dir;
  const F cosine = abs(dot(at.s.ng, back));
  // Use the ray along which a bounce of a camera path would hit the previous vertex.
  Connection<F> c = connect_to_point<F>(at, v.path.o);
  const Mask<F> from_infinite =
      is_first & Mask<F>(from.light < UInt<F>(v.scene.lights.infinite_count));
  c.o = select<F>(from_infinite, at.origin(back), c.o);
  c.d = select<F>(from_infinite, back, c.d);
  const F distance = select(from_infinite, v.t, sqrt(c.distance2));
  LightPathPoint<Bsdf, F, Interaction> path_point{at,
                                                  from,
                                                  at.unadjusted_frame(v),
                                                  {},
                                                  F(1.f / select(cosine > 0.f, cosine, F(1.f))),
                                                  flux_at<Bsdf, F>(v, at, is_first),
                                                  F(0.f),
                                                  F(0.f),
                                                  Mask<F>(false),
                                                  Mask<F>(false)};
  path_point.l = path_point.frame.to_local(c.d);
  path_point.active =
      v.active & (cosine > 0.f) & (from_infinite | c.valid) & at.is_consistent(c.d, path_point.l);
  if (const Mask<F> first = path_point.active & is_first; any(first)) {
    LightReceiver<F> receiver(c.o);
    if (v.scene.lights.by_tree && !Bsdf::kTransmits)
      receiver.normal =
          pack_normal<F>(select<F>(path_point.l.z < 0.f, -path_point.frame.n, path_point.frame.n));
    const CameraPathDensity<F> reach =
        camera_path_density<F>(v.scene.lights, from.light, receiver, c.d, distance, first);
    // Camera paths take no light samples at vertices that have only delta lobes.
    path_point.sampled = select(first & at.bsdf.has_non_delta(), reach.density, F(0.f));
    path_point.by_light_only = first & reach.is_delta;
  }
  if (connects) {
    const Mask<F> can_connect_back = path_point.active & (from.bounce_pdf > 0.f);
    const F connection_density =
        F(distance * distance) / select(can_connect_back, from.bounce_pdf, F(1.f));
    path_point.connection_density =
        select(can_connect_back, min(connection_density, F(kMaxRatio)), F(0.f));
  }
  return path_point;
}

/// Viewer of a vertex: the direction from the vertex to the viewer, and whether the vertex scatters
/// light towards the viewer.
template <typename F>
struct Viewer {
  Vec3<F> w, local;
  F distance2;
  Mask<F> is_visible;
};

template <typename Bsdf, typename F, uint32_t kFeatures, typename PathPoint>
WAVECOMB_INLINE Viewer<F> viewer_at(const Vertex<F, kFeatures>& v, const PathPoint& path_point,
                                    const Vec3<F>& to, const Mask<F>& wanted) {
  const auto& at = path_point.at;
  Viewer<F> out;
  const Vec3<F> offset = to - at.s.p;
  out.distance2 = length_squared(offset);
  out.w = offset * F(1.f / sqrt(select(out.distance2 > 0.f, out.distance2, F(1.f))));
  out.local = path_point.frame.to_local(out.w);
  out.is_visible = wanted & (out.distance2 > 0.f) & at.is_consistent(out.w, out.local) &
                   not_(at.is_adjusted(v, path_point.frame, -out.w));
  if (Bsdf::kAbsorbs) out.is_visible = out.is_visible & (dot(at.s.ng, out.w) > 0.f);
  return out;
}

/// Sets up the shadow ray towards the viewer at `to`, for the contribution `light`.
template <typename F, typename PathPoint>
WAVECOMB_INLINE void set_visibility_ray(const PathPoint& path_point, const Viewer<F>& viewer,
                                        const Vec3<F>& to, const Color<F>& light,
                                        VertexResult<F>& out) {
  out.direct = clean<F>(light, 0.f);
  out.has_shadow = viewer.is_visible & (max_component(out.direct) > 0.f);
  out.shadow_o = path_point.at.clear_origin(viewer.w);
  const Vec3<F> ray = to - out.shadow_o;
  const F length2 = length_squared(ray);
  const F size = sqrt(select(length2 > 0.f, length2, F(1.f)));
  out.shadow_d = ray * F(1.f / size);
  out.shadow_tfar = size * kShadowRayFraction;
}

}  // namespace detail

}  // namespace wavecomb
