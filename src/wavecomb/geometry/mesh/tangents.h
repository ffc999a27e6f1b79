// SPDX-License-Identifier: Apache-2.0
/// Mesh tangents along u that vary smoothly over triangles, as normals do.
///
/// Tangents follow MikkTSpace, the convention for which normal maps are baked (M. Mikkelsen,
/// "Simulation of Wrinkled Surfaces Revisited", 2008). Corners of a vertex with the same texture
/// coordinates, normal and texture orientation share one tangent. The shared tangent is the mean of
/// the tangents of the corners' triangles, each projected to the plane of the normal and weighted
/// by the triangle's angle at the corner. Tangents are therefore split at texture seams, where the
/// texture is mirrored, and at hard edges.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "wavecomb/geometry/mesh/mesh.h"

namespace wavecomb {

struct SceneGeometry;
struct SceneMaterials;

/// Tangents of one mesh in its local space, encoded by core/encoding/octahedral.h. The code is
/// kNoDirection where tangents cancel out and on triangles without area in texture space.
struct MeshTangents {
  /// One encoded tangent per vertex or corner, for each motion step in turn.
  std::vector<uint32_t> codes;
  bool at_corners = false;  ///< whether some vertex has more than one tangent
};

/// Makes the tangents of a mesh with normals and texture coordinates. The function runs in
/// parallel; the result does not depend on the number of threads.
MeshTangents make_tangents(const Mesh& mesh);

/// Packed reference to the tangents of a mesh.
struct TangentRecord {
  uint64_t codes = 0;     ///< address of the tangent codes, or 0 if the mesh has no tangents
  uint32_t step = 0;      ///< number of codes per motion step, for a mesh that deforms
  uint32_t segments = 0;  ///< number of motion steps minus one
  uint32_t at_corners = 0;
  uint32_t pad = 0;
};

/// Tangents of the meshes with a material that needs them: a material that is anisotropic, has a
/// normal map, or has a graph that reads tangents. Other meshes use no memory for tangents.
struct SceneTangents {
  /// Makes the tangents of a scene. `before` holds the tangents of a scene with the same geometry,
  /// which are reused where possible; it may be null.
  SceneTangents(const SceneGeometry& geometry, const SceneMaterials& materials,
                const SceneTangents* before);

  /// Tangents of each mesh, or null for a mesh without tangents; empty if no mesh has tangents.
  std::vector<std::shared_ptr<const MeshTangents>> of_mesh;
  /// Packed reference for each mesh; empty if no mesh has tangents.
  std::vector<TangentRecord> records;
  uint64_t bytes() const;
};

}  // namespace wavecomb
