// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/geometry/mesh/attributes.h"

#include <algorithm>
#include <cmath>

#include "wavecomb/core/error.h"

namespace wavecomb {
namespace {

uint64_t address(const void* p) {
  return reinterpret_cast<uint64_t>(p);
}

/// Returns the number of values that an attribute of the given rate has on a mesh; 0 if the mesh
/// does not support the rate.
size_t value_count(const Mesh& mesh, AttributeRate rate) {
  const bool strands = mesh.is_strands();
  switch (rate) {
    case AttributeRate::kConstant:
      return 1;
    case AttributeRate::kPrimitive:
      return mesh.primitive_count();
    case AttributeRate::kVertex:
      return mesh.is_curved() ? 0 : mesh.vertex_count();
    case AttributeRate::kCorner:
      return 3 * mesh.triangle_count();
    case AttributeRate::kEnd:
      return strands ? 2 * mesh.primitive_count() : 0;
  }
  return 0;
}

}  // namespace

void check_attributes(const Mesh& mesh, const std::string& name,
                      const std::vector<std::string>& names) {
  for (const MeshAttribute& a : mesh.attributes) {
    if (a.id >= names.size()) throw Error(name + " has an attribute whose name was never added");
    const std::string where = name + " has the attribute '" + names[a.id] + "'";
    if (a.width < 1 || a.width > 4) throw Error(where + ", which needs 1 to 4 components");
    const size_t want = value_count(mesh, a.rate) * a.width;
    if (want == 0 && mesh.primitive_count() > 0)
      throw Error(where + " at a rate that this type of mesh does not support");
    if (a.values.size() != want)
      throw Error(where + " with " + std::to_string(a.values.size() / a.width) + " values where " +
                  std::to_string(want / a.width) + " are needed");
    for (const float value : a.values)
      if (!std::isfinite(value))
        throw Error(where + " with values that are not finite; fix or remove them");
  }
}

void make_attribute_records(SceneGeometry& geometry) {
  const std::vector<Mesh>& meshes = geometry.meshes;
  if (std::ranges::all_of(meshes, [](const Mesh& mesh) { return mesh.attributes.empty(); })) return;
  const AttributeRecord end{0, 0, kNoAttribute, AttributeRate::kConstant, 0, 0};
  geometry.attribute_records.push_back(end);  // the empty list of meshes without attributes
  geometry.mesh_attributes.resize(meshes.size());
  for (size_t m = 0; m < meshes.size(); ++m) {
    if (meshes[m].attributes.empty()) continue;
    geometry.mesh_attributes[m] = static_cast<uint32_t>(geometry.attribute_records.size());
    for (const MeshAttribute& a : meshes[m].attributes)
      geometry.attribute_records.push_back(
          {address(a.values.data()), address(meshes[m].indices.data()), a.id, a.rate, a.width, 0});
    geometry.attribute_records.push_back(end);
  }
}

}  // namespace wavecomb
