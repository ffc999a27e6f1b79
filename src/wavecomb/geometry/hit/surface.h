// SPDX-License-Identifier: Apache-2.0
/// Shading points of hits.
#pragma once

#include <array>

#include "wavecomb/geometry/hit/curve_surface.h"
#include "wavecomb/geometry/hit/shading_normal.h"
#include "wavecomb/geometry/hit/surface_reader.h"
#include "wavecomb/geometry/hit/tangent.h"
#include "wavecomb/geometry/hit/uv.h"

namespace wavecomb {

namespace detail {

/// Hit point on a triangle in object space.
template <typename F>
struct TrianglePoint {
  std::array<UInt<F>, 3> i;    ///< vertices
  Vec3<F> p0, p1, p2, e1, e2;  ///< positions of the vertices, and edges from the first vertex
  Vec3<F> p;                   ///< hit point
  F b0, b1, b2;                ///< barycentrics
  /// Twice the triangle's area in world space; 1 for degenerate triangles.
  F safe_area2;
};

/// Returns an upper bound of the rounding error of a hit point. The bound is a weighted sum of the
/// magnitudes of two kinds of terms: the summands of the interpolated point and, with a smaller
/// weight, the triangle's corners, from which traversal subtracts the ray's origin. All axes share
/// one bound, since the errors of the cross products in traversal depend on several axes.
template <typename F>
WAVECOMB_INLINE F rounding_offset(const InstanceMaps<F>& maps, const TrianglePoint<F>& at) {
  const Vec3<F> q0 = abs3(at.p0), q1 = abs3(at.p1), q2 = abs3(at.p2);
  const Vec3<F> size =
      (q0 * abs(at.b0) + q1 * at.b1 + q2 * at.b2) + max(q0, max(q1, q2)) * F(0.25f);
  const auto magnitude = [&](int i, const F& t) { return dot(abs3(maps.row[i]), size) + abs(t); };
  return max(max(magnitude(0, maps.t.x), magnitude(1, maps.t.y)), magnitude(2, maps.t.z)) *
         0x1p-20f;
}

/// Lanes with interpolated normals, and whether to compute the terminator vectors of these lanes.
template <typename F>
struct SmoothLanes {
  const Mask<F>& smooth;
  bool with_terminator;
};

/// Normals of a triangle's corners in object space.
template <typename F>
struct CornerNormals {
  Vec3<F> n0, n1, n2;

  /// Reads the normals of vertices or corners; `corners` are the indices of the vertices.
  template <bool kWithMotion>
  static WAVECOMB_INLINE CornerNormals read(const SceneView& scene, const MeshHit<F>& hit,
                                            const MeshReader<F>& mesh,
                                            const std::array<UInt<F>, 3>& corners,
                                            const Mask<F>& smooth) {
    using U = UInt<F>;
    const Mask<U> selected(Mask<F>((mesh.flags & kNormalsPerCorner) != U(0u)));
    const U corner = hit.prim * 3u;
    const U a0 = select(selected, corner, corners[0]),
            a1 = select(selected, U(corner + 1u), corners[1]),
            a2 = select(selected, U(corner + 2u), corners[2]);
    if (kWithMotion && scene.has_motion) [[unlikely]] {
      const auto moved = moved_normals<F>(scene, hit.mesh, {a0, a1, a2}, hit.time, smooth);
      return {moved[0], moved[1], moved[2]};
    }
    return {mesh.vec3(&MeshRecord::normals, a0, smooth),
            mesh.vec3(&MeshRecord::normals, a1, smooth),
            mesh.vec3(&MeshRecord::normals, a2, smooth)};
  }

  /// Returns the interpolated normal in world space, of any length.
  Vec3<F> at(const InstanceMaps<F>& maps, const F& b0, const F& b1, const F& b2) const {
    return maps.map_normal(fma(n2, b2, fma(n1, b1, Vec3<F>(n0 * b0))));
  }
};

/// Returns the lanes whose meshes have normals to interpolate.
template <typename F>
inline Mask<F> has_normals(const MeshReader<F>& mesh) {
  return Mask<F>((mesh.flags & (kNormalsPerVertex | kNormalsPerCorner)) != UInt<F>(0u));
}

/// Sets the shading normal ns from the normals of vertices or corners, and sets the terminator
/// vector.
template <bool kWithMotion, typename F>
WAVECOMB_INLINE void set_smooth_normal(const SceneView& scene, const MeshHit<F>& hit,
                                       const MeshReader<F>& mesh, const InstanceMaps<F>& maps,
                                       const TrianglePoint<F>& at, const SmoothLanes<F>& lanes,
                                       Surface<F>& s) {
  const auto& [smooth, with_terminator] = lanes;
  const auto normals = CornerNormals<F>::template read<kWithMotion>(scene, hit, mesh, at.i, smooth);
  const auto& [n0, n1, n2] = normals;
  const Vec3<F> n = normals.at(maps, at.b0, at.b1, at.b2);
  const F len2 = length_squared(n);
  const Mask<F> valid = smooth & (len2 > 0.f) & is_finite(len2);
  Vec3<F> ns = n * F(1.f / sqrt(select(valid, len2, F(1.f))));
  const F side = dot(ns, s.ng);
  ns = select<F>(side < 0.f, -ns, ns);
  s.ns = select<F>(valid, ns, s.ng);

  if (with_terminator) {
    // Project p to the tangent planes at the three vertices and interpolate the projections,
    // ignoring projections to the back side.
    const auto lift = [&](const Vec3<F>& q, const Vec3<F>& vertex_normal) {
      const F n2len = length_squared(vertex_normal);
      const F h = dot(Vec3<F>(at.p - q), vertex_normal) / select(n2len > 0.f, n2len, F(1.f));
      return vertex_normal * min(h, F(0.f));
    };
    const Vec3<F> d = lift(at.p0, n0) * at.b0 + lift(at.p1, n1) * at.b1 + lift(at.p2, n2) * at.b2;
    const Vec3<F> world = -maps.vector(d);
    const Mask<F> outward = valid & (side > 0.f) & (dot(world, s.ng) > 0.f);
    s.terminator = select<F>(outward, world, Vec3<F>(F(0.f)));
  }
}

/// Sets the members uv, dpdu, uv_per_length and handedness of a shading point.
template <typename F>
WAVECOMB_INLINE void set_triangle_uv(const SceneView& scene, const MeshHit<F>& hit,
                                     const MeshReader<F>& mesh, const InstanceMaps<F>& maps,
                                     const TrianglePoint<F>& at, const Mask<F>& active,
                                     Surface<F>& s) {
  const UvTriangle<F> t = uv_triangle<F>(mesh, {at.i[0], at.i[1], at.i[2]}, hit.prim, active);
  const Vec2<F>&d1 = t.d1, &d2 = t.d2;
  s.uv = t.at(at.b1, at.b2);
  const F det = fma(d1.x, d2.y, F(-(d1.y * d2.x)));
  s.uv_per_length = sqrt(F(abs(det) / at.safe_area2));
  const Mask<F> mirrored = det < 0.f;
  s.handedness = select(mirrored, F(-maps.side), maps.side);
  // dp/du = (d2.v e1 - d1.v e2) / det. The direction of dp/du is used, but not its length.
  const Vec3<F> across = at.e1 * d2.y - at.e2 * d1.y;
  Vec3<F> tangent = select<F>(mirrored, -across, across);
  // Pass a copy of the vertex indices, so that the original values can stay in registers.
  if (scene.tangents)
    tangent = smooth_tangent<F>(scene, hit, {at.i[0], at.i[1], at.i[2]}, tangent, active);
  s.dpdu = maps.vector(tangent);
}

/// Computes setup_surface(). `kIsGeneral` may be false for scenes without curves and motion.
template <typename F, bool kIsGeneral>
WAVECOMB_INLINE Surface<F> compute_surface(const SceneView& scene, const MeshHit<F>& hit,
                                           const Vec3<F>& dir, bool with_uv, bool with_terminator,
                                           const Mask<F>& lanes) {
  Mask<F> active = lanes;
  if (kIsGeneral && scene.has_curves) active = active & not_(is_curved<F>(scene, hit.mesh, lanes));
  const MeshReader<F> mesh(scene.meshes, hit.mesh, active);
  InstanceMaps<F> maps(scene.instances, hit.inst, active);
  const auto [i0, i1, i2] = mesh.corners(hit.prim, active);
  Vec3<F> p0 = mesh.vec3(&MeshRecord::positions, i0, active);
  Vec3<F> p1 = mesh.vec3(&MeshRecord::positions, i1, active);
  Vec3<F> p2 = mesh.vec3(&MeshRecord::positions, i2, active);
  F moved_size(0.f);
  if (kIsGeneral && scene.has_motion) [[unlikely]] {
    const MovedTriangle<F> moved =
        moved_triangle<F>(scene, hit.inst, hit.mesh, {i0, i1, i2}, hit.time, maps, active);
    p0 = moved.p[0];
    p1 = moved.p[1];
    p2 = moved.p[2];
    maps.set_instance(moved.instance);
    moved_size = moved.instance.size;
  }
  const F b1 = hit.u, b2 = hit.v, b0 = 1.f - b1 - b2;
  const Vec3<F> e1 = p1 - p0, e2 = p2 - p0;
  const Vec3<F> p = fma(e2, b2, fma(e1, b1, p0));

  Surface<F> s;
  s.p = maps.point(p);
  // The length of the area vector is twice the triangle's area in world space.
  const Vec3<F> area_vector = maps.map_normal(cross(e1, e2));
  const F area2 = length(area_vector);
  const F safe_area2 = select(area2 > 0.f, area2, F(1.f));
  s.ng = select<F>(area2 > 0.f, area_vector * F(1.f / safe_area2), -dir);

  const TrianglePoint<F> at{.i = {i0, i1, i2},
                            .p0 = p0,
                            .p1 = p1,
                            .p2 = p2,
                            .e1 = e1,
                            .e2 = e2,
                            .p = p,
                            .b0 = b0,
                            .b1 = b1,
                            .b2 = b2,
                            .safe_area2 = safe_area2};
  s.offset = rounding_offset<F>(maps, at);
  // Interpolation between motion steps adds rounding errors in proportion to the coordinates at
  // both steps.
  if (kIsGeneral && scene.has_motion) [[unlikely]]
    s.offset = max(s.offset, F(moved_size * 0x1.4p-20f));

  s.ns = s.ng;
  s.terminator = Vec3<F>(F(0.f));
  const Mask<F> smooth = has_normals(mesh) & active;
  if (any(smooth))
    set_smooth_normal<kIsGeneral, F>(scene, hit, mesh, maps, at, {smooth, with_terminator}, s);
  s.uv = {b1, b2};
  s.dpdu = Vec3<F>(F(0.f));
  s.handedness = maps.side;
  s.uv_per_length = F(0.f);
  if (with_uv) set_triangle_uv<F>(scene, hit, mesh, maps, at, active, s);
  if (kIsGeneral && scene.has_curves) {
    const Mask<F> curved = lanes & not_(active);
    if (any(curved)) setup_curved<F>(scene, hit, dir, with_uv, curved, s);
  }
  s.unadjusted = s.ns;
  s.ns = facing_normal<F>(dir, s.ng, s.ns);
  return s;
}

}  // namespace detail

/// Computes the shading point of a hit. `dir` is the unit direction of the ray. If `with_uv` is
/// true, the members `uv`, `dpdu` and `uv_per_length` are computed. If `with_terminator` is true,
/// the terminator vector is computed.
///
/// The member `offset` is an upper bound of the distance between `p` and the true surface. This
/// distance is due to rounding errors of interpolation, transformation and traversal (Pharr, Jakob,
/// Humphreys, "Physically Based Rendering", section 6.8). The terminator vector follows Hanika,
/// "Hacking the Shadow Terminator", Ray Tracing Gems II.
///
/// Kernels call this function without inlining it (wave/kernels/shared_kernels.h).
template <typename F>
Surface<F> setup_surface(const SceneView& scene, const MeshHit<F>& hit, const Vec3<F>& dir,
                         bool with_uv, bool with_terminator, const Mask<F>& lanes) {
  return detail::compute_surface<F, true>(scene, hit, dir, with_uv, with_terminator, lanes);
}

/// Returns setup_surface() for scenes without curves and motion, inlined.
template <typename F>
WAVECOMB_INLINE Surface<F> setup_plain_surface(const SceneView& scene, const MeshHit<F>& hit,
                                               const Vec3<F>& dir, bool with_uv,
                                               bool with_terminator, const Mask<F>& lanes) {
  return detail::compute_surface<F, false>(scene, hit, dir, with_uv, with_terminator, lanes);
}

/// Returns |cos| of the angle between a ray along `dir` and the shading normal before its
/// adjustment to the ray, which is the same for the opposite direction.
template <typename F>
inline F unadjusted_cosine(const Vec3<F>& unadjusted, const Vec3<F>& dir) {
  return min(abs(dot(dir, unadjusted)), F(1.f));
}

/// Returns the cosine for the shading point that setup_surface() computes, but reads no more of the
/// mesh than the normal needs.
template <typename F>
inline F unadjusted_cosine(const SceneView& scene, const MeshHit<F>& hit, const Vec3<F>& dir,
                           const Mask<F>& lanes) {
  if (scene.has_motion || (scene.has_curves && any(detail::is_curved<F>(scene, hit.mesh, lanes))))
    return unadjusted_cosine<F>(setup_surface<F>(scene, hit, dir, false, false, lanes).unadjusted,
                                dir);
  const detail::MeshReader<F> mesh(scene.meshes, hit.mesh, lanes);
  const detail::InstanceMaps<F> maps(scene.instances, hit.inst, lanes);
  const auto corners = mesh.corners(hit.prim, lanes);
  Vec3<F> n(F(0.f));
  const Mask<F> smooth = detail::has_normals(mesh) & lanes;
  if (any(smooth)) {
    const auto normals =
        detail::CornerNormals<F>::template read<false>(scene, hit, mesh, corners, smooth);
    n = normals.at(maps, F(F(1.f - hit.u) - hit.v), hit.u, hit.v);
  }
  F len2 = length_squared(n);
  const Mask<F> flat = lanes & not_(smooth & (len2 > 0.f) & is_finite(len2));
  if (any(flat)) {
    const auto corner = [&](size_t k) {
      return mesh.vec3(&MeshRecord::positions, corners[k], flat);
    };
    const Vec3<F> p0 = corner(0), area = maps.map_normal(cross(corner(1) - p0, corner(2) - p0));
    n = select<F>(flat, area, n);
    len2 = length_squared(n);
    // Like setup_surface(), take degenerate triangles to face the ray.
    n = select<F>(len2 > 0.f, n, dir);
    len2 = select(len2 > 0.f, len2, F(1.f));
  }
  return unadjusted_cosine<F>(n * F(1.f / sqrt(len2)), dir);
}

/// Returns the origin of a ray that leaves `s` along `dir`, offset from the surface on that side,
/// without the terminator vector.
template <typename F>
WAVECOMB_INLINE Vec3<F> clear_origin(const Surface<F>& s, const Vec3<F>& dir) {
  return fma(s.ng, select(dot(dir, s.ng) > 0.f, s.offset, F(-s.offset)), s.p);
}

/// Returns the origin of a ray that leaves `s` along `dir`, offset from the surface and by the
/// terminator vector on that side.
template <typename F>
WAVECOMB_INLINE Vec3<F> spawn_origin(const Surface<F>& s, const Vec3<F>& dir) {
  const Mask<F> outside = dot(dir, s.ng) > 0.f;
  const F d = select(outside, s.offset, F(-s.offset));
  const Vec3<F> base = s.p + select<F>(outside, s.terminator, Vec3<F>(F(0.f)));
  return fma(s.ng, d, base);
}

}  // namespace wavecomb
