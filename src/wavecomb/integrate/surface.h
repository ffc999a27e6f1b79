// SPDX-License-Identifier: Apache-2.0
/// From a hit to what shading needs of the surface there.
#pragma once

#include "wavecomb/core/frame.h"
#include "wavecomb/core/math.h"
#include "wavecomb/scene/scene.h"

namespace wavecomb {

/// A hit on a mesh: instance (index into SceneView::instances), mesh, triangle and barycentrics of
/// vertices 1 and 2.
template <typename F>
struct MeshHit {
  UInt<F> inst, mesh, prim;
  F u, v;
};

/// A surface point in world space.
template <typename F>
struct Surface {
  Vec3<F> p;
  Vec3<F> ng;    ///< unit geometric normal, outside by winding
  Vec3<F> ns;    ///< unit shading normal on the same side as ng
  Vec3<F> dpdu;  ///< tangent along u, any length; zero where uv is not asked for
  Vec2<F> uv;
  F uv_per_length;     ///< sqrt(uv area / world area) of the triangle
  F offset;            ///< bound of the error of p along ng
  Vec3<F> terminator;  ///< from p to the smooth surface that the vertex normals suggest, along ng
};

namespace detail {

/// One array of a mesh: the same base in all lanes, or one address a lane.
template <typename F>
struct MeshArray {
  const void* shared = nullptr;
  UInt64<F> address{0};

  template <typename T>
  T at(const UInt<F>& index, const Mask<F>& active) const {
    return shared ? gather<T>(shared, index, Mask<T>(active))
                  : gather_at<T>(address, index, Mask<T>(active));
  }
  Vec3<F> vec3(const UInt<F>& index, const Mask<F>& active) const {
    const UInt<F> i = index * 3u;
    return {at<F>(i, active), at<F>(i + 1u, active), at<F>(i + 2u, active)};
  }
  Vec2<F> vec2(const UInt<F>& index, const Mask<F>& active) const {
    const UInt<F> i = index * 2u;
    return {at<F>(i, active), at<F>(i + 1u, active)};
  }
};

/// The meshes of the lanes.
template <typename F>
struct MeshArrays {
  MeshArray<F> positions, indices, normals, uvs;
  UInt<F> flags;
};

template <typename F>
inline MeshArrays<F> mesh_arrays(const SceneView& scene, const UInt<F>& mesh,
                                 const Mask<F>& active) {
  MeshArrays<F> a;
  if (is_uniform<F>(mesh, active)) {
    const MeshRecord& r = scene.meshes[any(active) ? first_active(mesh, Mask<UInt<F>>(active)) : 0];
    a.positions.shared = reinterpret_cast<const void*>(r.positions);
    a.indices.shared = reinterpret_cast<const void*>(r.indices);
    a.normals.shared = reinterpret_cast<const void*>(r.normals);
    a.uvs.shared = reinterpret_cast<const void*>(r.uvs);
    a.flags = UInt<F>(r.flags);
  } else {
    const Mask<UInt<F>> on(active);
    const UInt<F> word = mesh * static_cast<uint32_t>(sizeof(MeshRecord) / 4);
    const auto address = [&](size_t offset) {
      const UInt<F> at = word + static_cast<uint32_t>(offset / 4);
      using U64 = UInt64<F>;
      return U64(gather<UInt<F>>(scene.meshes, at, on)) |
             (U64(gather<UInt<F>>(scene.meshes, at + 1u, on)) << 32);
    };
    a.positions.address = address(offsetof(MeshRecord, positions));
    a.indices.address = address(offsetof(MeshRecord, indices));
    a.normals.address = address(offsetof(MeshRecord, normals));
    a.uvs.address = address(offsetof(MeshRecord, uvs));
    a.flags = gather<UInt<F>>(scene.meshes,
                              word + static_cast<uint32_t>(offsetof(MeshRecord, flags) / 4), on);
  }
  return a;
}

/// The transforms of the lanes' instances.
template <typename F>
struct InstanceMaps {
  Vec3<F> row[3], t, normal[3];

  Vec3<F> point(const Vec3<F>& p) const {
    return {fma(row[0].z, p.z, fma(row[0].y, p.y, fma(row[0].x, p.x, t.x))),
            fma(row[1].z, p.z, fma(row[1].y, p.y, fma(row[1].x, p.x, t.y))),
            fma(row[2].z, p.z, fma(row[2].y, p.y, fma(row[2].x, p.x, t.z)))};
  }
  Vec3<F> vector(const Vec3<F>& v) const {
    return {dot(row[0], v), dot(row[1], v), dot(row[2], v)};
  }
  Vec3<F> map_normal(const Vec3<F>& n) const {
    return {dot(normal[0], n), dot(normal[1], n), dot(normal[2], n)};
  }
};

template <typename F>
inline InstanceMaps<F> instance_maps(const SceneView& scene, const UInt<F>& inst,
                                     const Mask<F>& active) {
  InstanceMaps<F> m;
  const auto fill = [&](auto&& real) {
    for (uint32_t i = 0; i < 3; ++i) {
      m.row[i] = {real(4 * i), real(4 * i + 1), real(4 * i + 2)};
      m.normal[i] = {real(12 + 3 * i), real(13 + 3 * i), real(14 + 3 * i)};
    }
    m.t = {real(3), real(7), real(11)};
  };
  if (is_uniform<F>(inst, active)) {
    const auto* shared = reinterpret_cast<const float*>(
        scene.instances + (any(active) ? first_active(inst, Mask<UInt<F>>(active)) : 0));
    fill([&](uint32_t word) { return F(shared[word]); });
  } else {
    const UInt<F> base = inst * static_cast<uint32_t>(sizeof(InstanceRecord) / 4);
    fill([&](uint32_t word) { return gather<F>(scene.instances, base + word, active); });
  }
  return m;
}

template <typename F>
inline Vec3<F> abs3(const Vec3<F>& v) {
  return {abs(v.x), abs(v.y), abs(v.z)};
}

}  // namespace detail

/// Everything about the surface at a hit. `with_uv`: uv, dpdu and uv_per_length are wanted.
/// `dir` is the unit direction of the ray that hit.
///
/// The offset bounds the distance between p and the true surface: interpolation, transform and the
/// traversal's own rounding, in the manner of Pharr, Jakob, Humphreys, "Physically Based
/// Rendering", section 6.8. The terminator vector follows Hanika, "Hacking the Shadow Terminator",
/// Ray Tracing Gems II.
template <typename F>
inline Surface<F> setup_surface(const SceneView& scene, const MeshHit<F>& hit, const Vec3<F>& dir,
                                bool with_uv, bool with_terminator, const Mask<F>& active) {
  using U = UInt<F>;
  const auto mesh = detail::mesh_arrays<F>(scene, hit.mesh, active);
  const auto maps = detail::instance_maps<F>(scene, hit.inst, active);
  const U corner = hit.prim * 3u;
  const U i0 = mesh.indices.template at<U>(corner, active);
  const U i1 = mesh.indices.template at<U>(corner + 1u, active);
  const U i2 = mesh.indices.template at<U>(corner + 2u, active);
  const Vec3<F> p0 = mesh.positions.vec3(i0, active);
  const Vec3<F> p1 = mesh.positions.vec3(i1, active);
  const Vec3<F> p2 = mesh.positions.vec3(i2, active);
  const F b1 = hit.u, b2 = hit.v, b0 = 1.f - b1 - b2;
  const Vec3<F> e1 = p1 - p0, e2 = p2 - p0;
  const Vec3<F> p = fma(e2, b2, fma(e1, b1, p0));

  Surface<F> s;
  s.p = maps.point(p);
  const Vec3<F> area_vector = maps.map_normal(cross(e1, e2));  // length: twice the world area
  const F area2 = length(area_vector);
  const F safe_area2 = select(area2 > 0.f, area2, F(1.f));
  s.ng = select<F>(area2 > 0.f, area_vector * F(1.f / safe_area2), -dir);

  // What was rounded: the interpolated point in all its terms, and, less so, the triangle's corners
  // that traversal subtracts the ray's origin from. All axes count, since the traversal's products
  // mix them.
  const Vec3<F> q0 = detail::abs3(p0), q1 = detail::abs3(p1), q2 = detail::abs3(p2);
  const Vec3<F> size = (q0 * abs(b0) + q1 * b1 + q2 * b2) + max(q0, max(q1, q2)) * F(0.25f);
  const auto magnitude = [&](int i, const F& t) {
    return dot(detail::abs3(maps.row[i]), size) + abs(t);
  };
  s.offset =
      max(max(magnitude(0, maps.t.x), magnitude(1, maps.t.y)), magnitude(2, maps.t.z)) * 0x1p-20f;

  s.ns = s.ng;
  s.terminator = Vec3<F>(F(0.f));
  const Mask<F> smooth =
      Mask<F>((mesh.flags & (kNormalsPerVertex | kNormalsPerCorner)) != U(0u)) & active;
  if (any(smooth)) {
    const Mask<F> per_corner = Mask<F>((mesh.flags & kNormalsPerCorner) != U(0u));
    const Mask<U> pick(per_corner);
    Vec3<F> n0 = mesh.normals.vec3(select(pick, corner, i0), smooth);
    Vec3<F> n1 = mesh.normals.vec3(select(pick, corner + 1u, i1), smooth);
    Vec3<F> n2 = mesh.normals.vec3(select(pick, corner + 2u, i2), smooth);
    const Vec3<F> n = maps.map_normal(fma(n2, b2, fma(n1, b1, Vec3<F>(n0 * b0))));
    const F len2 = length_squared(n);
    const Mask<F> good = smooth & (len2 > 0.f) & is_finite(len2);
    Vec3<F> ns = n * F(1.f / sqrt(select(good, len2, F(1.f))));
    const F side = dot(ns, s.ng);
    ns = select<F>(side < 0.f, -ns, ns);
    s.ns = select<F>(good, ns, s.ng);

    if (with_terminator) {
      // Project p to the tangent planes at the vertices and interpolate, on the normals' side only.
      const auto lift = [&](const Vec3<F>& q, const Vec3<F>& vertex_normal) {
        const F n2len = length_squared(vertex_normal);
        const F h = dot(Vec3<F>(p - q), vertex_normal) / select(n2len > 0.f, n2len, F(1.f));
        return vertex_normal * min(h, F(0.f));
      };
      const Vec3<F> d = lift(p0, n0) * b0 + lift(p1, n1) * b1 + lift(p2, n2) * b2;
      const Vec3<F> world = -maps.vector(d);
      const Mask<F> outward = good & (side > 0.f) & (dot(world, s.ng) > 0.f);
      s.terminator = select<F>(outward, world, Vec3<F>(F(0.f)));
    }
  }
  // A shading normal that looks away from the viewer is bent until it is seen edge-on.
  const F towards = select(dot(dir, s.ng) < 0.f, F(1.f), F(-1.f));  // +1: seen from outside
  const F seen = -dot(dir, s.ns) * towards;
  constexpr float kEdge = 1e-3f;
  const Mask<F> away = seen < kEdge;
  if (any(away & active)) {
    const Vec3<F> bent = normalize(fma(dir, F(-towards * (kEdge - seen)), s.ns));
    s.ns = select<F>(away, bent, s.ns);
  }

  s.uv = {b1, b2};
  s.dpdu = Vec3<F>(F(0.f));
  s.uv_per_length = F(0.f);
  if (with_uv) {
    const Mask<F> has_uv =
        Mask<F>((mesh.flags & (kUvsPerVertex | kUvsPerCorner)) != U(0u)) & active;
    Vec2<F> t0{F(0.f), F(0.f)}, t1{F(1.f), F(0.f)}, t2{F(0.f), F(1.f)};
    if (any(has_uv)) {
      const Mask<U> pick(Mask<F>((mesh.flags & kUvsPerCorner) != U(0u)));
      const auto fetch = [&](const U& at, const U& index, Vec2<F>& out) {
        const Vec2<F> value = mesh.uvs.vec2(select(pick, at, index), has_uv);
        out = {select(has_uv, value.x, out.x), select(has_uv, value.y, out.y)};
      };
      fetch(corner, i0, t0);
      fetch(corner + 1u, i1, t1);
      fetch(corner + 2u, i2, t2);
    }
    const Vec2<F> d1{t1.x - t0.x, t1.y - t0.y}, d2{t2.x - t0.x, t2.y - t0.y};
    s.uv = {fma(d2.x, b2, fma(d1.x, b1, t0.x)), fma(d2.y, b2, fma(d1.y, b1, t0.y))};
    const F det = fma(d1.x, d2.y, F(-(d1.y * d2.x)));
    s.uv_per_length = sqrt(F(abs(det) / safe_area2));
    // dp/du = (d2.v e1 - d1.v e2) / det; only its direction is used.
    const Vec3<F> tangent = maps.vector(e1 * d2.y - e2 * d1.y);
    s.dpdu = select<F>(det < 0.f, -tangent, tangent);
  }
  return s;
}

/// The origin of a ray that leaves `s` along `dir`, clear of the surface on that side.
template <typename F>
inline Vec3<F> spawn_origin(const Surface<F>& s, const Vec3<F>& dir) {
  const Mask<F> outside = dot(dir, s.ng) > 0.f;
  const F d = select(outside, s.offset, F(-s.offset));
  const Vec3<F> base = s.p + select<F>(outside, s.terminator, Vec3<F>(F(0.f)));
  return fma(s.ng, d, base);
}

}  // namespace wavecomb
