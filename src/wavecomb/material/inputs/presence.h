// SPDX-License-Identifier: Apache-2.0
/// Opacity at mesh points that are not shading points of a path: hits of rays on cut-outs, and
/// light samples on cut-out emitters.
#pragma once

#include "wavecomb/core/rows/fields.h"
#include "wavecomb/geometry/hit/surface_reader.h"
#include "wavecomb/material/inputs/emission_opacity.h"

namespace wavecomb {

/// Returns the lanes whose materials are cut out by opacity. In these lanes, the presence of the
/// surface must be looked up.
template <typename F>
inline Mask<F> has_presence(const MaterialView& view, const UInt<F>& material,
                            const Mask<F>& active) {
  using U = UInt<F>;
  const U flags = gather_member<F>(view.materials, &MaterialRecord::flags, material, active);
  return active & Mask<F>((flags & uint32_t{kPresence}) != U(0u));
}

/// Makes the inputs of a value graph at a point of a mesh that no path has hit. On triangles, the
/// graph gets the position without motion, and the geometric normal both as the normal and as the
/// viewing direction. On curves and points, the graph gets only texture coordinates. Textures are
/// read at their finest level.
template <typename F>
[[gnu::noinline, gnu::cold]] GraphPoint<F> point_at_rest(const MeshRecord* meshes,
                                                         const InstanceRecord* instances,
                                                         const UInt<F>& instance,
                                                         const MeshPosition<F>& mesh_position,
                                                         const Vec2<F>& uv, const Mask<F>& active) {
  using U = UInt<F>;
  GraphPoint<F> at;
  at.uv = uv;
  at.mesh_position = mesh_position;
  const detail::MeshReader<F> mesh(meshes, mesh_position.mesh, active);
  const Mask<F> flat = active & Mask<F>((mesh.flags & uint32_t{kIsCurved}) == U(0u));
  if (none(flat)) return at;
  const auto corners = mesh.corners(mesh_position.prim, flat);
  const auto corner = [&](size_t k) { return mesh.vec3(&MeshRecord::positions, corners[k], flat); };
  const detail::InstanceMaps<F> maps(instances, instance, flat);
  const Vec3<F> p0 = corner(0), e1 = corner(1) - p0, e2 = corner(2) - p0;
  const Vec3<F> p = fma(e2, mesh_position.v, fma(e1, mesh_position.u, p0)), n = cross(e1, e2);
  const auto unit = [&](const Vec3<F>& v, const Vec3<F>& otherwise) {
    const F size = length(v);
    const Mask<F> valid = flat & (size > 0.f);
    return select<F>(valid, v * F(1.f / select(valid, size, F(1.f))), otherwise);
  };
  at.local_position = select<F>(flat, p, at.local_position);
  at.position = select<F>(flat, maps.point(p), at.position);
  at.local_normal = unit(n, at.local_normal);
  at.normal = unit(maps.map_normal(n), at.normal);
  at.view = select<F>(flat, at.normal, at.view);
  at.normal_x = select<F>(flat, maps.inverse_row(0), at.normal_x);
  at.normal_y = select<F>(flat, maps.inverse_row(1), at.normal_y);
  at.normal_z = select<F>(flat, maps.inverse_row(2), at.normal_z);
  return at;
}

/// Point of an instanced mesh whose opacity is looked up.
template <typename F>
struct OpacityQuery {
  UInt<F> material;
  UInt<F> instance;
  MeshPosition<F> mesh_position;
  Vec2<F> uv;  ///< texture coordinates
};

/// Returns the opacity of the material at a point.
template <typename F>
inline F opacity_at(const MaterialView& view, const MeshRecord* meshes,
                    const InstanceRecord* instances, const OpacityQuery<F>& at,
                    const Mask<F>& active) {
  const auto point = [&](const Mask<F>& lanes) {
    return point_at_rest<F>(meshes, instances, at.instance, at.mesh_position, at.uv, lanes);
  };
  return fetch_opacity<F>(view, at.material, at.uv, F(0.f), point, active);
}

}  // namespace wavecomb
