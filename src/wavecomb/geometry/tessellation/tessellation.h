// SPDX-License-Identifier: Apache-2.0
/// Conversion of subdivision surfaces and displaced polygons to triangle meshes.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "wavecomb/geometry/tessellation/subdivision.h"
#include "wavecomb/material/description/material.h"

namespace wavecomb {

/// Displacement along the normal: a texture if there is one, else a constant.
struct Displacement {
  float constant = 0;
  TextureUse use;
  const TextureView* texture = nullptr;

  /// Returns the distance at texture coordinates (u, v) of the mesh.
  float at(float u, float v) const;
};

/// Interpolation of a primvar.
enum class PrimvarKind : uint8_t { kNone, kVertex, kVarying, kFaceVarying };

/// Values of a primvar on the cage, or on triangles if the surface is not subdivided (level 0).
struct SurfacePrimvar {
  PrimvarKind kind = PrimvarKind::kNone;
  /// Array of shape (points, width). For face-varying primvars, the array has one row per value of
  /// the channel. At level 0, face-varying values other than uvs have the shape (triangles, 3,
  /// width).
  std::span<const float> values;
  uint32_t width = 1;
  uint32_t channel = 0;  ///< index into Cage::channels, for face-varying primvars
};

/// Description of a surface, the input of make_surface(). The caller owns the arrays.
struct SurfaceDesc {
  Cage cage;
  std::span<const float> points;  ///< 3 coordinates per point of the cage
  /// Subdivision level; 0 means that the triangles in `triangles` are displaced without
  /// subdivision.
  uint32_t level = 1;
  std::span<const uint32_t> triangles;       ///< level 0 only: 3 point indices per triangle
  std::span<const uint32_t> triangle_faces;  ///< level 0 only: cage face of each triangle
  /// Level 0 only: 3 indices of face-varying values per triangle.
  std::span<const uint32_t> triangle_corners;
  SurfacePrimvar uvs;
  std::vector<SurfacePrimvar> primvars;
  std::vector<Displacement> displacements;
  /// Index into `displacements` for each face of the cage, or -1 for no displacement. If empty, all
  /// faces use the first displacement.
  std::span<const int32_t> face_displacement;
  /// Transform from cage to mesh space, for row vectors: p' = p M.
  std::array<double, 16> matrix{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};
  bool left_handed = false;
};

/// Values of a primvar on triangles. The shape is (points, width), or (triangles, 3, width) if
/// `per_corner` is true because corners of the same point have different values.
struct SurfaceValues {
  std::vector<float> values;
  bool per_corner = false;
};

/// Triangle mesh with values per point. A vertex is duplicated, with bitwise equal positions, where
/// normals or texture coordinates differ between faces.
struct SurfaceMesh {
  std::vector<float> positions, normals, uvs;  ///< 3, 3 and 2 floats per point; `uvs` may be empty
  /// 3 point indices per triangle, counter-clockwise as seen from outside.
  std::vector<uint32_t> triangles;
  std::vector<uint32_t> faces;          ///< index of the cage face of each triangle
  std::vector<SurfaceValues> primvars;  ///< values of each primvar in SurfaceDesc::primvars
  bool is_manifold = true;
};

/// Triangulates the surface. Points lie on the limit surface and have the normals of the limit
/// surface. Displaced points move along the limit normal by the mean displacement of the adjacent
/// faces, so that no gaps open at seams of texture coordinates or materials. Normals of displaced
/// points are computed from the displaced triangles. Throws Error with a one-line description if
/// the input is invalid.
SurfaceMesh make_surface(const SurfaceDesc& desc);

}  // namespace wavecomb
