// SPDX-License-Identifier: Apache-2.0
/// Packed mesh attributes (primvars).
#pragma once

#include <cstdint>

namespace wavecomb {

inline constexpr uint32_t kNoAttribute = 0xffffffffu;
/// Mesh index of points without a mesh, which have no attributes in any scene.
inline constexpr uint32_t kNoMesh = 0xffffffffu;

/// Interpolation of an attribute.
enum class AttributeRate : uint32_t {
  kConstant,   ///< one value per mesh
  kPrimitive,  ///< one value per triangle, curve segment or point
  kVertex,     ///< one value per vertex of a triangle mesh
  kCorner,     ///< three values per triangle, in corner order
  kEnd,        ///< two values per curve segment
};

/// Attribute of a mesh. The attribute records of a mesh are contiguous and end with a record whose
/// id is kNoAttribute.
struct AttributeRecord {
  uint64_t values;  ///< address of an array of floats, with `width` floats per value
  /// address of an array with three vertex indices per triangle; only for kVertex
  uint64_t indices;
  uint32_t id;
  AttributeRate rate;
  uint32_t width;
  uint32_t pad;
};
static_assert(sizeof(AttributeRecord) == 32);

/// Read-only view of all attributes for kernels.
struct AttributeView {
  const AttributeRecord* records = nullptr;
  const uint32_t* of_mesh = nullptr;  ///< first record of each mesh; null if no mesh has attributes
};

}  // namespace wavecomb
