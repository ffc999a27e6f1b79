// SPDX-License-Identifier: Apache-2.0
/// Definition of `setup_curved()`, for the translation units that instantiate it.
#pragma once

#include "wavecomb/geometry/curve/segment.h"
#include "wavecomb/geometry/hit/curve_surface.h"
#include "wavecomb/geometry/hit/curve_uv.h"
#include "wavecomb/geometry/hit/gaussian_splat_surface.h"

namespace wavecomb::detail {

/// Hit point on a curve or point, in the space of the instanced group.
template <typename F>
struct CurvedPoint {
  Vec3<F> p, n, dpdu;  ///< n: unit outward normal
  /// Upper bound of the magnitudes of the summands of `p`. The rounding error of `p` is
  /// proportional to this bound.
  F size;
  F du, dv;  ///< lengths of dp/du and dp/dv
};

template <typename F>
inline F reach(const Vec3<F>& v) {
  return max_component(abs3(v));
}

/// Returns an upper bound of the coordinates of a curve segment, from its control points and radii.
template <typename F>
inline F control_size(const CurveSegment<F>& s) {
  return max(max(F(reach(s.p[0]) + s.r[0]), F(reach(s.p[1]) + s.r[1])),
             max(F(reach(s.p[2]) + s.r[2]), F(reach(s.p[3]) + s.r[3])));
}

template <typename F>
inline CurvedPoint<F> tube_point(const CurveSegment<F>& s, const F& u, const F& v) {
  const CurvePoint<F> at = curve_point<F>(s, clamp(u, F(0.f), F(1.f)));
  const Vec3<F> n = tube_normal<F>(tube_frame<F>(s, at), u, v);
  return {fma(n, at.r, at.c), n, at.dc, control_size(s), F(length(at.dc)), F(2.f * kPi * at.r)};
}

/// Returns the point of a ribbon at (u, v). The derivative of its unit width direction b = B / |B|
/// with B = c' x n is (B' - b dot(b, B')) / |B|.
template <typename F>
inline CurvedPoint<F> ribbon_point(const CurveSegment<F>& s, const F& u, const F& v) {
  const CurvePoint<F> at = curve_point<F>(s, u);
  const CurveWeights<F> weights(u, s.cubic);
  const Vec3<F> n = weights.at(s.n), dn = weights.along(s.n);
  const Vec3<F> bend = (s.p[2] - s.p[1] * F(2.f) + s.p[0]) * F(6.f * (1.f - u)) +
                       (s.p[3] - s.p[2] * F(2.f) + s.p[1]) * F(6.f * u);
  const Vec3<F> ddc = select<F>(s.cubic, bend, Vec3<F>(F(0.f)));
  const Vec3<F> across = cross(at.dc, n), slope = cross(ddc, n) + cross(at.dc, dn);
  const F size2 = length_squared(across);
  const F inverse = 1.f / sqrt(select(size2 > 0.f, size2, F(1.f)));
  const Vec3<F> b = across * inverse;
  const Vec3<F> db = fma(b, F(-dot(b, slope)), slope) * inverse;
  const F side = 2.f * v - 1.f;
  const Vec3<F> dpdu = fma(b, F(side * at.dr), fma(db, F(side * at.r), at.dc));
  const Vec3<F> normal = cross(b, dpdu);
  const F n2 = length_squared(normal);
  return {fma(b, F(side * at.r), at.c),
          select<F>(n2 > 0.f, normal * F(1.f / sqrt(select(n2 > 0.f, n2, F(1.f)))), b),
          dpdu,
          control_size(s),
          F(length(dpdu)),
          F(2.f * at.r)};
}

template <typename F>
inline void merge(CurvedPoint<F>& to, const CurvedPoint<F>& from, const Mask<F>& m) {
  to = {select<F>(m, from.p, to.p),    select<F>(m, from.n, to.n), select<F>(m, from.dpdu, to.dpdu),
        select(m, from.size, to.size), select(m, from.du, to.du),  select(m, from.dv, to.dv)};
}
template <typename F>
inline void merge(Surface<F>& to, const Surface<F>& from, const Mask<F>& m) {
  to = {select<F>(m, from.p, to.p),
        select<F>(m, from.ng, to.ng),
        select<F>(m, from.ns, to.ns),
        select<F>(m, from.dpdu, to.dpdu),
        select(m, from.handedness, to.handedness),
        {select(m, from.uv.x, to.uv.x), select(m, from.uv.y, to.uv.y)},
        select(m, from.uv_per_length, to.uv_per_length),
        select(m, from.offset, to.offset),
        select<F>(m, from.terminator, to.terminator),
        select<F>(m, from.ns, to.ns)};
}

/// Sets the texture coordinates of a shading point, their change per unit length, and the tangent.
template <typename F>
inline void set_uv(const MeshReader<F>& mesh, const InstanceMaps<F>& maps, const MeshHit<F>& hit,
                   const CurvedPoint<F>& c, const Mask<F>& active, const Mask<F>& strands,
                   Surface<F>& s) {
  const F scale = length(maps.vector(c.dpdu)) / max(length(c.dpdu), F(1e-30f));
  s.dpdu = maps.vector(c.dpdu);
  // Without authored texture coordinates, each curve segment covers the unit square of texture
  // space.
  F density2 = 1.f / max(F(c.du * c.dv * scale * scale), F(1e-30f));
  const CurveUv<F> uv = curve_uv<F>(mesh, hit.prim, hit.u, hit.v, active, strands);
  s.uv = uv.uv;
  if (any(uv.authored)) {
    const F along2 =
        fma(uv.d.x, uv.d.x, F(uv.d.y * uv.d.y)) / max(F(sqr(F(c.du * scale))), F(1e-30f));
    density2 = select(uv.authored, select(strands, along2, F(0.f)), density2);
  }
  s.uv_per_length = sqrt(density2);
}

/// Control points of the curve segment or point that each lane hit.
template <typename F>
struct ControlPoints {
  UInt<F> first;    ///< index of control point 0
  Mask<F> strands;  ///< lanes that hit curve segments
  Mask<F> ribbons;  ///< lanes with normals
};

/// Moves control points, ribbon normals and instance transforms to the time of the hits. Returns an
/// upper bound of the magnitudes of the summands of a world position. The rounding error of the
/// position is proportional to this bound.
template <typename F>
[[gnu::noinline, gnu::cold]] F move_segment(const SceneView& scene, const MeshHit<F>& hit,
                                            const ControlPoints<F>& from, const Mask<F>& active,
                                            CurveSegment<F>& s, InstanceMaps<F>& maps) {
  const auto& [first, strands, ribbons] = from;
  const MovingRows<F> points(scene, hit.mesh, hit.time, &MeshRecord::positions,
                             &MeshMotion::positions, active);
  const MovingRows<F> normals(scene, hit.mesh, hit.time, &MeshRecord::normals, &MeshMotion::normals,
                              active);
  Vec3<F> far(F(0.f));
  for (uint32_t k = 0; k < 4; ++k) {
    const Mask<F> on = k == 0 ? active : (k == 1 ? strands : s.cubic);
    const auto [p, reach] = points(first + k, on);
    s.p[k] = select<F>(on, p, s.p[k]);
    s.n[k] = select<F>(ribbons & on, normals(first + k, ribbons & on).v, s.n[k]);
    far = max(far, select<F>(on, reach + Vec3<F>(s.r[k]), Vec3<F>(F(0.f))));
  }
  const MovedInstance<F> instance = moved_instance<F>(scene, hit.inst, hit.time, maps, far, active);
  maps.set_instance(instance);
  return instance.size;
}

template <typename F>
__attribute__((noinline)) void setup_curved(const SceneView& scene, const MeshHit<F>& hit,
                                            const Vec3<F>& dir, bool with_uv, const Mask<F>& active,
                                            Surface<F>& out) {
  using U = UInt<F>;
  const MeshReader<F> mesh(scene.meshes, hit.mesh, active);
  InstanceMaps<F> maps(scene.instances, hit.inst, active);
  const auto is = [&](uint32_t flag) { return active & Mask<F>((mesh.flags & flag) != U(0u)); };
  const Mask<F> spheres = is(kIsDots), ribbons = is(kIsRibbon), splats = is(kIsGaussianSplat);
  const Mask<F> strands = active & not_(spheres);
  CurveSegment<F> s;
  s.cubic = is(kIsCubic);
  const U first =
      select(Mask<U>(strands),
             mesh.word(&MeshRecord::indices, hit.prim, strands) & kCurveFirstPoint, hit.prim);
  for (uint32_t k = 0; k < 4; ++k) {
    const Mask<F> on = k == 0 ? active : (k == 1 ? strands : s.cubic);
    s.p[k] = mesh.vec3(&MeshRecord::positions, first + k, on);
    s.r[k] = bits_float<F>(mesh.word(&MeshRecord::radii, first + k, on));
    s.n[k] = mesh.vec3(&MeshRecord::normals, first + k, ribbons & on);
  }
  F moved_size(0.f);
  if (scene.has_motion)
    moved_size = move_segment<F>(
        scene, hit, {.first = first, .strands = strands, .ribbons = ribbons}, active, s, maps);

  CurvedPoint<F> c = tube_point<F>(s, hit.u, hit.v);
  if (any(ribbons)) merge(c, ribbon_point<F>(s, hit.u, hit.v), ribbons);
  if (any(spheres)) {
    const Vec3<F> n = sphere_normal<F>(hit.u, hit.v);
    merge(c,
          {fma(n, s.r[0], s.p[0]),
           n,
           {-n.y, n.x, F(0.f)},
           F(reach(s.p[0]) + s.r[0]),
           F(2.f * kPi * s.r[0]),
           F(kPi * s.r[0])},
          spheres);
  }
  if (any(splats)) {
    const GaussianSplatMap<F> map(mesh, hit.prim, splats);
    const Vec3<F> p = s.p[0] + gaussian_splat_offset<F>(map, maps, hit.u, hit.v, dir);
    merge(c, {p, c.n, c.dpdu, c.size, c.du, c.dv}, splats);
  }

  Surface<F> r;
  r.p = maps.point(c.p);
  const Vec3<F> n = maps.map_normal(c.n);
  const F len2 = length_squared(n);
  r.ng = n * F(1.f / sqrt(select(len2 > 0.f, len2, F(1.f))));
  r.ng = select<F>(splats, -dir, r.ng);
  r.ns = r.ng;
  const auto magnitude = [&](int i, const F& t) {
    const Vec3<F> row = abs3(maps.row[i]);
    return F((row.x + row.y + row.z) * c.size + abs(t));
  };
  r.offset =
      max(max(magnitude(0, maps.t.x), magnitude(1, maps.t.y)), magnitude(2, maps.t.z)) * 0x1p-20f;
  r.offset = max(r.offset, F(moved_size * 0x1.4p-20f));
  r.terminator = Vec3<F>(F(0.f));
  r.dpdu = Vec3<F>(F(0.f));
  r.handedness = maps.side;
  r.uv_per_length = F(0.f);
  r.uv = {clamp(hit.u, F(0.f), F(1.f)), hit.v};
  if (with_uv) set_uv(mesh, maps, hit, c, active, strands, r);
  merge(out, r, active);
}

}  // namespace wavecomb::detail
