// SPDX-License-Identifier: Apache-2.0
/// Smooth tangents of triangles. `geometry/hit/surface.h` includes this file.
#pragma once

#include <array>

#include "wavecomb/core/encoding/octahedral.h"
#include "wavecomb/geometry/hit/surface_reader.h"
#include "wavecomb/geometry/mesh/tangents.h"

namespace wavecomb::detail {

/// Encoded tangents of the triangle corners of each lane, at the motion steps before and after the
/// lane's time.
template <typename F>
struct TangentCodes {
  InMemory<UInt<F>> before[3], after[3];
  alignas(64) float part[kWidth<F>] = {};  ///< interpolation weight of `after`
  bool moves = false;

  TangentCodes(const TangentRecord* records, const MeshHit<F>& hit,
               const std::array<UInt<F>, 3>& corners, const Mask<F>& active) {
    const InMemory<UInt<F>> mesh(hit.mesh), prim(hit.prim);
    const InMemory<UInt<F>> vertex[3] = {InMemory<UInt<F>>(corners[0]),
                                         InMemory<UInt<F>>(corners[1]),
                                         InMemory<UInt<F>>(corners[2])};
    alignas(64) float time[kWidth<F>];
    store(time, hit.time);
    for (size_t k = 0; k < 3; ++k) before[k] = after[k] = InMemory<UInt<F>>(UInt<F>(kNoDirection));
    for (uint32_t bits = lane_bits<F>(active); bits != 0; bits &= bits - 1) {
      const auto i = static_cast<size_t>(std::countr_zero(bits));
      const TangentRecord& record = records[mesh.value[i]];
      if (record.codes == 0) continue;
      const auto* codes = reinterpret_cast<const uint32_t*>(record.codes);
      const auto at = [&](size_t k) {
        return record.at_corners != 0 ? 3 * prim.value[i] + static_cast<uint32_t>(k)
                                      : vertex[k].value[i];
      };
      if (record.segments != 0) {
        const StepInterpolation<float> interpolation(time[i], record.segments);
        codes += size_t{interpolation.before} * record.step;
        part[i] = interpolation.part;
        for (size_t k = 0; k < 3; ++k) after[k].value[i] = codes[record.step + at(k)];
        moves = true;
      }
      for (size_t k = 0; k < 3; ++k) before[k].value[i] = codes[at(k)];
      if (record.segments == 0)
        for (size_t k = 0; k < 3; ++k) after[k].value[i] = before[k].value[i];
    }
  }
  /// Returns the tangent of triangle corner k.
  Vec3<F> tangent(size_t k) const {
    const Vec3<F> a = decode_direction<F>(load<UInt<F>>(before[k].value));
    if (!moves) return a;
    const Vec3<F> b = decode_direction<F>(load<UInt<F>>(after[k].value));
    return fma(Vec3<F>(b - a), load<F>(part), a);
  }
};

/// Returns the tangent at hits in the mesh's local space, interpolated between the corners of the
/// triangle, or the triangle's constant tangent `flat` if the mesh has no tangents or they cancel
/// out. The function is not inlined, so that kernels of scenes without tangents stay small.
template <typename F>
[[gnu::noinline]] Vec3<F> smooth_tangent(const SceneView& scene, const MeshHit<F>& hit,
                                         const std::array<UInt<F>, 3>& corners, const Vec3<F>& flat,
                                         const Mask<F>& active) {
  const TangentCodes<F> codes(scene.tangents, hit, corners, active);
  const F b0 = 1.f - hit.u - hit.v;
  const Vec3<F> t =
      fma(codes.tangent(2), hit.v, fma(codes.tangent(1), hit.u, Vec3<F>(codes.tangent(0) * b0)));
  return select<F>(length_squared(t) > 1e-4f, t, flat);
}

}  // namespace wavecomb::detail
