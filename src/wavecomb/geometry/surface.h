// SPDX-License-Identifier: Apache-2.0
/// A subdivision surface, or displaced polygons, as a triangle mesh.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "wavecomb/geometry/subdivision.h"
#include "wavecomb/scene/material_data.h"

namespace wavecomb {

/// How far points move along their normals: a constant, or a texture where there is one.
struct Displacement {
  float constant = 0;
  TextureUse use;
  const TextureView* texture = nullptr;

  /// At texture coordinates of the mesh.
  float at(float u, float v) const;
};

/// Where the values of a primvar are.
enum class PrimvarKind : uint8_t { kNone, kVertex, kVarying, kFaceVarying };

struct SurfacePrimvar {
  PrimvarKind kind = PrimvarKind::kNone;
  /// (points, width), or of its channel; face-varying ones at level 0, but for uvs: (triangles, 3,
  /// width).
  std::span<const float> values;
  uint32_t width = 1;
  uint32_t channel = 0;  ///< of Cage::channels, where it is face-varying
};

/// What a surface is made from. Arrays are the caller's.
struct SurfaceDesc {
  Cage cage;
  std::span<const float> points;  ///< 3 for each point of the cage
  /// 0: no subdivision, the triangles below; only for polygons that are displaced.
  uint32_t level = 1;
  std::span<const uint32_t> triangles;         ///< level 0: 3 points each
  std::span<const uint32_t> triangle_faces;    ///< level 0: their faces
  std::span<const uint32_t> triangle_corners;  ///< level 0: 3 each, of the face-varying values
  SurfacePrimvar uvs;
  std::vector<SurfacePrimvar> primvars;
  std::vector<Displacement> displacements;
  /// Of each face of the cage, an index into displacements or -1; empty: all have the first.
  std::span<const int32_t> face_displacement;
  /// From the cage's space to the mesh's, row vectors: p' = p M.
  std::array<double, 16> matrix{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};
  bool left_handed = false;
};

/// Values of a primvar on triangles: (points, width), or (triangles, 3, width) where corners of a
/// point differ.
struct SurfaceValues {
  std::vector<float> values;
  bool per_corner = false;
};

/// Triangles with values per point: where a normal or a texture coordinate differs between faces,
/// the point is there once for each, at the same place bit for bit.
struct SurfaceMesh {
  std::vector<float> positions, normals, uvs;  ///< 3, 3, 2 for each point; uvs may be empty
  std::vector<uint32_t> triangles;             ///< counter-clockwise from outside
  std::vector<uint32_t> faces;                 ///< face of the cage of each triangle
  std::vector<SurfaceValues> primvars;         ///< one for each of SurfaceDesc::primvars
  bool is_manifold = true;
};

/// Makes the triangles. Points lie on the limit surface, and normals are the limit's; displaced
/// points lie off it, along its normals, by the mean of what the faces around them say, so that no
/// seam of texture coordinates or materials opens; normals are then those of the displaced
/// triangles. Throws Error, one line, where the cage is no good.
SurfaceMesh make_surface(const SurfaceDesc& desc);

}  // namespace wavecomb
