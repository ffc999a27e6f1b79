// SPDX-License-Identifier: Apache-2.0
/// Position and emitted radiance of a hit on a Gaussian splat.
#pragma once

#include "wavecomb/geometry/gaussian_splat/gaussian_splat.h"
#include "wavecomb/geometry/gaussian_splat/harmonics.h"
#include "wavecomb/geometry/hit/surface_reader.h"

namespace wavecomb::detail {

/// Linear map from offsets to units of a Gaussian splat's standard deviations, as three matrix
/// rows.
template <typename F>
struct GaussianSplatMap {
  Vec3<F> row[3];

  GaussianSplatMap(const MeshReader<F>& mesh, const UInt<F>& prim, const Mask<F>& active) {
    const auto r = mesh.template row<16>(&MeshRecord::normals, prim, active);
    for (uint32_t k = 0; k < 3; ++k) row[k] = {r[3 * k], r[3 * k + 1], r[3 * k + 2]};
  }
  Vec3<F> whiten(const Vec3<F>& v) const {
    return {dot(row[0], v), dot(row[1], v), dot(row[2], v)};
  }
  /// Applies the inverse of the linear map, computed from cross products of the matrix rows.
  Vec3<F> unwhiten(const Vec3<F>& w) const {
    const Vec3<F> x = cross(row[1], row[2]), y = cross(row[2], row[0]), z = cross(row[0], row[1]);
    const F det = dot(row[0], x);
    return fma(z, w.z, fma(y, w.y, x * w.x)) * F(1.f / select(det == 0.f, F(1.f), det));
  }
};

/// Transforms a world direction to the space of each lane's instanced group and normalises it.
template <typename F>
inline Vec3<F> local_direction(const InstanceMaps<F>& maps, const Vec3<F>& dir) {
  const Vec3<F> d(dot(maps.inverse_row(0), dir), dot(maps.inverse_row(1), dir),
                  dot(maps.inverse_row(2), dir));
  return d * F(1.f / sqrt(max(length_squared(d), F(1e-30f))));
}

/// Returns the offset from the centre of a Gaussian splat to a hit at the coordinates (u, v) by a
/// ray along `dir`.
template <typename F>
inline Vec3<F> gaussian_splat_offset(const GaussianSplatMap<F>& map, const InstanceMaps<F>& maps,
                                     const F& u, const F& v, const Vec3<F>& dir) {
  const Vec3<F> e = map.whiten(local_direction<F>(maps, dir));
  const F inverse = 1.f / sqrt(max(length_squared(e), F(1e-30f)));
  const GaussianSplatFrame<F> frame = gaussian_splat_frame<F>(e * inverse);
  return map.unwhiten(fma(frame.y, v, frame.x * u));
}

}  // namespace wavecomb::detail

namespace wavecomb {

/// Returns the factor by which a Gaussian splat multiplies its material's emission for rays along
/// `dir`: 0.5 plus the sum of its harmonics, clamped to at least 0. The factor is 1 for hits on
/// other primitives.
template <typename F>
[[gnu::noinline, gnu::cold]] Color<F> gaussian_splat_radiance(const SceneView& scene,
                                                              const MeshHit<F>& hit,
                                                              const Vec3<F>& dir,
                                                              const Mask<F>& active) {
  using U = UInt<F>;
  const detail::MeshReader<F> mesh(scene.meshes, hit.mesh, active);
  const Mask<F> splats = active & Mask<F>((mesh.flags & uint32_t{kIsGaussianSplat}) != U(0u));
  if (none(splats)) return Color<F>(F(1.f));
  detail::InstanceMaps<F> maps(scene.instances, hit.inst, splats);
  if (scene.has_motion)
    maps.set_instance(moved_instance<F>(scene, hit.inst, hit.time, maps, Vec3<F>(F(0.f)), splats));
  const auto basis = harmonics<F>(detail::local_direction<F>(maps, dir));
  const U degree = (mesh.flags >> kHarmonicsShift) & 3u;
  const U first = hit.prim * ((degree + 1u) * (degree + 1u));
  Color<F> sum(F(0.5f));
  for (uint32_t k = 0; k < kMaxHarmonics; ++k) {
    const Mask<F> on = splats & Mask<F>(degree >= U(harmonic_degree(k)));
    if (none(on)) break;
    const Color<F> c = mesh.vec3(&MeshRecord::uvs, first + k, on);
    sum = select<F>(on, fma(c, basis[k], sum), sum);
  }
  return select<F>(splats, max(sum, Color<F>(F(0.f))), Color<F>(F(1.f)));
}

}  // namespace wavecomb
