// SPDX-License-Identifier: Apache-2.0
/// Triangle meshes, curves, points and Gaussian splats as data.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "wavecomb/texture/attribute_data.h"

namespace wavecomb {

/// Material id that means "what the instance says" (see Instance::material).
inline constexpr uint32_t kInheritMaterial = 0xffffffffu;

enum class Attribute : uint8_t {
  kNone,
  kVertex,  ///< one value per vertex, addressed by the triangle's indices
  kCorner,  ///< one value per corner, 3 per triangle in order; 2 per segment of a curve, its ends;
            ///< 1 per point
};

/// Values that vary over a mesh and that materials may read by their name's id.
struct MeshAttribute {
  uint32_t id = kNoAttribute;  ///< SceneBuilder::attribute
  AttributeRate rate = AttributeRate::kConstant;
  uint32_t width = 1;             ///< components, 1 to 4
  std::span<const float> values;  ///< `width` for each value, finite
};

/// What a mesh is made of.
enum class Primitive : uint8_t {
  kTriangle,
  kLinearTube,
  kCubicTube,
  kLinearRibbon,
  kCubicRibbon,
  kSphere,
  kSplat
};

/// A Gaussian splat, but for its middle and colour: curve/splat.h makes it.
struct alignas(64) SplatRow {
  float whiten[9];  ///< rows of the map from offsets to standard deviations
  float opacity;    ///< of a ray through the middle
  float cut;        ///< square of the deviations within which it is met
  float half[3];    ///< of the box around that, about the middle
  float unused[2] = {};
};
static_assert(sizeof(SplatRow) == 64);

/// An indexed triangle mesh, or curves, or points (curve/segment.h), or splats (curve/splat.h),
/// which a material of program emissive is worn by. Arrays belong to the caller
/// and are not copied; `owner` keeps them alive for as long as a Scene uses them.
struct Mesh {
  std::string name;
  Primitive primitive = Primitive::kTriangle;
  std::span<const float> positions;  ///< 3 per vertex, Bezier control point or point; those of each
                                     ///< step after another
  std::span<const uint32_t> indices;  ///< 3 per triangle, counter-clockwise from outside; 1 per
                                      ///< segment (kCurveFirstPoint); none for points
  std::span<const float> radii;       ///< 1 per control point or point, or of the ball around a
                                      ///< splat; none for triangles
  std::span<const float> normals;     ///< 3 per vertex or corner, step by step; empty: flat. 3 per
                                      ///< control point of ribbons, step by step
  Attribute normals_at = Attribute::kNone;
  std::span<const float> uvs;  ///< 2 per vertex or corner; empty: uv = barycentrics
  Attribute uvs_at = Attribute::kNone;
  std::span<const uint32_t> face_materials;  ///< one per primitive, or empty
  uint32_t material = kInheritMaterial;      ///< where face_materials is empty
  uint32_t light_group = 0;                  ///< of what it emits: SceneBuilder::light_group
  uint32_t mesh_light = 0xffffffffu;         ///< SceneBuilder::add_mesh_light, or kNoLight
  uint32_t asset_length = 0;  ///< so much of `name` names the asset it is part of; 0: none known
  std::span<const SplatRow> splats;       ///< 1 per splat
  std::span<const float> harmonics;       ///< 3 (harmonics_degree + 1)^2 per splat: its colour
  uint32_t harmonics_degree = 0;          ///< 0 to 3
  std::vector<MeshAttribute> attributes;  ///< those of a motion's first step, as uvs are
  uint32_t steps = 1;  ///< of its shape, at equal distances over the shutter; 1: it keeps its shape
  std::shared_ptr<const void> owner;

  bool is_curved() const { return primitive != Primitive::kTriangle; }
  bool is_strands() const { return is_curved() && !is_dots(); }
  /// Whether each point is a primitive.
  bool is_dots() const { return primitive == Primitive::kSphere || primitive == Primitive::kSplat; }
  bool is_ribbon() const {
    return primitive == Primitive::kLinearRibbon || primitive == Primitive::kCubicRibbon;
  }
  bool is_cubic() const {
    return primitive == Primitive::kCubicTube || primitive == Primitive::kCubicRibbon;
  }
  /// Control points of a segment.
  size_t segment_points() const { return is_cubic() ? 4 : 2; }
  size_t triangle_count() const { return is_curved() ? 0 : indices.size() / 3; }
  /// Triangles, segments of curves, points or splats.
  size_t primitive_count() const {
    if (is_dots()) return vertex_count();
    return is_curved() ? indices.size() : indices.size() / 3;
  }
  size_t vertex_count() const { return positions.size() / 3 / steps; }
  bool deforms() const { return steps > 1; }
};

/// A mesh as lanes read it: addresses and flags, 16 words. Those of splats have their rows for
/// normals, and harmonics for uvs.
struct alignas(64) MeshRecord {
  uint64_t positions, indices, normals, uvs, face_materials;
  uint32_t material;
  uint32_t flags;
  float uv_density;  ///< sqrt(uv area / area) over all triangles, object space; 0 without uvs
  uint32_t motion;   ///< index into MotionView::meshes
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
  kIsSplat = 256,
  kIsDots = kIsSphere | kIsSplat,
  kIsCurved = kIsTube | kIsRibbon | kIsDots,
};
/// In MeshRecord::flags, 2 bits: Mesh::harmonics_degree.
inline constexpr uint32_t kHarmonicsShift = 10;

}  // namespace wavecomb
