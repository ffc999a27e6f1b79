// SPDX-License-Identifier: Apache-2.0
/// Material lookup at hits.
#pragma once

#include "wavecomb/core/rows/rows.h"
#include "wavecomb/scene/scene_view.h"

namespace wavecomb {

/// Returns the material of primitive `prim` of a mesh: the material of the face if there is one,
/// otherwise the material of the mesh, otherwise the material of the instance (`inherited`,
/// InstanceRecord::material).
template <typename F>
inline UInt<F> hit_material(const SceneView& scene, const UInt<F>& inherited, const UInt<F>& mesh,
                            const UInt<F>& prim, const Mask<F>& active) {
  using U = UInt<F>;
  const Mask<U> on(active);
  constexpr uint32_t kWords = sizeof(MeshRecord) / 4;
  constexpr uint32_t kFaceMaterials = offsetof(MeshRecord, face_materials) / 4;
  static_assert(offsetof(MeshRecord, material) / 4 == kFaceMaterials + 2);
  const auto row = load_rows<4, F>(scene.meshes, mesh * kWords + kFaceMaterials, active);
  const U lo = float_bits<F>(row[0]), hi = float_bits<F>(row[1]);
  U material = float_bits<F>(row[2]);
  const Mask<U> by_face = on & Mask<U>((lo | hi) != U(0u));
  if (any(by_face)) {
    using U64 = UInt64<F>;
    const U64 address = U64(lo) | (U64(hi) << 32);
    material = select(by_face, gather_at<U>(address, prim, by_face), material);
  }
  return select(Mask<U>(material == U(kInheritMaterial)), inherited, material);
}

}  // namespace wavecomb
