// SPDX-License-Identifier: Apache-2.0
/// Lookup of mesh attributes (primvars) at hits.
#pragma once

#include <cstddef>

#include "wavecomb/core/math.h"
#include "wavecomb/texture/attribute_data.h"

namespace wavecomb {

/// Position on a mesh: mesh and primitive index, and the barycentric coordinates u and v of
/// vertices 1 and 2 of a triangle. For curves, u is the position along the segment.
template <typename F>
struct MeshPosition {
  UInt<F> mesh = UInt<F>(kNoMesh), prim = UInt<F>(0u);
  F u = F(0.f), v = F(0.f);
};

namespace detail {

/// Returns attribute `id` of a mesh if it has at least `width` components, else null.
inline const AttributeRecord* find_attribute(const AttributeView& view, uint32_t mesh, uint32_t id,
                                             uint32_t width) {
  const AttributeRecord* record = view.records + view.of_mesh[mesh];
  while (record->id != id && record->id != kNoAttribute) ++record;
  return record->id == id && record->width >= width ? record : nullptr;
}

/// Computes the indices of the values at the three corners of a triangle, or at the two ends of a
/// segment; for segments, the third index repeats the first.
inline void corner_values(const AttributeRecord& record, uint32_t prim, size_t (&at)[3]) {
  const size_t first = prim;
  switch (record.rate) {
    case AttributeRate::kConstant:
      at[0] = at[1] = at[2] = 0;
      break;
    case AttributeRate::kPrimitive:
      at[0] = at[1] = at[2] = first;
      break;
    case AttributeRate::kVertex: {
      const auto* indices = reinterpret_cast<const uint32_t*>(record.indices);
      for (size_t k = 0; k < 3; ++k) at[k] = indices[3 * first + k];
      break;
    }
    case AttributeRate::kCorner:
      for (size_t k = 0; k < 3; ++k) at[k] = 3 * first + k;
      break;
    case AttributeRate::kEnd:
      at[0] = at[2] = 2 * first;
      at[1] = 2 * first + 1;
      break;
  }
}

}  // namespace detail

/// Writes `width` (1 to 4) components of attribute `id` to `out`, linearly interpolated between
/// corners. In lanes whose mesh lacks the attribute or has fewer components, `out` does not change.
///
/// Each lane may read a different array, so values are loaded one lane at a time. The interpolation
/// is the same for packets and for scalar lanes.
template <typename F>
inline void read_attribute(const AttributeView& view, uint32_t id, uint32_t width,
                           const MeshPosition<F>& mesh_position, const Mask<F>& active, F* out) {
  if (view.of_mesh == nullptr) return;
  using detail::InMemory;
  constexpr uint32_t kMax = 4;
  const InMemory<UInt<F>> mesh(mesh_position.mesh), prim(mesh_position.prim);
  InMemory<UInt<F>> found;
  alignas(64) float along[kWidth<F>];
  alignas(64) float corner[3][kMax][kWidth<F>] = {};
  store(along, mesh_position.u);
  const uint32_t bits = lane_bits<F>(active);
  for (size_t i = 0; i < kWidth<F>; ++i) {
    if ((bits >> i & 1u) == 0 || mesh.value[i] == kNoMesh) continue;
    const AttributeRecord* record = detail::find_attribute(view, mesh.value[i], id, width);
    if (record == nullptr) continue;
    found.value[i] = 1u;
    // A hit at an end of a curve may lie slightly beyond the end.
    if (record->rate == AttributeRate::kEnd) {
      if (!(along[i] > 0.f)) along[i] = 0.f;
      if (along[i] > 1.f) along[i] = 1.f;
    }
    size_t at[3];
    detail::corner_values(*record, prim.value[i], at);
    const auto* values = reinterpret_cast<const float*>(record->values);
    for (size_t k = 0; k < 3; ++k)
      for (uint32_t c = 0; c < width && c < kMax; ++c)
        corner[k][c][i] = values[at[k] * record->width + c];
  }
  const Mask<F> has = active & Mask<F>(load<UInt<F>>(found.value) != UInt<F>(0u));
  const F u = load<F>(along);
  for (uint32_t c = 0; c < width && c < kMax; ++c) {
    const F c0 = load<F>(corner[0][c]), c1 = load<F>(corner[1][c]), c2 = load<F>(corner[2][c]);
    out[c] = select(has, fma(F(c2 - c0), mesh_position.v, fma(F(c1 - c0), u, c0)), out[c]);
  }
}

}  // namespace wavecomb
