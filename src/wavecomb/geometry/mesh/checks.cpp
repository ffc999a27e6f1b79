// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/geometry/mesh/checks.h"

#include <algorithm>
#include <cmath>

#include "wavecomb/core/error.h"
#include "wavecomb/geometry/curve/checks.h"
#include "wavecomb/geometry/mesh/attributes.h"
#include "wavecomb/geometry/mesh/motion.h"
#include "wavecomb/scene/scene_checks.h"

namespace wavecomb {
namespace {

/// Throws Error unless an attribute array has `arity` floats per vertex or per corner.
void check_attribute(const Mesh& mesh, std::span<const float> values, Attribute at, size_t arity,
                     const char* what) {
  if (at == Attribute::kNone) return;
  const size_t want =
      arity * (at == Attribute::kVertex ? mesh.vertex_count() : mesh.indices.size());
  if (values.size() != want)
    throw Error(quoted("mesh", mesh.name) + " has " + std::to_string(values.size() / arity) + " " +
                what + " where " + std::to_string(want / arity) + " are needed");
}

}  // namespace

void check_mesh(const Mesh& mesh, const std::vector<std::string>& names) {
  const auto name = quoted("mesh", mesh.name);
  if (mesh.positions.size() % 3 != 0) throw Error(name + ": positions must be triples");
  if (mesh.is_curved()) {
    check_curves(mesh, name);
    check_attributes(mesh, name, names);
    return;
  }
  if (mesh.indices.size() % 3 != 0) throw Error(name + ": indices must be triples");
  if (mesh.steps < 1 || mesh.steps > kMostSteps || mesh.positions.size() % (3 * mesh.steps) != 0)
    throw Error(name + " needs as many points at each of 1 to " + std::to_string(kMostSteps) +
                " steps of its motion");
  if (mesh.vertex_count() > 0x7fffffffu / 3 || mesh.triangle_count() > 0x7fffffffu / 9)
    throw Error(name + " has too many points or triangles for 32-bit offsets; split it");
  for (float x : mesh.positions)
    if (!std::isfinite(x))
      throw Error(name + " has points that are not finite (NaN or infinite); fix or remove them");
  const size_t vertices = mesh.vertex_count();
  uint32_t highest = 0;
  for (uint32_t i : mesh.indices) highest = std::max(highest, i);
  if (!mesh.indices.empty() && highest >= vertices)
    throw Error(name + " has a face with vertex " + std::to_string(highest) + " but only " +
                std::to_string(vertices) + " points");
  check_attribute(mesh, mesh.normals, mesh.normals_at, size_t{3} * mesh.steps, "normals");
  check_attribute(mesh, mesh.uvs, mesh.uvs_at, 2, "texture coordinates");
  if (!mesh.face_materials.empty() && mesh.face_materials.size() != mesh.triangle_count())
    throw Error(name + " has " + std::to_string(mesh.face_materials.size()) +
                " face materials for " + std::to_string(mesh.triangle_count()) + " triangles");
  check_attributes(mesh, name, names);
}

}  // namespace wavecomb
