// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/geometry/curve/checks.h"

#include <cmath>

#include "wavecomb/core/error.h"
#include "wavecomb/geometry/curve/segment.h"
#include "wavecomb/geometry/gaussian_splat/gaussian_splat.h"

namespace wavecomb {

void check_curves(const Mesh& mesh, const std::string& name) {
  const bool points = mesh.is_dots();
  const size_t vertices = mesh.vertex_count();
  const auto need = [&](size_t has, size_t want, const char* what) {
    if (has != want)
      throw Error(name + " has " + std::to_string(has) + " " + what + " where " +
                  std::to_string(want) + " are needed");
  };
  if (vertices > kCurveFirstPoint / 4 || mesh.primitive_count() > kCurveFirstPoint / 4)
    throw Error(name + " has too many points for 32-bit offsets; split it");
  if (mesh.primitive == Primitive::kSplat) check_splats(mesh, name);
  need(mesh.radii.size(), vertices, "radii");
  if (mesh.is_ribbon()) need(mesh.normals.size(), 3 * vertices * mesh.steps, "normal coordinates");
  if (points) need(mesh.indices.size(), 0, "indices");
  if (mesh.uvs_at == Attribute::kVertex)
    throw Error(name + " has texture coordinates per vertex; give them per segment end or point");
  if (mesh.uvs_at == Attribute::kCorner)
    need(mesh.uvs.size(), (points ? 2 : 4) * mesh.primitive_count(), "texture coordinates");
  if (!mesh.face_materials.empty())
    need(mesh.face_materials.size(), mesh.primitive_count(), "materials of segments or points");
  for (const std::span<const float> values : {mesh.positions, mesh.normals})
    for (float x : values)
      if (!std::isfinite(x))
        throw Error(name + " has points or normals that are not finite; fix or remove them");
  for (float r : mesh.radii)
    if (!(r >= 0) || !std::isfinite(r))
      throw Error(name + " has a radius that is negative or not finite; give one of 0 or more");
  for (uint32_t word : mesh.indices) {
    const size_t first = word & kCurveFirstPoint;
    const size_t before = (word & kCurveGoesOnBefore) != 0 ? 1 : 0;
    const size_t after = (word & kCurveGoesOnAfter) != 0 ? 1 : 0;
    if (first < before || first + mesh.segment_points() + after > vertices)
      throw Error(name + " has a segment at control point " + std::to_string(first) + " but only " +
                  std::to_string(vertices) + " points");
  }
}

uint32_t curve_flags(const Mesh& mesh) {
  if (mesh.is_dots()) return mesh.primitive == Primitive::kSplat ? kIsSplat : kIsSphere;
  return (mesh.is_ribbon() ? kIsRibbon : kIsTube) | (mesh.is_cubic() ? kIsCubic : 0u);
}

}  // namespace wavecomb
