// SPDX-License-Identifier: Apache-2.0
/// From a hit to what shading needs of the surface there.
#pragma once

#include "wavecomb/core/frame.h"
#include "wavecomb/core/math.h"
#include "wavecomb/core/rows.h"
#include "wavecomb/integrate/motion.h"
#include "wavecomb/scene/scene.h"

namespace wavecomb {

/// A hit on a mesh: instance (index into SceneView::instances), mesh, triangle and barycentrics of
/// vertices 1 and 2.
template <typename F>
struct MeshHit {
  UInt<F> inst, mesh, prim;
  F u, v;
  F time{};  ///< of the path, where the scene moves
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

/// The meshes of the lanes, read row by row.
template <typename F>
class MeshReader {
 public:
  MeshReader(const SceneView& scene, const UInt<F>& mesh, const Mask<F>& active) {
    const InMemory<UInt<F>> index(mesh);
    const uint32_t bits = lane_bits<F>(active);
    for (size_t i = 0; i < kWidth<F>; ++i)
      records_[i] = scene.meshes + ((bits >> i & 1u) != 0 ? index.value[i] : 0u);
    flags = gather<UInt<F>>(scene.meshes,
                            mesh * static_cast<uint32_t>(sizeof(MeshRecord) / 4) +
                                static_cast<uint32_t>(offsetof(MeshRecord, flags) / 4),
                            Mask<UInt<F>>(active));
  }

  /// Row `index` of N words of one of a mesh's arrays.
  template <size_t N>
  std::array<F, N> row(uint64_t MeshRecord::* array, const UInt<F>& index,
                       const Mask<F>& active) const {
    return load_rows_of<N, F>(
        [&](size_t lane) { return reinterpret_cast<const void*>(records_[lane]->*array); },
        index * static_cast<uint32_t>(N), active);
  }
  Vec3<F> vec3(uint64_t MeshRecord::* array, const UInt<F>& index, const Mask<F>& active) const {
    const auto r = row<3>(array, index, active);
    return {r[0], r[1], r[2]};
  }
  Vec2<F> vec2(uint64_t MeshRecord::* array, const UInt<F>& index, const Mask<F>& active) const {
    const auto r = row<2>(array, index, active);
    return {r[0], r[1]};
  }
  /// Vertices of triangle `prim`.
  std::array<UInt<F>, 3> corners(const UInt<F>& prim, const Mask<F>& active) const {
    const auto r = row<3>(&MeshRecord::indices, prim, active);
    return {float_bits<F>(r[0]), float_bits<F>(r[1]), float_bits<F>(r[2])};
  }

  UInt<F> flags;

 private:
  const MeshRecord* records_[kWidth<F>];
};

/// The transforms of the lanes' instances.
template <typename F>
struct InstanceMaps {
  Vec3<F> row[3], t;
  F side;  ///< sign of the determinant

  InstanceMaps(const SceneView& scene, const UInt<F>& inst, const Mask<F>& active) {
    std::array<F, 16> r;
    if (!kIsScalar<F> && any(active) && is_uniform<F>(inst, active)) {
      const auto* shared = reinterpret_cast<const float*>(
          scene.instances + first_active(inst, Mask<UInt<F>>(active)));
      for (size_t k = 0; k < 16; ++k) r[k] = F(shared[k]);
    } else {
      r = load_rows<16, F>(scene.instances, inst * 16u, active);
    }
    for (uint32_t i = 0; i < 3; ++i) row[i] = {r[4 * i], r[4 * i + 1], r[4 * i + 2]};
    t = {r[3], r[7], r[11]};
    side = r[15];
  }

  /// Takes other transforms for lanes `moves`.
  void place(const MatrixLanes<F>& to_world, const F& new_side, const Mask<F>& moves) {
    for (int i = 0; i < 3; ++i) row[i] = select<F>(moves, to_world.row[i], row[i]);
    t = select<F>(moves, to_world.t, t);
    side = select(moves, new_side, side);
  }
  Vec3<F> point(const Vec3<F>& p) const {
    return {fma(row[0].z, p.z, fma(row[0].y, p.y, fma(row[0].x, p.x, t.x))),
            fma(row[1].z, p.z, fma(row[1].y, p.y, fma(row[1].x, p.x, t.y))),
            fma(row[2].z, p.z, fma(row[2].y, p.y, fma(row[2].x, p.x, t.z)))};
  }
  Vec3<F> vector(const Vec3<F>& v) const {
    return {dot(row[0], v), dot(row[1], v), dot(row[2], v)};
  }
  /// Normals go by the cofactors, whose rows are the cross products of the other two rows.
  Vec3<F> map_normal(const Vec3<F>& n) const {
    return Vec3<F>(dot(cross(row[1], row[2]), n), dot(cross(row[2], row[0]), n),
                   dot(cross(row[0], row[1]), n)) *
           side;
  }
};

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
WAVECOMB_INLINE Surface<F> setup_surface(const SceneView& scene, const MeshHit<F>& hit,
                                         const Vec3<F>& dir, bool with_uv, bool with_terminator,
                                         const Mask<F>& active) {
  using U = UInt<F>;
  const detail::MeshReader<F> mesh(scene, hit.mesh, active);
  detail::InstanceMaps<F> maps(scene, hit.inst, active);
  const U corner = hit.prim * 3u;
  const auto [i0, i1, i2] = mesh.corners(hit.prim, active);
  Vec3<F> p0 = mesh.vec3(&MeshRecord::positions, i0, active);
  Vec3<F> p1 = mesh.vec3(&MeshRecord::positions, i1, active);
  Vec3<F> p2 = mesh.vec3(&MeshRecord::positions, i2, active);
  F moved_size(0.f);
  if (scene.has_motion) [[unlikely]] {
    const MovedTriangle<F> moved =
        moved_triangle<F>(scene, hit.inst, hit.mesh, {i0, i1, i2}, hit.time, maps, active);
    p0 = moved.p[0];
    p1 = moved.p[1];
    p2 = moved.p[2];
    maps.place(moved.to_world, moved.side, moved.instance_moves);
    moved_size = moved.size;
  }
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
  // And what lies between steps was rounded as they are.
  if (scene.has_motion) [[unlikely]]
    s.offset = max(s.offset, F(moved_size * 0x1.4p-20f));

  s.ns = s.ng;
  s.terminator = Vec3<F>(F(0.f));
  const Mask<F> smooth =
      Mask<F>((mesh.flags & (kNormalsPerVertex | kNormalsPerCorner)) != U(0u)) & active;
  if (any(smooth)) {
    const Mask<F> per_corner = Mask<F>((mesh.flags & kNormalsPerCorner) != U(0u));
    const Mask<U> pick(per_corner);
    const U a0 = select(pick, U(corner), i0), a1 = select(pick, U(corner + 1u), i1),
            a2 = select(pick, U(corner + 2u), i2);
    Vec3<F> n0 = mesh.vec3(&MeshRecord::normals, a0, smooth);
    Vec3<F> n1 = mesh.vec3(&MeshRecord::normals, a1, smooth);
    Vec3<F> n2 = mesh.vec3(&MeshRecord::normals, a2, smooth);
    if (scene.has_motion) [[unlikely]] {
      const auto moved = moved_normals<F>(scene, hit.mesh, {a0, a1, a2}, hit.time, smooth);
      n0 = moved[0];
      n1 = moved[1];
      n2 = moved[2];
    }
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
        const Vec2<F> value = mesh.vec2(&MeshRecord::uvs, select(pick, at, index), has_uv);
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
WAVECOMB_INLINE Vec3<F> spawn_origin(const Surface<F>& s, const Vec3<F>& dir) {
  const Mask<F> outside = dot(dir, s.ng) > 0.f;
  const F d = select(outside, s.offset, F(-s.offset));
  const Vec3<F> base = s.p + select<F>(outside, s.terminator, Vec3<F>(F(0.f)));
  return fma(s.ng, d, base);
}

}  // namespace wavecomb
