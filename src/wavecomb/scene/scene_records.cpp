// SPDX-License-Identifier: Apache-2.0
/// SceneBuilder: packs meshes and instances.
#include <algorithm>
#include <cmath>

#include "wavecomb/geometry/curve/checks.h"
#include "wavecomb/geometry/mesh/attributes.h"
#include "wavecomb/scene/object_bounds.h"
#include "wavecomb/scene/parallel.h"
#include "wavecomb/scene/scene.h"

namespace wavecomb {
namespace {

uint64_t address(const void* p) {
  return reinterpret_cast<uint64_t>(p);
}

/// Returns sqrt(uv area / area) of the whole mesh, or 0 if the mesh has no uvs.
float uv_density(const Mesh& mesh) {
  if (mesh.uvs_at == Attribute::kNone || mesh.is_curved()) return 0;
  double area = 0, uv_area = 0;
  for (size_t f = 0; f < mesh.triangle_count(); ++f) {
    const float *p[3], *t[3];
    for (size_t k = 0; k < 3; ++k) {
      const size_t vertex = mesh.indices[3 * f + k];
      p[k] = &mesh.positions[3 * vertex];
      t[k] = &mesh.uvs[2 * (mesh.uvs_at == Attribute::kCorner ? 3 * f + k : vertex)];
    }
    const double a[3] = {double{p[1][0]} - p[0][0], double{p[1][1]} - p[0][1],
                         double{p[1][2]} - p[0][2]};
    const double b[3] = {double{p[2][0]} - p[0][0], double{p[2][1]} - p[0][1],
                         double{p[2][2]} - p[0][2]};
    const double x = a[1] * b[2] - a[2] * b[1], y = a[2] * b[0] - a[0] * b[2],
                 z = a[0] * b[1] - a[1] * b[0];
    area += std::sqrt(x * x + y * y + z * z);
    uv_area += std::abs((double{t[1][0]} - t[0][0]) * (double{t[2][1]} - t[0][1]) -
                        (double{t[1][1]} - t[0][1]) * (double{t[2][0]} - t[0][0]));
  }
  const double density = area > 0 ? std::sqrt(uv_area / area) : 0;
  return std::isfinite(density) ? static_cast<float>(density) : 0.f;
}

MeshRecord make_mesh_record(const Mesh& mesh) {
  MeshRecord r{};
  r.positions = address(mesh.positions.data());
  r.indices = address(mesh.indices.data());
  r.normals = address(mesh.normals.data());
  r.uvs = address(mesh.uvs.data());
  r.face_materials = address(mesh.face_materials.empty() ? nullptr : mesh.face_materials.data());
  r.radii = address(mesh.radii.data());
  if (mesh.primitive == Primitive::kGaussianSplat) {
    r.normals = address(mesh.splats.data());
    r.uvs = address(mesh.harmonics.data());
    r.flags |= mesh.harmonics_degree << kHarmonicsShift;
  }
  r.material = mesh.material;
  r.uv_density = uv_density(mesh);
  if (mesh.normals_at == Attribute::kVertex) r.flags |= kNormalsPerVertex;
  if (mesh.normals_at == Attribute::kCorner) r.flags |= kNormalsPerCorner;
  if (mesh.uvs_at == Attribute::kVertex) r.flags |= kUvsPerVertex;
  if (mesh.uvs_at == Attribute::kCorner) r.flags |= kUvsPerCorner;
  if (mesh.is_curved()) r.flags |= curve_flags(mesh);
  return r;
}

/// Returns the distinct values of `all` in ascending order.
std::vector<uint32_t> distinct(std::span<const uint32_t> all) {
  std::vector<uint32_t> values;
  for (uint32_t value : all)
    if (values.empty() || values.back() != value) values.push_back(value);
  std::sort(values.begin(), values.end());
  values.erase(std::unique(values.begin(), values.end()), values.end());
  values.shrink_to_fit();
  return values;
}

InstanceRecord make_instance_record(const Affine& m, uint32_t material) {
  InstanceRecord r{};
  for (int i = 0; i < 3; ++i) {
    r.to_world[4 * i] = m.row[i].x;
    r.to_world[4 * i + 1] = m.row[i].y;
    r.to_world[4 * i + 2] = m.row[i].z;
  }
  r.to_world[3] = m.t.x;
  r.to_world[7] = m.t.y;
  r.to_world[11] = m.t.z;
  r.material = material;
  r.side = m.determinant() < 0 ? -1.f : 1.f;
  return r;
}

}  // namespace

void SceneBuilder::make_records(SceneGeometry& geometry, uint32_t grey) const {
  const std::vector<Mesh>& meshes = geometry.meshes;
  geometry.mesh_records.resize(meshes.size());
  geometry.mesh_motions.resize(1);
  geometry.face_materials.resize(meshes.size());
  parallel_for(meshes.size(), [&](size_t m) {
    geometry.mesh_records[m] = make_mesh_record(meshes[m]);
    geometry.face_materials[m] = distinct(meshes[m].face_materials);
  });
  for (size_t m = 0; m < meshes.size(); ++m) {
    const Mesh& mesh = meshes[m];
    if (!mesh.deforms()) continue;
    geometry.mesh_records[m].motion = static_cast<uint32_t>(geometry.mesh_motions.size());
    geometry.mesh_motions.push_back({mesh.positions.size_bytes() / mesh.steps,
                                     mesh.normals.size_bytes() / mesh.steps, mesh.steps - 1, 0});
  }
  make_attribute_records(geometry);
  for (const auto& texture : geometry.textures) geometry.texture_views.push_back(texture->view());
  geometry.mesh_boxes.resize(meshes.size());
  parallel_for(meshes.size(), [&](size_t m) { geometry.mesh_boxes[m] = mesh_bounds(meshes[m]); });
  for (const Volume& volume : geometry.volumes)
    geometry.volume_records.push_back(make_volume_record(volume));
  geometry.instance_records.push_back(make_instance_record(Affine{}, grey));
  place_instances(geometry);
}

void place_instances(SceneGeometry& geometry) {
  geometry.geometry_mesh.clear();
  geometry.instance_motions.clear();
  geometry.instance_records.resize(1);
  std::vector<uint32_t> first;
  std::vector<Bounds> boxes(geometry.groups.size());
  for (size_t g = 0; g < geometry.groups.size(); ++g) {
    first.push_back(static_cast<uint32_t>(geometry.geometry_mesh.size()));
    const auto& in_group = geometry.groups[g].meshes;
    geometry.geometry_mesh.insert(geometry.geometry_mesh.end(), in_group.begin(), in_group.end());
    for (const uint32_t mesh : in_group) boxes[g].add(geometry.mesh_boxes[mesh]);
  }
  geometry.instance_records.reserve(geometry.instances.size() + 1);
  if (!geometry.steps.empty()) {
    geometry.instance_motions.resize(1);
    for (const Instance& i : geometry.instances) geometry.instance_motions.push_back(i.motion);
  }
  geometry.bounds = boxes[0];
  auto emissive = static_cast<uint32_t>(geometry.groups[0].meshes.size());
  for (const Instance& i : geometry.instances) {
    InstanceRecord r = make_instance_record(i.to_world, i.material);
    r.geometry = first[i.group];
    r.emissive = emissive;
    emissive += static_cast<uint32_t>(geometry.groups[i.group].meshes.size());
    geometry.instance_records.push_back(r);
    add_instance_bounds(geometry.bounds, boxes[i.group], i, geometry.steps);
  }
  for (const Volume& volume : geometry.volumes)
    for (const Vec3<float>& corner : volume_corners(volume)) geometry.bounds.add(corner);
  if (geometry.bounds.empty()) return;
  const Bounds& b = geometry.bounds;
  const Vec3<float> d = b.hi - (b.lo + b.hi) * 0.5f;
  geometry.radius = std::max(1e-20f, std::sqrt(d.x * d.x + d.y * d.y + d.z * d.z));
}

}  // namespace wavecomb
