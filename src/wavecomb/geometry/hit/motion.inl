// SPDX-License-Identifier: Apache-2.0
/// Definitions of the function templates in motion.h, for the translation units that instantiate
/// them.
#pragma once

#include "wavecomb/geometry/hit/motion.h"

namespace wavecomb {

template <typename F, typename Maps>
[[gnu::noinline, gnu::cold]] MovedInstance<F> moved_instance(const SceneView& scene,
                                                             const UInt<F>& inst, const F& time,
                                                             const Maps& maps, const Vec3<F>& reach,
                                                             const Mask<F>& active) {
  using U = UInt<F>;
  MovedInstance<F> out;
  const auto size = [&](const Vec3<F>& row, const F& t) {
    return F(fma(row.z, reach.z, fma(row.y, reach.y, fma(row.x, reach.x, t))));
  };
  const auto abs3 = [](const Vec3<F>& v) { return Vec3<F>(abs(v.x), abs(v.y), abs(v.z)); };
  out.size = F(0.f);
  for (size_t i = 0; i < 3; ++i) {
    const F t = i == 0 ? maps.t.x : (i == 1 ? maps.t.y : maps.t.z);
    out.size = max(out.size, size(abs3(maps.row[i]), F(abs(t))));
  }
  out.moves = Mask<F>(false);
  if (!scene.motion.instances) return out;
  const auto range = load_rows<2, F>(scene.motion.instances, inst * 2u, active);
  const U first = float_bits<F>(range[0]), segments = float_bits<F>(range[1]);
  out.moves = active & Mask<F>(segments != U(0u));
  if (none(out.moves)) return out;
  const detail::MatrixPair<F> pair(scene.motion.steps, first, segments, time, out.moves);
  out.to_world = pair.matrix();
  const Vec3<F>* row = out.to_world.row;
  out.side = select(dot(row[0], cross(row[1], row[2])) < 0.f, F(-1.f), F(1.f));
  F moving_size(0.f);
  for (size_t i = 0; i < 3; ++i)
    moving_size =
        max(moving_size, size({pair.reach(4 * i), pair.reach(4 * i + 1), pair.reach(4 * i + 2)},
                              pair.reach(4 * i + 3)));
  out.size = select(out.moves, moving_size, out.size);
  return out;
}

template <typename F, typename Maps>
[[gnu::noinline, gnu::cold]] MovedTriangle<F> moved_triangle(
    const SceneView& scene, const UInt<F>& inst, const UInt<F>& mesh,
    const std::array<UInt<F>, 3>& corners, const F& time, const Maps& maps, const Mask<F>& active) {
  MovedTriangle<F> out;
  const detail::MovingRows<F> points(scene, mesh, time, &MeshRecord::positions,
                                     &MeshMotion::positions, active);
  Vec3<F> reach(F(0.f));
  for (size_t k = 0; k < 3; ++k) {
    const auto [p, r] = points(corners[k], active);
    out.p[k] = p;
    reach = max(reach, r);
  }
  out.instance = moved_instance<F>(scene, inst, time, maps, reach, active);
  return out;
}

template <typename F>
[[gnu::noinline, gnu::cold]] std::array<Vec3<F>, 3> moved_normals(
    const SceneView& scene, const UInt<F>& mesh, const std::array<UInt<F>, 3>& indices,
    const F& time, const Mask<F>& active) {
  const detail::MovingRows<F> normals(scene, mesh, time, &MeshRecord::normals, &MeshMotion::normals,
                                      active);
  return {normals(indices[0], active).v, normals(indices[1], active).v,
          normals(indices[2], active).v};
}

}  // namespace wavecomb
