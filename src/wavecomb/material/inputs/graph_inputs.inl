// SPDX-License-Identifier: Apache-2.0
/// Definitions for graph_inputs.h; include only where the templates are instantiated.
#pragma once

#include "wavecomb/material/inputs/graph_inputs.h"

namespace wavecomb {

template <typename F>
[[gnu::noinline, gnu::cold]] GraphPoint<F> graph_point(const SceneView& scene,
                                                       const MeshHit<F>& hit, const Surface<F>& s,
                                                       const Vec3<F>& dir,
                                                       const Footprint<F>& footprint,
                                                       const Mask<F>& active) {
  GraphPoint<F> at;
  at.uv = s.uv;
  at.footprint = footprint;
  at.position = s.p;
  at.normal = s.ns;
  at.view = -dir;
  at.mesh_position = {hit.mesh, hit.prim, hit.u, hit.v};
  const uint32_t wanted = scene.materials.graphs.inputs;
  const auto unit = [](const Vec3<F>& v, const Vec3<F>& otherwise) {
    const F len2 = length_squared(v);
    const Mask<F> valid = (len2 > 0.f) & is_finite(len2);
    return select<F>(valid, v * F(1.f / sqrt(select(valid, len2, F(1.f)))), otherwise);
  };
  if ((wanted &
       (graph_input_bit(GraphInput::kTangent) | graph_input_bit(GraphInput::kBitangent))) != 0) {
    at.tangent = unit(s.dpdu - s.ns * dot(s.ns, s.dpdu), make_frame<F>(s.ns).s);
    at.handedness = s.handedness;
  }
  constexpr uint32_t kOfSpace =
      graph_input_bit(GraphInput::kLocalPosition) | graph_input_bit(GraphInput::kLocalNormal) |
      graph_input_bit(GraphInput::kNormalX) | graph_input_bit(GraphInput::kNormalY) |
      graph_input_bit(GraphInput::kNormalZ);
  if ((wanted & kOfSpace) == 0) return at;
  detail::InstanceMaps<F> maps(scene.instances, hit.inst, active);
  if (scene.has_motion)
    maps.set_instance(moved_instance<F>(scene, hit.inst, hit.time, maps, Vec3<F>(F(0.f)), active));
  // Invert the instance transform by cofactors.
  const Vec3<F>* m = maps.row;
  const Vec3<F> c[3] = {cross(m[1], m[2]), cross(m[2], m[0]), cross(m[0], m[1])};
  const F det = dot(m[0], c[0]), inv = 1.f / select(det == 0.f, F(1.f), det);
  const Vec3<F> p = s.p - maps.t;
  at.local_position = (c[0] * p.x + c[1] * p.y + c[2] * p.z) * inv;
  at.local_normal = unit(m[0] * s.ns.x + m[1] * s.ns.y + m[2] * s.ns.z, s.ns);
  at.normal_x = maps.inverse_row(0);
  at.normal_y = maps.inverse_row(1);
  at.normal_z = maps.inverse_row(2);
  return at;
}

}  // namespace wavecomb
