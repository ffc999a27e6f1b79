// SPDX-License-Identifier: Apache-2.0
/// Tangents of meshes along u that vary smoothly over triangles, as normals do.
///
/// Those of MikkTSpace, which normal maps are baked with (M. Mikkelsen, "Simulation of Wrinkled
/// Surfaces Revisited", 2008): corners of one vertex with the same texture coordinates, the same
/// normal and the same side of the texture share one. It is the mean of their triangles' tangents,
/// each laid into the plane of the normal, weighted by the triangle's angle there. So it is split
/// where the texture has a seam or is mirrored, and where the surface has an edge.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "wavecomb/scene/mesh.h"

namespace wavecomb {

struct SceneGeometry;
struct SceneMaterials;

/// Tangents of one mesh: codes of core/octahedral.h in the mesh's space. Those that cancel out, and
/// those of triangles without area in the texture, are kNoDirection.
struct MeshTangents {
  std::vector<uint32_t> codes;  ///< one a vertex or a corner, step by step
  bool at_corners = false;      ///< where some vertex has more than one
};

/// Tangents of a mesh that has normals and texture coordinates; it shares its loops among threads,
/// and the bits do not depend on them.
MeshTangents make_tangents(const Mesh& mesh);

/// Tangents of a mesh as lanes read them.
struct TangentRecord {
  uint64_t codes = 0;     ///< address; 0: the mesh has none
  uint32_t step = 0;      ///< codes from one step of a mesh that deforms to the next
  uint32_t segments = 0;  ///< steps less one
  uint32_t at_corners = 0;
  uint32_t pad = 0;
};

/// Tangents of the meshes that wear a material which asks for them: one that is anisotropic, has a
/// normal map, or reads tangents in a graph. Other meshes do not pay.
struct SceneTangents {
  /// `before`: of a scene with the same geometry, to take over what is the same; or null.
  SceneTangents(const SceneGeometry& geometry, const SceneMaterials& materials,
                const SceneTangents* before);

  std::vector<std::shared_ptr<const MeshTangents>> of_mesh;  ///< null: none; empty: no mesh has any
  std::vector<TangentRecord> records;                        ///< by mesh; empty likewise
  uint64_t bytes() const;
};

}  // namespace wavecomb
