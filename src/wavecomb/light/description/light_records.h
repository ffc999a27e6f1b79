// SPDX-License-Identifier: Apache-2.0
/// Packed lights that kernels read.
#pragma once

#include <cstdint>
#include <vector>

#include "wavecomb/light/description/light.h"
#include "wavecomb/material/description/material.h"

namespace wavecomb {

struct LightAim;
struct MeshRecord;
struct InstanceRecord;

/// Which rays can hit the shape of a light.
enum class ShapeVisibility : uint32_t {
  kAllRays,
  kNoRays,
  /// Rays that start with a delta bounce, which light samples cannot replace.
  kDeltaBounces,
};

/// Packed light other than an emissive triangle, in 192 bytes. Vectors are in world space. Use of
/// the members by kind:
///   rect      p corner, u, v edges, their lengths and inverses, n unit normal (direction of
///             emission), area
///   disk      p centre, u, v half axes, n, area
///   sphere    p centre, radius (0: a point light, radiance is then radiant intensity), area
///   cylinder  p centre of one end, u axis to the other end, radius, area
///   distant   n unit direction in which light travels, one_minus_cos of the cone's half angle (0:
///             a single direction, radiance is then irradiance at normal incidence)
///   dome      u, v, n: world axes of the dome's local x, y, z
///   triangle  values that the triangles of a mesh light instance share: radiance, which is the
///             emitted radiance for kIndependent, else a factor of the material's emission; area
struct alignas(64) LightRecord {
  float p[3], u[3], v[3], n[3];
  float radiance[3];
  float area;
  float radius;
  float one_minus_cos;
  float selection_pdf;  ///< probability of selecting this light by power
  uint32_t kind;
  uint32_t texture;
  /// Index into LightView::distributions for a dome or rect with a texture; kNoDistribution for a
  /// rect that is sampled uniformly.
  uint32_t distribution;
  uint32_t shaping;  ///< index into LightView::shapings, or kNoShaping
  float diffuse, specular;
  /// Nonzero for lights that only light samples find, such as lights whose shape not all rays can
  /// hit, or whose shadows bounce rays cannot reproduce. Light samples of these lights have MIS
  /// weight 1, and bounces that hit them contribute nothing, except delta bounces.
  uint32_t sampled_only;
  uint32_t visibility;  ///< ShapeVisibility of the light's shape
  uint32_t light_link, shadow_link;
  uint32_t sync;     ///< MaterialSync of a mesh light
  uint32_t portals;  ///< portals of a dome: index into LightView::portal_groups, or kNoPortals
  /// Lengths |u| and |v|, and their inverses; all are 0 for a vector of length 0.
  float length_u, length_v, inverse_u, inverse_v;
  uint32_t shadow;  ///< index into LightView::shadows, or kPlainShadow
  uint32_t filter;  ///< index into LightView::filters, or kNoFilter
  /// Nonzero if no light paths start at this light, so that only camera paths find it.
  uint32_t camera_only;
};
static_assert(sizeof(LightRecord) == 192);

/// Packed motion of a light record (light/description/motion.h), in 32 bytes.
struct alignas(32) LightMotion {
  float origin[3] = {0, 0, 0};  ///< position at mid-shutter of the pivot of the rotation
  uint32_t first = 0;           ///< index of the light's first LightStep
  uint32_t segments = 0;        ///< number of motion steps minus one; 0 if the light does not move
  uint32_t pad[3] = {0, 0, 0};
};
static_assert(sizeof(LightMotion) == 32);
/// Pose of a moving light at one motion step.
struct alignas(32) LightStep {
  /// Rotation from the pose at mid-shutter, as a unit quaternion (x, y, z, w)
  float turn[4] = {0, 0, 0, 1};
  float position[3] = {0, 0, 0};  ///< position of the pivot at this step
  float pad = 0;
  bool operator==(const LightStep&) const = default;
};
static_assert(sizeof(LightStep) == 32);

/// Packed Shaping.
struct alignas(64) ShapingRecord {
  float axis[3];  ///< unit vector in world space, the axis of the emission
  /// Rows of the matrix from world directions to the light's local space.
  float to_light_x[3], to_light_y[3], to_light_z[3];
  float focus;  ///< exponent of UsdLux focus; 0 means no focus
  float tint[3];
  /// Cone half angles in radians at which emission ends, and at which it begins to fall off.
  float cone, cone_start;
  float ies_scale;
  float angle_scale;
  uint32_t ies;  ///< index into LightView::ies, or kNoIes
};
static_assert(sizeof(ShapingRecord) == 128);

/// Packed ShadowAttributes.
struct alignas(32) ShadowRecord {
  float color[3];
  float distance;  ///< kFarAway if unlimited
  float falloff;
  float inverse_gamma;
};
static_assert(sizeof(ShadowRecord) == 32);

/// Packed LightFilter.
struct alignas(64) FilterRecord {
  /// Rows and translation of the transform from world space to the filter's space.
  float row_x[3], row_y[3], row_z[3], origin[3];
  float side_0[3], side_1[3], side_2[3], side_3[3];
  float picture_u[3], picture_v[3];
  float distance;
  uint32_t texture;
  float near_start, near_inverse, far_start, far_inverse;
  float density;
  uint32_t next;
};
static_assert(sizeof(FilterRecord) == 192);

/// Offsets of an IesProfile in LightView::ies_numbers.
struct IesRecord {
  /// Offsets and counts of the vertical and horizontal angles. The candela values follow the
  /// horizontal angles.
  uint32_t vertical, vertical_count, horizontal, horizontal_count;
};

/// Packed triangle of an emissive mesh, in world space; it emits from both sides. A scene may have
/// millions of these records, which are read in random order, so each record fills one cache line.
struct alignas(64) TriangleLight {
  float p[3], u[3], v[3];  ///< vertex 0, and the edges that start there
  /// Radiance times opacity if both are constant. Otherwise, three values that are not a colour:
  /// kEmission or kOpacity, which states what varies, and the bit patterns of the material index
  /// and of the index of the triangle's TriangleUvs.
  float radiance[3];
  float m[3];           ///< unit geometric normal times the triangle's area
  float selection_pdf;  ///< probability of selecting this triangle by power
  /// Value of radiance[0] of triangles on which the material's emission, and possibly its opacity,
  /// varies.
  static constexpr float kEmission = -1.f;
  /// Value of radiance[0] of triangles on which only the material's opacity varies. The opacity
  /// scales the radiance of a mesh light that ignores the material's emission.
  static constexpr float kOpacity = -2.f;
  bool varies() const { return radiance[0] < 0; }
};
static_assert(sizeof(TriangleLight) == 64);

/// Mesh ids and texture coordinates of an emissive triangle whose emission or opacity varies.
struct alignas(16) TriangleUvs {
  float uv0[2], uv1[2], uv2[2];
  uint32_t mesh, prim;
  uint32_t instance;
};
static_assert(sizeof(TriangleUvs) == 48);

/// Piecewise constant density over [0,1]^2 for importance sampling of an image, as integer counts.
/// Interval x of a row is selected with probability n / 65536, where n is the difference between
/// cumulative values x + 1 and x, so that probabilities are exact.
///
/// Inversion reads two cache lines: the coarse line of the row, which holds every 32nd value and
/// stays in the cache, and one line of 32 values.
struct Distribution2D {
  static constexpr uint32_t kCounts = 65536;
  static constexpr uint32_t kLine = 32;            ///< number of values in a cache line
  static constexpr uint32_t kMax = kLine * kLine;  ///< maximum number of intervals in a row
  /// Padding after the last value of a row. No stored value exceeds the padding, since kCounts
  /// itself is never stored.
  static constexpr uint16_t kPad = kCounts - 1;
  struct alignas(64) Line {
    uint16_t value[kLine];
  };
  uint32_t width = 0, height = 0;
  uint32_t row_lines = 0;  ///< number of cache lines in a row of `cumulative`
  /// Mean luminance over the sphere (dome light) or the square (rect light)
  double mean_luminance = 0;
  /// 1 / (integral of the squared density over the square): 1 for a uniform image, near 0 if a few
  /// pixels dominate. Used for rects.
  float spread = 1;
  /// `height` rows of `width` cumulative values, each starting at 0, then the marginal distribution
  /// of `height` values. Each row starts at the beginning of a cache line.
  std::vector<Line> cumulative;
  /// Coarse cache lines, with the first value of each line of `cumulative`: one for each row, and
  /// one for the marginal distribution.
  std::vector<Line> coarse;
};

/// Integer alias tables that map a random number k in [0, 2^24) to a light. Random numbers below
/// `split` select a record, and all other numbers select a triangle. Therefore, the selection of
/// one of a few strong lights does not access a table of millions of triangles. Each bin of a table
/// covers 2^shift random numbers.
struct PowerTable {
  /// Bins of the table for records and of the table for triangles. Each bin b covers 2^shift random
  /// numbers r. Numbers r < bins[b] mod 2^shift select light b of the group; all other numbers
  /// select light bins[b] >> shift.
  const uint32_t* bins = nullptr;
  uint32_t split = 0;
  uint32_t shift[2] = {};
  uint32_t triangle_bins = 0;  ///< index of the first bin of the triangles
};

/// Packed child of a light tree node, in 32 bytes: the bounds of the child's lights.
struct LightTreeChild {
  float centre[3];  ///< centre of the bounding sphere
  float radius;
  /// Intensity of the child's lights along their normals, as a fraction of the intensity of the
  /// whole tree.
  float intensity;
  /// The x and y components of the axis of the cone of normals, 16 bits each: 0 means -1, 65535
  /// means 1.
  uint32_t axis_xy;
  /// Bit fields, from the lowest bits up: z component of the axis (16 bits), sin(angle / 2) of the
  /// cone in steps of 1 / 255 (8 bits), sin(angle / 2) of the emission angle in steps of 1 / 127 (7
  /// bits), and 1 bit for two-sided emission.
  uint32_t axis_z_cones;
  uint32_t next;  ///< index of the child node, or kTreeLeaf | light index
};
static_assert(sizeof(LightTreeChild) == 32);

/// Light tree node, which fills one cache line.
struct alignas(64) LightTreeNode {
  LightTreeChild child[2];
};
static_assert(sizeof(LightTreeNode) == 64);

inline constexpr uint32_t kTreeLeaf = 0x80000000u;
/// Maximum depth of a light in the tree. The limit exists because a trail (LightTreeView::trails)
/// has one bit for each node above the light.
inline constexpr uint32_t kMaxTreeDepth = 31;

/// Light tree (light/sampling/tree_choice.h). Random numbers k in [0, 2^24) below `numbers` select
/// a light of the tree; other values select the first infinite light i with k < infinite_ends[i].
struct LightTreeView {
  const LightTreeNode* nodes = nullptr;
  /// Path to each light: bit d selects the child of the node at depth d. kNoLight if the light is
  /// not in the tree.
  const uint32_t* trails = nullptr;
  const uint32_t* infinite_ends = nullptr;
  const float* infinite_pdf = nullptr;
  uint32_t root = kNoLight;
  uint32_t numbers = 0;
  /// Effective number of lights: 1 / (sum over lights of the squared fraction of the tree's power),
  /// which is the number of lights if all have equal power, or 0 if no light of the tree emits.
  float effective_lights = 0;
};

/// Packed light linking (light/description/linking.h). The pointers are null if no light is linked.
struct LinkView {
  const uint32_t* classes = nullptr;
  const uint32_t* members = nullptr;
  uint32_t words = 0;
};

/// Portals of a dome, a range of LightView::portals.
struct PortalGroup {
  uint32_t first, count;
  /// Effective solid angle of the dome's image in sr, 1 / (integral of its squared density): 4 pi
  /// for a uniform image, small if a sun dominates.
  float image_solid_angle;
};

/// Device view of all lights. Light i is record i if i < first_triangle, otherwise triangle i -
/// first_triangle. Infinite lights (distant, dome) come first.
struct LightView {
  const LightRecord* lights = nullptr;
  const TriangleLight* triangles = nullptr;
  const TriangleUvs* triangle_uvs = nullptr;
  PowerTable power_table;
  /// Selection probability of each light if `power_table` was calibrated. Null means that the
  /// probabilities in the records are valid.
  const float* selection_pdf = nullptr;
  LightTreeView tree;
  bool by_tree = false;  ///< whether to select lights by `tree` instead of `power_table`
  uint32_t count = 0;    ///< number of lights, that is, of records and triangles
  uint32_t first_triangle = 0;
  uint32_t infinite_count = 0;
  const Distribution2D* distributions = nullptr;
  // Portals, stored like the records of rect lights; null if no dome has portals.
  const LightRecord* portals = nullptr;
  const PortalGroup* portal_groups = nullptr;
  // Shaping and IES profiles; null if no light has shaping.
  const ShapingRecord* shapings = nullptr;
  const IesRecord* ies = nullptr;
  const float* ies_numbers = nullptr;
  const FilterRecord* filters = nullptr;  ///< null if no light has a filter
  /// Motion of the light of each record; null if no light moves.
  const LightMotion* motions = nullptr;
  const LightStep* motion_steps = nullptr;
  const ShadowRecord* shadows = nullptr;  ///< null if no light has shadow attributes
  /// Record of the mesh light of each triangle, or kNoLight. Null if there are no mesh lights.
  const uint32_t* mesh_lights = nullptr;
  /// Whether any record is sampled_only or has a multiplier other than 1.
  bool has_effects = false;
  /// Whether any record has a diffuse or specular multiplier other than 1.
  bool has_multipliers = false;
  LinkView links;
  /// Textures of lights, and materials of triangles whose emission or opacity varies.
  MaterialView materials;
  /// Bounding sphere of all surfaces. Light paths from infinite lights pass through this sphere.
  /// They start at the distance `reach` from its centre, outside of all light shapes. Radius 0
  /// means that there are no light paths.
  float centre[3] = {0, 0, 0};
  float radius = 0, reach = 0;
  bool emits_paths() const { return radius > 0; }
  /// Luminance below which Russian roulette decides whether a light sample gets a shadow ray
  /// (path/steps/sample_light.h); 0 means no roulette.
  float shadow_threshold = 0;
  const LightAim* aim = nullptr;  ///< target spheres of light paths; null without aiming
  // Geometry for opacity graphs that read positions; null if the light set belongs to no scene.
  const MeshRecord* meshes = nullptr;
  const InstanceRecord* instances = nullptr;
};

}  // namespace wavecomb
