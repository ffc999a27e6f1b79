// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/geometry/tessellation/plain_mesh.h"

#include <algorithm>
#include <cmath>

#include "wavecomb/core/error.h"
#include "wavecomb/geometry/tessellation/quads.h"

namespace wavecomb {

void bake_points(std::span<const float> points, std::span<const double, 16> matrix,
                 std::span<float> out) {
  for (size_t i = 0; i + 2 < points.size(); i += 3) {
    const double x = points[i], y = points[i + 1], z = points[i + 2];
    for (size_t k = 0; k < 3; ++k) {
      const double turned = std::fma(z, matrix[8 + k], std::fma(y, matrix[4 + k], x * matrix[k]));
      // 0.0 avoids negative zeros
      out[i + k] = static_cast<float>((0.0 + turned) + matrix[12 + k]);
    }
  }
}

void bake_normals(std::span<const float> normals, std::span<const double, 16> inverse,
                  std::span<float> out) {
  for (size_t i = 0; i + 2 < normals.size(); i += 3) {
    const double x = normals[i], y = normals[i + 1], z = normals[i + 2];
    double turned[3];
    for (size_t k = 0; k < 3; ++k)
      turned[k] = 0.0 + std::fma(z, inverse[4 * k + 2],
                                 std::fma(y, inverse[4 * k + 1], x * inverse[4 * k]));
    const double length =
        std::sqrt(turned[0] * turned[0] + turned[1] * turned[1] + turned[2] * turned[2]);
    for (size_t k = 0; k < 3; ++k)
      out[i + k] = static_cast<float>(turned[k] / (length > 0 ? length : 1));
  }
}

std::optional<PointBounds> bounds_of(std::span<const float> points, double limit) {
  if (points.size() < 3) return std::nullopt;
  PointBounds bounds{{{points[0], points[1], points[2]}, {points[0], points[1], points[2]}}};
  bool is_near = true;
  for (size_t i = 0; i + 2 < points.size(); i += 3) {
    for (size_t k = 0; k < 3; ++k) {
      const float value = points[i + k];
      is_near = is_near && std::abs(static_cast<double>(value)) < limit;  // false for NaN
      bounds[0][k] = std::min(bounds[0][k], value);
      bounds[1][k] = std::max(bounds[1][k], value);
    }
  }
  return is_near ? std::optional(bounds) : std::nullopt;
}

uint32_t corners_of_faces(std::span<const int32_t> counts, std::span<const int32_t> indices,
                          size_t point_count) {
  if (counts.empty() || (counts[0] != 3 && counts[0] != 4)) return 0;
  const int32_t size = counts[0];
  if (indices.size() != counts.size() * static_cast<size_t>(size)) return 0;
  bool is_plain = true;
  for (const int32_t count : counts) is_plain = is_plain && count == size;
  uint32_t highest = 0;  // negative indices become large unsigned numbers
  for (const int32_t index : indices) highest = std::max(highest, static_cast<uint32_t>(index));
  return is_plain && highest < point_count ? static_cast<uint32_t>(size) : 0;
}

namespace {

bool is_identity(std::span<const double, 16> matrix) {
  for (size_t i = 0; i < 16; ++i)
    if (matrix[i] != (i % 5 == 0 ? 1.0 : 0.0)) return false;
  return true;
}

}  // namespace

size_t mark_used_points(std::span<const uint32_t> triangles, std::span<uint8_t> used) {
  size_t found = 0;
  for (const uint32_t point : triangles) {
    if (point >= used.size()) throw Error("a triangle has a point that is not there");
    found += 1 - used[point];
    used[point] = 1;
  }
  return found;
}

std::optional<PlainMesh> make_plain_mesh(std::span<const float> points,
                                         std::span<const int32_t> counts,
                                         std::span<const int32_t> indices,
                                         std::span<const double, 16> matrix, double limit) {
  PlainMesh mesh;
  mesh.corners_per_face = corners_of_faces(counts, indices, points.size() / 3);
  if (mesh.corners_per_face == 0) return std::nullopt;
  if (!is_identity(matrix)) {
    mesh.positions.resize(points.size());
    bake_points(points, matrix, mesh.positions);
  }
  const std::optional<PointBounds> bounds =
      bounds_of(mesh.positions.empty() ? points : mesh.positions, limit);
  if (!bounds) return std::nullopt;
  mesh.bounds = *bounds;
  if (mesh.corners_per_face == 4) {
    mesh.split = split_quads(points, indices, {});
    mesh.triangles.reserve(mesh.split.size());
    for (const int64_t corner : mesh.split)
      mesh.triangles.push_back(static_cast<uint32_t>(indices[static_cast<size_t>(corner)]));
  }
  return mesh;
}

PlainMeshes make_plain_meshes(std::span<const float> points, std::span<const int32_t> counts,
                              std::span<const int32_t> indices, std::span<const MeshSizes> sizes,
                              std::span<const double> matrices, double limit) {
  PlainMeshes out;
  for (const MeshSizes& size : sizes) {
    const std::span<const float> own = points.first(3 * size_t{size.points});
    const std::span<const int32_t> corners = indices.first(size.corners);
    const std::optional<PlainMesh> mesh =
        make_plain_mesh(own, counts.first(size.faces), corners, matrices.first<16>(), limit);
    if (!mesh) break;
    const std::span<const float> there = mesh->positions.empty() ? own : mesh->positions;
    out.positions.insert(out.positions.end(), there.begin(), there.end());
    const size_t first = out.triangles.size();
    if (mesh->corners_per_face == 4)
      out.triangles.insert(out.triangles.end(), mesh->triangles.begin(), mesh->triangles.end());
    else
      out.triangles.insert(out.triangles.end(), corners.begin(), corners.end());
    const std::span<const uint32_t> triangles = std::span(out.triangles).subspan(first);
    out.triangle_counts.push_back(static_cast<uint32_t>(triangles.size() / 3));
    out.bounds.push_back(mesh->bounds);
    std::vector<uint8_t> used(size.points, 0);
    out.uses_all_points.push_back(mark_used_points(triangles, used) == size.points);
    points = points.subspan(own.size());
    counts = counts.subspan(size.faces);
    indices = indices.subspan(corners.size());
    matrices = matrices.subspan(16);
  }
  return out;
}

}  // namespace wavecomb
