// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/geometry/tessellation/cage.h"

#include <algorithm>

#include "wavecomb/core/error.h"

namespace wavecomb {
namespace {

void check_points(std::span<const int32_t> points, uint32_t count, const char* what) {
  for (const int32_t p : points)
    if (p < 0 || static_cast<uint32_t>(p) >= count)
      throw Error(std::string(what) + " refers to a point that does not exist");
}

}  // namespace

void check_count(const char* things, size_t found, size_t needed) {
  if (found == needed) return;
  throw Error(std::string("the wrong number of ") + things + ", " + std::to_string(found) +
              " where the mesh needs " + std::to_string(needed));
}

void check_cage(const Cage& cage) {
  size_t at = 0;
  for (const int32_t size : cage.face_sizes) {
    if (size < 3) throw Error("a face has fewer than three corners");
    if (cage.scheme == Scheme::kLoop && size != 3)
      throw Error("Loop subdivision needs triangles, but a face is not a triangle");
    at += static_cast<size_t>(size);
  }
  if (at != cage.corners.size())
    throw Error("the face counts add up to " + std::to_string(at) + ", but there are " +
                std::to_string(cage.corners.size()) + " face indices");
  if (at == 0) throw Error("no faces");
  check_points(cage.corners, cage.vertex_count, "a face");
  at = 0;
  std::vector<int32_t> sorted;
  for (const int32_t size : cage.face_sizes) {
    const auto face = cage.corners.subspan(at, static_cast<size_t>(size));
    sorted.assign(face.begin(), face.end());
    std::sort(sorted.begin(), sorted.end());
    if (std::adjacent_find(sorted.begin(), sorted.end()) != sorted.end())
      throw Error("a face uses a point twice");
    at += static_cast<size_t>(size);
  }
  check_points(cage.crease_edges, cage.vertex_count, "a crease");
  check_points(cage.corner_vertices, cage.vertex_count, "a sharp corner");
  check_count("sharpnesses of creased edges", cage.crease_sharpness.size(),
              cage.crease_edges.size() / 2);
  check_count("sharpnesses of corners", cage.corner_sharpness.size(), cage.corner_vertices.size());
  for (const FaceVaryingIndices& channel : cage.channels) {
    check_count("indices of a face-varying primvar", channel.indices.size(), cage.corners.size());
    check_points(channel.indices, channel.value_count, "a face-varying primvar");
  }
}

Welded weld_corners(std::span<const int32_t> corners, uint32_t vertex_count,
                    std::span<const float> values, uint32_t width) {
  check_points(corners, vertex_count, "a face");
  check_count("components of a face-varying primvar", values.size(), corners.size() * width);
  Welded out;
  out.indices.resize(corners.size());
  // For each point, a linked list of those previous corners that introduced a new value.
  constexpr uint32_t kEnd = ~0u;
  std::vector<uint32_t> first(vertex_count, kEnd), next(corners.size(), kEnd);
  for (size_t c = 0; c < corners.size(); ++c) {
    const float* own = values.data() + c * width;
    uint32_t* link = &first[static_cast<size_t>(corners[c])];
    while (*link != kEnd && !std::equal(own, own + width, values.data() + size_t{*link} * width))
      link = &next[*link];
    if (*link != kEnd) {
      out.indices[c] = out.indices[*link];
      continue;
    }
    *link = static_cast<uint32_t>(c);
    out.indices[c] = static_cast<int32_t>(out.values.size() / width);
    out.values.insert(out.values.end(), own, own + width);
  }
  return out;
}

}  // namespace wavecomb
