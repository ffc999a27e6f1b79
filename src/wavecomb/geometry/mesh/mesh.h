// SPDX-License-Identifier: Apache-2.0
/// Triangle meshes, curves, points and Gaussian splats.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "wavecomb/texture/attribute_data.h"

namespace wavecomb {

/// Material id for meshes that use the material of their instance (see Instance::material).
inline constexpr uint32_t kInheritMaterial = 0xffffffffu;

enum class Attribute : uint8_t {
  kNone,
  kVertex,  ///< one value per vertex, addressed by the triangle's indices
  /// One value per corner: 3 values per triangle in the order of its vertices, 2 values per curve
  /// segment for its ends, or 1 value per point.
  kCorner,
};

/// Values that vary over a mesh (a primvar). Materials refer to an attribute by the id of its name.
struct MeshAttribute {
  uint32_t id = kNoAttribute;  ///< id that SceneBuilder::attribute() returned
  AttributeRate rate = AttributeRate::kConstant;
  uint32_t width = 1;             ///< number of floats in each value
  std::span<const float> values;  ///< `width` finite floats for each value
};

/// Type of the primitives of a mesh.
enum class Primitive : uint8_t {
  kTriangle,
  kLinearTube,
  kCubicTube,
  kLinearRibbon,
  kCubicRibbon,
  kSphere,
  kGaussianSplat,
  kSplat [[deprecated("use kGaussianSplat")]] = kGaussianSplat
};

/// Shape and opacity of a Gaussian splat, made by geometry/gaussian_splat/gaussian_splat.h; centre
/// and colour are stored separately.
struct alignas(64) GaussianSplatRow {
  float whiten[9];  ///< rows of the matrix that maps offsets to units of standard deviations
  float opacity;    ///< opacity along a ray through the centre
  float cut;      ///< square of the cutoff in standard deviations, beyond which rays miss the splat
  float half[3];  ///< half extents of the bounding box about the centre
  float unused[2] = {};
};
using SplatRow [[deprecated("use GaussianSplatRow")]] = GaussianSplatRow;
static_assert(sizeof(GaussianSplatRow) == 64);

/// Primitives of one type: an indexed triangle mesh, curves or points (geometry/curve/segment.h),
/// or Gaussian splats (geometry/gaussian_splat/gaussian_splat.h). The material of splats must use
/// the shading program "emissive". The arrays are not copied. They belong to the caller, and
/// `owner` keeps them alive as long as a Scene uses them.
struct Mesh {
  std::string name;
  Primitive primitive = Primitive::kTriangle;
  /// 3 floats per vertex, Bezier control point or point, for each motion step in turn.
  std::span<const float> positions;
  /// Vertex indices: 3 per triangle, counter-clockwise as seen from outside. For curves, 1 value
  /// per segment with the index of its first control point (kCurveFirstPoint). Empty for points.
  std::span<const uint32_t> indices;
  /// Radius of each control point or point, or of the bounding sphere of each splat; empty for
  /// triangles.
  std::span<const float> radii;
  /// 3 floats per vertex or corner, or per control point of ribbons, for each motion step in turn;
  /// empty for flat shading.
  std::span<const float> normals;
  Attribute normals_at = Attribute::kNone;
  std::span<const float> uvs;  ///< 2 floats per vertex or corner; if empty, uv are the barycentrics
  Attribute uvs_at = Attribute::kNone;
  /// Material of each primitive; empty if all have the same material.
  std::span<const uint32_t> face_materials;
  /// Material of all primitives, used if face_materials is empty.
  uint32_t material = kInheritMaterial;
  /// Light group of the mesh's emission (SceneBuilder::light_group)
  uint32_t light_group = 0;
  /// Index that SceneBuilder::add_mesh_light() returned, or kNoLight.
  uint32_t mesh_light = 0xffffffffu;
  /// Length of the prefix of `name` that names the asset of the mesh; 0 if unknown.
  uint32_t asset_length = 0;
  std::span<const GaussianSplatRow> splats;  ///< 1 per splat
  std::span<const float> harmonics;  ///< colour of each splat, as 3 (harmonics_degree + 1)^2 floats
  uint32_t harmonics_degree = 0;     ///< 0 to 3
  /// Attributes of the mesh. Their values do not change between motion steps.
  std::vector<MeshAttribute> attributes;
  /// Number of motion steps, which are shapes of the mesh at equally spaced shutter times; 1 if the
  /// mesh does not deform.
  uint32_t steps = 1;
  std::shared_ptr<const void> owner;

  bool is_curved() const { return primitive != Primitive::kTriangle; }
  bool is_strands() const { return is_curved() && !is_dots(); }
  /// Returns whether each point of the mesh is a primitive.
  bool is_dots() const {
    return primitive == Primitive::kSphere || primitive == Primitive::kGaussianSplat;
  }
  bool is_ribbon() const {
    return primitive == Primitive::kLinearRibbon || primitive == Primitive::kCubicRibbon;
  }
  bool is_cubic() const {
    return primitive == Primitive::kCubicTube || primitive == Primitive::kCubicRibbon;
  }
  /// Returns the number of control points of a segment.
  size_t segment_points() const { return is_cubic() ? 4 : 2; }
  size_t triangle_count() const { return is_curved() ? 0 : indices.size() / 3; }
  /// Returns the number of triangles, curve segments, points or splats of the mesh.
  size_t primitive_count() const {
    if (is_dots()) return vertex_count();
    return is_curved() ? indices.size() : indices.size() / 3;
  }
  size_t vertex_count() const { return positions.size() / 3 / steps; }
  bool deforms() const { return steps > 1; }
};

/// Packed mesh for kernels: addresses of its arrays, and flags, in 64 bytes. For splats, `normals`
/// is the address of the GaussianSplatRow array, and `uvs` the address of the spherical harmonics.
struct alignas(64) MeshRecord {
  uint64_t positions, indices, normals, uvs, face_materials;
  uint32_t material;
  uint32_t flags;
  /// sqrt(uv area / object-space area), summed over all triangles; 0 without uvs.
  float uv_density;
  uint32_t motion;  ///< index of the mesh's motion in MotionView::meshes
  uint64_t radii;
};
static_assert(sizeof(MeshRecord) == 64);
enum MeshFlags : uint32_t {
  kNormalsPerVertex = 1,
  kNormalsPerCorner = 2,
  kUvsPerVertex = 4,
  kUvsPerCorner = 8,
  kIsTube = 16,
  kIsRibbon = 32,
  kIsSphere = 64,
  kIsCubic = 128,
  kIsGaussianSplat = 256,
  kIsDots = kIsSphere | kIsGaussianSplat,
  kIsCurved = kIsTube | kIsRibbon | kIsDots,
};
/// Bit position of the two bits in MeshRecord::flags that hold Mesh::harmonics_degree.
inline constexpr uint32_t kHarmonicsShift = 10;

}  // namespace wavecomb
