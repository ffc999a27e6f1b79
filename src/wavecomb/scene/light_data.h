// SPDX-License-Identifier: Apache-2.0
/// Lights as data: what a SceneBuilder takes and what kernels read.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "wavecomb/core/affine.h"
#include "wavecomb/scene/material_data.h"
#include "wavecomb/texture/texture.h"

namespace wavecomb {

struct LightAim;
struct MeshRecord;
struct InstanceRecord;

/// Numbers of kinds; light/kinds.h lists them.
enum class LightKind : uint8_t;
/// LightKind::kTriangle: of lights of meshes.
inline constexpr LightKind kMeshLight = LightKind{6};
/// Most parameters that one kind of light can have to itself.
inline constexpr size_t kMaxOwnParameters = 4;
inline constexpr uint32_t kNoLight = 0xffffffffu;
inline constexpr uint32_t kNoShaping = 0xffffffffu;
inline constexpr uint32_t kNoIes = 0xffffffffu;
inline constexpr uint32_t kNoFilter = 0xffffffffu;
inline constexpr uint32_t kPlainShadow = 0xffffffffu;
inline constexpr uint32_t kNoPortals = 0xffffffffu;
inline constexpr uint32_t kNoDistribution = 0xffffffffu;
/// All geometry: no GeometrySet. kNoSet + 1 is 0.
inline constexpr uint32_t kNoSet = 0xffffffffu;

/// UsdLuxShapingAPI: how emission depends on its direction. The light's axis is its -z.
struct Shaping {
  float focus = 0;  ///< exponent; 0 or less: none
  Vec3<float> focus_tint{0, 0, 0};
  float cone_angle = 180;      ///< degrees off the axis; 180 or more: none
  float cone_softness = 0;     ///< share of the cone over which light falls to 0
  uint32_t ies = kNoIes;       ///< SceneBuilder::add_ies
  float ies_angle_scale = 0;   ///< as UsdLux defines it; 0: none
  bool ies_normalize = false;  ///< divide by IesProfile::mean

  bool is_plain() const { return !(focus > 0) && !(cone_angle < 180) && ies == kNoIes; }
};

/// UsdLuxShadowAPI: what a light's shadows are like. Not physical.
struct ShadowLook {
  Vec3<float> color{0, 0, 0};  ///< of the light, what arrives where something is in the way
  float distance = -1;         ///< from a surface to what shades it, in the world; less than 0: any
  float falloff = -1;          ///< how long before that shadows fade; 0 or less: not at all
  float gamma = 1;             ///< exponent of how strong they are in that zone

  bool is_plain() const { return color.x == 0 && color.y == 0 && color.z == 0 && distance < 0; }
};

/// What stands before a light and changes what goes through it (light/filter.h).
struct LightFilter {
  /// The window is the plane z = -distance of its own space. 0 or less: none.
  Affine to_world;
  float distance = 0;
  /// (a, b, c): at (x, y) of the window, light passes a side by smoothstep(a x + b y + c).
  std::array<Vec3<float>, 4> sides{
      {{0.f, 0.f, 1.f}, {0.f, 0.f, 1.f}, {0.f, 0.f, 1.f}, {0.f, 0.f, 1.f}}};
  uint32_t texture = kNoTexture;  ///< a picture on the window, at u = picture_u . (x, y, 1), ...
  Vec3<float> picture_u{1, 0, 0.5f}, picture_v{0, 1, 0.5f};
  /// Light begins to arrive at near_start from it and is whole at near_end; it begins to fade at
  /// far_start and is gone at far_end. Not where the end is not beyond the start.
  float near_start = 0, near_end = 0, far_start = 0, far_end = 0;
  float density = 1;          ///< how much of all that there is
  uint32_t next = kNoFilter;  ///< another one, added before

  bool fades() const { return near_end > near_start || far_end > far_start; }
};

/// The distribution of an IES file, expanded to the whole circle: candela at a grid of angles in
/// degrees, both ascending. Between them it is bilinear, outside the vertical ones 0.
struct IesProfile {
  std::vector<float> vertical;    ///< from the axis: within [0, 180], two or more
  std::vector<float> horizontal;  ///< 0 to 360; a single one: alike all around
  std::vector<float> candela;     ///< [horizontal][vertical]

  /// Mean over the directions of the profile: of the sphere, or where its vertical angles span no
  /// more than a hemisphere of that; exact for what is linear in both angles.
  double mean() const;
  bool covers_sphere() const { return vertical.back() - vertical.front() > 95.7f; }
};

/// How the light of a mesh goes with the glow of its material, which cameras and mirrors see
/// (UsdLux: light:materialSyncMode).
enum class MaterialSync : uint32_t {
  kGlowTintsLight,  ///< its light is the glow times the light's colour
  kIndependent,     ///< its light is the light's colour alone
  kNoResponse,      ///< as kGlowTintsLight, and that is what cameras and mirrors see, too
};

/// A light as the stage gives it, in its own space (UsdLux: rect, disk in the xy plane, shining
/// along -z; distant shining along -z; dome's pole +y, texture's centre towards +z ... as
/// UsdLuxDomeLight says).
struct Light {
  std::string name;
  LightKind kind{};  ///< a rect, unless it is said
  Affine to_world;   ///< in mid-shutter, where it moves
  /// The same at equal steps of the shutter, two or more; empty: it stands still. It is turned and
  /// carried as a stiff body; sizes are those of to_world.
  std::vector<Affine> motion;
  bool moves() const { return !motion.empty(); }
  /// Emitted radiance (area lights and dome: W / (m^2 sr)); for a distant light of angle 0 and for
  /// a sphere of radius 0 (a point light), see `color`'s use in light/.
  Vec3<float> color{1, 1, 1};
  float width = 1, height = 1;  ///< rect, before to_world
  float radius = 0.5f;          ///< disk, sphere, cylinder, before to_world
  float length = 1;             ///< cylinder, along x, before to_world
  float angle = 0.53f;          ///< distant: apparent diameter in degrees
  /// UsdLux: divide by the area in world space (distant: by its solid angle).
  bool normalize = false;
  uint32_t texture = kNoTexture;  ///< rect (u right, v up as seen from the front), dome (latlong)
  uint32_t group = 0;             ///< SceneBuilder::light_group
  Shaping shaping;                ///< of lights with a shape and of points
  /// What the light gives to the diffuse and to the specular response of materials is multiplied by
  /// these (UsdLux: not physical).
  float diffuse = 1, specular = 1;
  /// SceneBuilder::add_geometry_set: what it shines on, and what casts shadows in its light.
  uint32_t light_link = kNoSet, shadow_link = kNoSet;
  ShadowLook shadow;
  uint32_t filter = kNoFilter;  ///< SceneBuilder::add_light_filter; of lights with a place
  bool visible = true;          ///< whether rays meet its shape
  /// Dome: maps of the unit square in the xy plane, whose -z side is lit, to the portals that guide
  /// its sampling.
  std::vector<Affine> portals;
  /// Parameters that its kind alone has (LightKindInfo::own), where they are given.
  std::array<std::optional<float>, kMaxOwnParameters> own;
  /// Of mesh lights (kind kMeshLight), whose to_world leads to the space of the mesh's group.
  MaterialSync sync = MaterialSync::kGlowTintsLight;
};

/// A light as lanes read it, triangles of meshes apart: 48 words. Vectors are in world space. Use
/// by kind:
///   rect      p corner, u, v edges, their lengths and inverses, n unit normal (direction of
///             emission), area
///   disk      p centre, u, v half axes, n, area
///   sphere    p centre, radius (0: point light, radiance then is radiant intensity), area
///   cylinder  p centre of one end, u axis to the other, radius, area
///   distant   n unit direction the light travels, one_minus_cos of its half angle (0: a direction,
///             radiance then is irradiance at normal incidence)
///   dome      u, v, n: world axes of the dome's local x, y, z
///   triangle  a mesh light, placed once: what its triangles have in common. radiance is that of
///             kIndependent, else what the glow of the material is multiplied by; area
struct alignas(64) LightRecord {
  float p[3], u[3], v[3], n[3];
  float radiance[3];
  float area;
  float radius;
  float one_minus_cos;
  float pick_pdf;  ///< probability of choosing this light by power
  uint32_t kind;
  uint32_t texture;
  /// Dome and rect with a texture: index into LightView::distributions; kNoDistribution: a rect
  /// that is sampled evenly.
  uint32_t distribution;
  uint32_t shaping;  ///< index into LightView::shapings, or kNoShaping
  float diffuse, specular;
  /// Not 0: paths that meet the light by a bounce that light sampling could have made get nothing
  /// of it; what light samples bring counts in full. So it is of what rays do not meet, and where
  /// shadows are not those that rays see.
  uint32_t sampled_only;
  uint32_t hidden;  ///< 1: rays do not meet its shape
  uint32_t light_link, shadow_link;
  uint32_t sync;     ///< MaterialSync of a mesh light
  uint32_t portals;  ///< of a dome: index into LightView::portal_groups, or kNoPortals
  /// |u|, |v|, and their inverses, 0 where there is none.
  float length_u, length_v, inverse_u, inverse_v;
  uint32_t shadow;       ///< index into LightView::shadows, or kPlainShadow
  uint32_t filter;       ///< index into LightView::filters, or kNoFilter
  uint32_t camera_only;  ///< not 0: no paths start here, those from the camera find its light
};
static_assert(sizeof(LightRecord) == 192);

/// How a light moves, by record (scene/light_motion.h): 8 words.
struct alignas(32) LightMotion {
  float origin[3] = {0, 0, 0};  ///< what it is turned about, in mid-shutter
  uint32_t first = 0;           ///< of its LightSteps
  uint32_t segments = 0;        ///< steps less one; 0: it stands still
  uint32_t pad[3] = {0, 0, 0};
};
static_assert(sizeof(LightMotion) == 32);
/// Where it is at one step.
struct alignas(32) LightStep {
  float turn[4] = {0, 0, 0, 1};  ///< quaternion from mid-shutter, x y z w, of length 1
  float place[3] = {0, 0, 0};    ///< where its origin is
  float pad = 0;
  bool operator==(const LightStep&) const = default;
};
static_assert(sizeof(LightStep) == 32);

/// Shaping as lanes read it.
struct alignas(64) ShapingRecord {
  float axis[3];  ///< unit, world: the middle of the emission
  /// Rows of the map from world directions to the light's space.
  float to_light_x[3], to_light_y[3], to_light_z[3];
  float focus;  ///< 0: none
  float tint[3];
  float cone, cone_start;  ///< radians: where light ends, and where it begins to fall
  float ies_scale;
  float angle_scale;
  uint32_t ies;  ///< index into LightView::ies, or kNoIes
};
static_assert(sizeof(ShapingRecord) == 128);

/// A ShadowLook as lanes read it.
struct alignas(32) ShadowLookRecord {
  float color[3];
  float distance;  ///< kFarAway where any will do
  float falloff;
  float inverse_gamma;
};
static_assert(sizeof(ShadowLookRecord) == 32);

/// A LightFilter as lanes read it.
struct alignas(64) FilterRecord {
  /// Rows of the map from the world to its space.
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

/// Where the parts of an IesProfile lie in LightView::ies_numbers.
struct IesRecord {
  uint32_t vertical, vertical_count, horizontal, horizontal_count;  ///< candela follow those
};

/// A triangle of an emissive mesh, in world space, which shines to both sides. There may be
/// millions, chosen at random: one is one cache line.
struct alignas(64) TriangleLight {
  float p[3], u[3], v[3];  ///< vertex 0 and the edges from it
  /// Radiance times opacity where both are constant. Else what varies, kEmission or kOpacity, then
  /// the bits of the material that says so, and of the index of its TriangleUvs.
  float radiance[3];
  float m[3];      ///< unit geometric normal times the area
  float pick_pdf;  ///< probability of choosing this light by power
  /// The material's emission times its opacity.
  static constexpr float kEmission = -1.f;
  /// Its opacity alone, by which the radiance of a mesh light is multiplied that shows no glow.
  static constexpr float kOpacity = -2.f;
  bool varies() const { return radiance[0] < 0; }
};
static_assert(sizeof(TriangleLight) == 64);

/// Texture coordinates of the corners of a triangle whose emission or opacity varies, and where it
/// is.
struct alignas(16) TriangleUvs {
  float uv0[2], uv1[2], uv2[2];
  uint32_t mesh, prim;
  uint32_t instance;
};
static_assert(sizeof(TriangleUvs) == 48);

/// A piecewise constant density over [0,1]^2 for importance sampling a picture, in counts of 65536:
/// interval x of row y is chosen for as many of a row's 65536 counts as lie between its cumulative
/// value and the next, so that its probability is exact in integers.
///
/// Inversion reads two cache lines: the row's coarse one, which holds each 32nd value and stays in
/// the cache, and one of the 32 values that it leads to.
struct Distribution2D {
  static constexpr uint32_t kCounts = 65536;
  static constexpr uint32_t kLine = 32;             ///< values in a cache line
  static constexpr uint32_t kMost = kLine * kLine;  ///< intervals of a row
  /// Behind the last value of a row, which is at most that: kCounts itself is not stored.
  static constexpr uint16_t kPad = kCounts - 1;
  struct alignas(64) Line {
    uint16_t value[kLine];
  };
  uint32_t width = 0, height = 0;
  uint32_t row_lines = 0;     ///< lines of a row of `cumulative`
  double mean_luminance = 0;  ///< over the sphere (dome) or the square (rect)
  /// 1 / (integral of the squared density over the square): 1 where it is even, little where few
  /// places have all the light. Of rects.
  float spread = 1;
  /// `height` rows of `width` values, each from 0 upwards; then the marginal, `height` values in as
  /// many lines as they need. Each row starts a line.
  std::vector<Line> cumulative;
  /// First values of the lines of each row, and of the marginal: one line each.
  std::vector<Line> coarse;
};

/// How a light is chosen out of a number k in [0, 2^24), in integers. Numbers below `split` choose
/// among the records, the others among the triangles, so that a few strong lights keep clear of a
/// table of millions. Each of the two groups has an alias table whose bins take 2^shift numbers.
struct PickTable {
  /// Of both groups. Number r of the 2^shift of bin b chooses light b of the group where
  /// r < bin mod 2^shift, else light bin >> shift.
  const uint32_t* bins = nullptr;
  uint32_t split = 0;
  uint32_t shift[2] = {};
  uint32_t triangle_bins = 0;  ///< first bin of the triangles
};

/// Half of a node of a light tree: bounds of the lights below, in 8 words.
struct LightTreeChild {
  float centre[3];  ///< of a sphere around them
  float radius;
  float intensity;  ///< sum over them, along their normals, relative to all lights of the tree
  /// Axis of the cone of their normals, 16 bits a component: 0 is -1, 65535 is 1.
  uint32_t axis_xy;
  /// Low bits: z of the axis. Then sin(angle / 2) of the cone in steps of 1 / 255 (8 bits) and of
  /// what they emit off their normals in steps of 1 / 127 (7 bits). Top bit: they shine to both
  /// sides.
  uint32_t axis_z_cones;
  uint32_t next;  ///< node, or kTreeLeaf | light
};
static_assert(sizeof(LightTreeChild) == 32);

/// A node of a light tree: one cache line.
struct alignas(64) LightTreeNode {
  LightTreeChild child[2];
};
static_assert(sizeof(LightTreeNode) == 64);

inline constexpr uint32_t kTreeLeaf = 0x80000000u;
/// Most nodes between the root and a light: a trail has a bit for each.
inline constexpr uint32_t kMaxTreeDepth = 31;

/// How a light is chosen by tree (light/light_tree.h). Numbers k in [0, 2^24) below `numbers`
/// choose a light of the tree, the others infinite light i where k < infinite_ends[i] first holds.
struct LightTreeView {
  const LightTreeNode* nodes = nullptr;
  /// Of each light: bit d says which child of the node at depth d it is below. kNoLight: the tree
  /// has it not.
  const uint32_t* trails = nullptr;
  const uint32_t* infinite_ends = nullptr;
  const float* infinite_pdf = nullptr;
  uint32_t root = kNoLight;
  uint32_t numbers = 0;
  /// As many equal lights would be as hard to choose among: 1 / sum of squares of the shares of
  /// power of the tree's lights. 0: none shines.
  float effective_lights = 0;
};

/// Scene/links.h: null where no light is linked.
struct LinkView {
  const uint32_t* classes = nullptr;
  const uint32_t* members = nullptr;
  uint32_t words = 0;
};

/// The portals of a dome, in LightView::portals.
struct PortalGroup {
  uint32_t first, count;
  /// That an even image of as much power and as much power squared would take up: 4 pi where it is
  /// even, little where a sun gives the light.
  float image_solid_angle;
};

/// What kernels need of all lights. Light i is record i for i < first_triangle, else triangle
/// i - first_triangle. Infinite lights (distant, dome) come first.
struct LightView {
  const LightRecord* lights = nullptr;
  const TriangleLight* triangles = nullptr;
  const TriangleUvs* triangle_uvs = nullptr;
  PickTable pick;
  /// Probabilities of `pick` where they are not those of the records; of each light, or null.
  const float* pick_pdf = nullptr;
  LightTreeView tree;
  bool by_tree = false;  ///< lights are chosen by `tree` and not by `pick`
  uint32_t count = 0;    ///< records and triangles
  uint32_t first_triangle = 0;
  uint32_t infinite_count = 0;
  const Distribution2D* distributions = nullptr;
  // Null where no dome has portals. Portals are as rects.
  const LightRecord* portals = nullptr;
  const PortalGroup* portal_groups = nullptr;
  // Null where no light is shaped.
  const ShapingRecord* shapings = nullptr;
  const IesRecord* ies = nullptr;
  const float* ies_numbers = nullptr;
  const FilterRecord* filters = nullptr;  ///< null where no light has one
  const LightMotion* motions = nullptr;   ///< by record; null where no light moves
  const LightStep* motion_steps = nullptr;
  const ShadowLookRecord* shadows = nullptr;  ///< null where all shadows are plain
  /// Of triangle i the record of its mesh light, or kNoLight; null where there are no mesh lights.
  const uint32_t* mesh_lights = nullptr;
  bool has_effects = false;      ///< some record is sampled_only, or has multipliers
  bool has_multipliers = false;  ///< some record's diffuse or specular is not 1
  LinkView links;
  MaterialView materials;  ///< textures, and emission and opacity of triangles where they vary
  /// A sphere around all surfaces, which paths from infinite lights start towards, from `reach`
  /// before its centre, where no light's shape is. Radius 0: no paths start at lights.
  float centre[3] = {0, 0, 0};
  float radius = 0, reach = 0;
  bool sends_paths() const { return radius > 0; }
  const LightAim* aim = nullptr;  ///< where they are aimed; null: anywhere
  // For graphs of opacity, which may ask where a triangle is; null where lights stand alone.
  const MeshRecord* meshes = nullptr;
  const InstanceRecord* instances = nullptr;
};

}  // namespace wavecomb
