// SPDX-License-Identifier: Apache-2.0
/// Values that vary over meshes (primvars), as data.
#pragma once

#include <cstdint>

namespace wavecomb {

inline constexpr uint32_t kNoAttribute = 0xffffffffu;
/// A mesh that has no attributes, whatever the scene.
inline constexpr uint32_t kNoMesh = 0xffffffffu;

/// Where the values of an attribute are.
enum class AttributeRate : uint32_t {
  kConstant,   ///< one for all
  kPrimitive,  ///< one per triangle, segment of a curve, or point
  kVertex,     ///< one per vertex of triangles
  kCorner,     ///< 3 per triangle in order
  kEnd,        ///< 2 per segment of a curve
};

/// An attribute of a mesh. Those of one mesh lie side by side; behind the last is one with the id
/// kNoAttribute.
struct AttributeRecord {
  uint64_t values;   ///< floats, `width` for each value
  uint64_t indices;  ///< kVertex: 3 per triangle
  uint32_t id;
  AttributeRate rate;
  uint32_t width;
  uint32_t pad;
};
static_assert(sizeof(AttributeRecord) == 32);

/// What kernels need of all attributes.
struct AttributeView {
  const AttributeRecord* records = nullptr;
  const uint32_t* of_mesh = nullptr;  ///< first record of each mesh; null: no mesh has any
};

}  // namespace wavecomb
