// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/geometry/mesh/tangents.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "wavecomb/core/encoding/octahedral.h"
#include "wavecomb/scene/parallel.h"
#include "wavecomb/scene/scene_parts.h"

namespace wavecomb {
namespace {

using V = Vec3<float>;
/// `kBatch` triangles are processed at a time, to limit the memory for their tangents. Each
/// parallel task processes `kChunk` triangles of a batch.
constexpr size_t kBatch = 65536, kChunk = 1024;
/// If the length of a weighted sum of tangents is below this fraction of the sum of the weights,
/// its direction is not reliable.
constexpr float kMinMean = 1e-2f;

V unit(const V& v) {
  const float len2 = length_squared(v);
  return len2 > 0 && std::isfinite(len2) ? v * (1 / std::sqrt(len2)) : V(0.f);
}

/// Reads mesh arrays at triangle corners.
class Corners {
 public:
  explicit Corners(const Mesh& mesh) : mesh_(mesh) {}

  uint32_t vertex(size_t corner) const { return mesh_.indices[corner]; }
  std::array<float, 2> uv(size_t corner) const {
    const float* p = &mesh_.uvs[2 * value_index(mesh_.uvs_at, corner)];
    return {p[0], p[1]};
  }
  V position(size_t corner, uint32_t step) const {
    return row(mesh_.positions, vertex(corner), step);
  }
  V normal(size_t corner, uint32_t step) const {
    return row(mesh_.normals, value_index(mesh_.normals_at, corner), step);
  }
  /// Returns twice the signed area of a triangle in texture space, which is negative if the texture
  /// is mirrored.
  float uv_area(size_t triangle) const {
    const auto a = uv(3 * triangle), b = uv(3 * triangle + 1), c = uv(3 * triangle + 2);
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
  }
  /// Returns the normalised dp/du of a triangle, or zero if dp/du has no direction.
  V tangent(size_t triangle, uint32_t step) const {
    const auto a = uv(3 * triangle), b = uv(3 * triangle + 1), c = uv(3 * triangle + 2);
    const V p = position(3 * triangle, step);
    const V e1 = position(3 * triangle + 1, step) - p, e2 = position(3 * triangle + 2, step) - p;
    const float area = uv_area(triangle);
    if (area == 0) return V(0.f);
    const V t = unit(e1 * (c[1] - a[1]) - e2 * (b[1] - a[1]));
    return area < 0 ? -t : t;
  }

 private:
  size_t value_index(Attribute at, size_t corner) const {
    return at == Attribute::kCorner ? corner : mesh_.indices[corner];
  }
  V row(std::span<const float> values, size_t index, uint32_t step) const {
    const float* p = &values[values.size() / mesh_.steps * step + 3 * index];
    return {p[0], p[1], p[2]};
  }

  const Mesh& mesh_;
};

/// Returns the contributions of a triangle to the mean tangents of its corners.
std::array<V, 3> contributions(const Corners& at, size_t triangle, uint32_t step) {
  std::array<V, 3> out;
  const V t = at.tangent(triangle, step);
  if (length_squared(t) == 0) return out;
  V p[3];
  for (size_t k = 0; k < 3; ++k) p[k] = at.position(3 * triangle + k, step);
  for (size_t k = 0; k < 3; ++k) {
    const V n = unit(at.normal(3 * triangle + k, step));
    const auto project = [&](const V& v) { return V(v - n * dot(n, v)); };
    const V a = project(p[(k + 1) % 3] - p[k]), b = project(p[(k + 2) % 3] - p[k]);
    const float angle = atan2(length(cross(a, b)), dot(a, b));
    if (std::isfinite(angle)) out[k] = unit(project(t)) * angle;
  }
  return out;
}

/// Group of corners that share a tangent.
struct Share {
  uint32_t corner;  ///< first corner of the group
  uint32_t next;    ///< next group at the same vertex, or kNone
};
constexpr uint32_t kNone = 0xffffffffu;

/// Groups the corners that share tangents, and writes the group of each corner to `of_corner`.
std::vector<Share> share_corners(const Mesh& mesh, const Corners& at,
                                 std::vector<uint32_t>& of_corner) {
  std::vector<Share> shares;
  std::vector<uint32_t> first(mesh.vertex_count(), kNone);
  const auto same = [&](size_t a, size_t b) {
    const V n = at.normal(a, 0), m = at.normal(b, 0);
    if (at.uv(a) != at.uv(b) || n.x != m.x || n.y != m.y || n.z != m.z) return false;
    // A triangle without area in texture space has no orientation and matches both orientations.
    const float s = at.uv_area(a / 3), t = at.uv_area(b / 3);
    return s == 0 || t == 0 || (s < 0) == (t < 0);
  };
  of_corner.resize(mesh.indices.size());
  for (uint32_t corner = 0; corner < of_corner.size(); ++corner) {
    uint32_t* link = &first[at.vertex(corner)];
    while (*link != kNone && !same(shares[*link].corner, corner)) link = &shares[*link].next;
    if (*link == kNone) {
      *link = static_cast<uint32_t>(shares.size());
      of_corner[corner] = *link;
      shares.push_back({corner, kNone});
    } else {
      of_corner[corner] = *link;
    }
  }
  return shares;
}

struct Sum {
  V v;
  float weight = 0;
};

/// Returns the mean tangent of each corner group at one motion step.
std::vector<Sum> add_up(const Mesh& mesh, const Corners& at, uint32_t step,
                        const std::vector<uint32_t>& of_corner, size_t share_count) {
  std::vector<Sum> sums(share_count);
  const size_t triangles = mesh.triangle_count();
  std::vector<std::array<V, 3>> scratch(std::min(triangles, kBatch));
  for (size_t from = 0; from < triangles; from += kBatch) {
    const size_t n = std::min(kBatch, triangles - from);
    parallel_for((n + kChunk - 1) / kChunk, [&](size_t chunk) {
      for (size_t i = chunk * kChunk; i < std::min(n, (chunk + 1) * kChunk); ++i)
        scratch[i] = contributions(at, from + i, step);
    });
    for (size_t i = 0; i < n; ++i)
      for (size_t k = 0; k < 3; ++k) {
        Sum& sum = sums[of_corner[3 * (from + i) + k]];
        sum.v += scratch[i][k];
        sum.weight += length(scratch[i][k]);
      }
  }
  return sums;
}

/// Returns for each mesh whether one of its materials needs tangents.
std::vector<uint8_t> meshes_with_tangents(const SceneGeometry& geometry,
                                          const SceneMaterials& materials) {
  const std::vector<Mesh>& meshes = geometry.meshes;
  std::vector<uint8_t> needs_tangents(meshes.size());
  const auto visit = [&](uint32_t group, uint32_t inherited) {
    for (const uint32_t m : geometry.groups[group].meshes)
      if (!needs_tangents[m] && meshes[m].normals_at != Attribute::kNone &&
          meshes[m].uvs_at != Attribute::kNone && !meshes[m].is_curved())
        needs_tangents[m] = geometry.any_material(m, inherited, [&](uint32_t bound_material) {
          return materials.wants_tangents[bound_material] != 0;
        });
  };
  // Skip instances with the same group and material as the previous instance.
  visit(0, geometry.instance_records[0].material);
  uint32_t group = kNone, material = kNone;
  for (const Instance& i : geometry.instances) {
    if (i.group == group && i.material == material) continue;
    group = i.group;
    material = i.material;
    visit(group, material);
  }
  return needs_tangents;
}

}  // namespace

MeshTangents make_tangents(const Mesh& mesh) {
  MeshTangents out;
  const Corners at(mesh);
  std::vector<uint32_t> of_corner;
  const std::vector<Share> shares = share_corners(mesh, at, of_corner);
  out.at_corners = std::ranges::any_of(shares, [](const Share& s) { return s.next != kNone; });
  const size_t a_step = out.at_corners ? of_corner.size() : mesh.vertex_count();
  out.codes.assign(a_step * mesh.steps, kNoDirection);
  for (uint32_t step = 0; step < mesh.steps; ++step) {
    const std::vector<Sum> sums = add_up(mesh, at, step, of_corner, shares.size());
    const auto code = [&](uint32_t share) {
      const Sum& sum = sums[share];
      return length(sum.v) > kMinMean * sum.weight ? encode_direction(sum.v) : kNoDirection;
    };
    uint32_t* to = &out.codes[a_step * step];
    if (out.at_corners)
      for (size_t corner = 0; corner < of_corner.size(); ++corner)
        to[corner] = code(of_corner[corner]);
    else
      for (uint32_t s = 0; s < shares.size(); ++s) to[at.vertex(shares[s].corner)] = code(s);
  }
  return out;
}

SceneTangents::SceneTangents(const SceneGeometry& geometry, const SceneMaterials& materials,
                             const SceneTangents* before) {
  if (std::ranges::all_of(materials.wants_tangents, [](uint8_t wants) { return wants == 0; }))
    return;
  const std::vector<uint8_t> needs_tangents = meshes_with_tangents(geometry, materials);
  if (std::ranges::all_of(needs_tangents, [](uint8_t a) { return a == 0; })) return;
  of_mesh.resize(needs_tangents.size());
  records.resize(needs_tangents.size());
  parallel_for(needs_tangents.size(), [&](size_t m) {
    if (!needs_tangents[m]) return;
    if (before && !before->of_mesh.empty()) of_mesh[m] = before->of_mesh[m];
    if (!of_mesh[m])
      of_mesh[m] = std::make_shared<const MeshTangents>(make_tangents(geometry.meshes[m]));
    const Mesh& mesh = geometry.meshes[m];
    const std::vector<uint32_t>& codes = of_mesh[m]->codes;
    records[m] = {.codes = reinterpret_cast<uint64_t>(codes.data()),
                  .step = static_cast<uint32_t>(codes.size() / mesh.steps),
                  .segments = mesh.steps - 1,
                  .at_corners = of_mesh[m]->at_corners ? 1u : 0u};
  });
}

uint64_t SceneTangents::bytes() const {
  uint64_t sum = records.size() * sizeof(records[0]) + of_mesh.size() * sizeof(of_mesh[0]);
  for (const auto& mesh : of_mesh)
    if (mesh) sum += mesh->codes.size() * sizeof(uint32_t);
  return sum;
}

}  // namespace wavecomb
