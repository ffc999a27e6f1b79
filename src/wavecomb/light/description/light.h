// SPDX-License-Identifier: Apache-2.0
/// Light descriptions that SceneBuilder takes.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "wavecomb/core/affine.h"
#include "wavecomb/texture/texture.h"

namespace wavecomb {

/// Index of a kind of light in the list of light/kinds/kinds.h.
enum class LightKind : uint8_t;
/// Kind of mesh lights, which equals LightKind::kTriangle.
inline constexpr LightKind kMeshLight = LightKind{6};
/// Maximum number of parameters specific to one kind of light.
inline constexpr size_t kMaxSpecificParameters = 4;
inline constexpr uint32_t kNoLight = 0xffffffffu;
inline constexpr uint32_t kNoShaping = 0xffffffffu;
inline constexpr uint32_t kNoIes = 0xffffffffu;
inline constexpr uint32_t kNoFilter = 0xffffffffu;
inline constexpr uint32_t kPlainShadow = 0xffffffffu;
inline constexpr uint32_t kNoPortals = 0xffffffffu;
inline constexpr uint32_t kNoDistribution = 0xffffffffu;
/// Value of a geometry set id that stands for all geometry.
inline constexpr uint32_t kNoSet = 0xffffffffu;

/// UsdLuxShapingAPI: dependence of the emission on direction. The axis of the emission is the
/// light's -z axis.
struct Shaping {
  float focus = 0;  ///< exponent of the cosine between emission and axis; 0 or less means no focus
  Vec3<float> focus_tint{0, 0, 0};
  /// Half angle of the emission cone in degrees; 180 or more means no cone.
  float cone_angle = 180;
  float cone_softness = 0;    ///< fraction of the cone over which emission falls to 0
  uint32_t ies = kNoIes;      ///< profile id that SceneBuilder::add_ies() returned
  float ies_angle_scale = 0;  ///< scale of vertical angles as defined by UsdLux; 0 means no scaling
  bool ies_normalize = false;  ///< whether to divide the profile by IesProfile::mean()

  bool is_plain() const { return !(focus > 0) && !(cone_angle < 180) && ies == kNoIes; }
};

/// UsdLuxShadowAPI: adjustments of a light's shadows, which are not physically based.
struct ShadowAttributes {
  Vec3<float> color{0, 0, 0};  ///< fraction of the light that reaches shadowed points
  /// Maximum world-space distance of an occluder from the shaded surface; a negative value means no
  /// limit.
  float distance = -1;
  /// Length of the range in front of `distance` in which shadows fade out; 0 or less means no fade.
  float falloff = -1;
  float gamma = 1;  ///< exponent of the shadow strength in this range

  bool is_plain() const { return color.x == 0 && color.y == 0 && color.z == 0 && distance < 0; }
};

/// Light filter that modifies the emission of a light (light/filters/filter.h).
struct LightFilter {
  /// Transform from the filter's space to world space. In the filter's space, the barn-door window
  /// is the plane z = -distance; a distance of 0 or less means no window.
  Affine to_world;
  float distance = 0;
  /// Edges (a, b, c) of the barn-door window: at (x, y), each edge transmits the fraction
  /// smoothstep(a x + b y + c) of the light.
  std::array<Vec3<float>, 4> sides{
      {{0.f, 0.f, 1.f}, {0.f, 0.f, 1.f}, {0.f, 0.f, 1.f}, {0.f, 0.f, 1.f}}};
  /// Gobo image on the window, looked up at u = dot(picture_u, (x, y, 1)), v = dot(picture_v, (x,
  /// y, 1)).
  uint32_t texture = kNoTexture;
  Vec3<float> picture_u{1, 0, 0.5f}, picture_v{0, 1, 0.5f};
  /// Distance ramps: light rises from 0 at near_start to its full value at near_end, and falls from
  /// far_start to 0 at far_end. A ramp whose end is not beyond its start has no effect.
  float near_start = 0, near_end = 0, far_start = 0, far_end = 0;
  float density = 1;  ///< strength of the filter: 0 leaves light unchanged, 1 applies it fully
  uint32_t next = kNoFilter;  ///< next filter of the chain, which was added before this filter

  bool fades() const { return near_end > near_start || far_end > far_start; }
};

/// Intensity distribution of an IES file, expanded to the full circle: candela on a grid of angles
/// in degrees, both ascending. The intensity is interpolated bilinearly and is 0 outside the
/// vertical angles.
struct IesProfile {
  std::vector<float> vertical;  ///< angles from the axis, two or more values within [0, 180]
  /// Angles around the axis from 0 to 360; a single angle for a rotationally symmetric profile.
  std::vector<float> horizontal;
  std::vector<float> candela;  ///< intensities, [horizontal][vertical]

  /// Returns the mean over the sphere of directions, or over a hemisphere if the vertical angles
  /// span at most a hemisphere. The mean is exact for profiles that are linear in both angles.
  double mean() const;
  bool covers_sphere() const { return vertical.back() - vertical.front() > 95.7f; }
};

/// Relation between the light that a mesh casts and the emission of its material, which camera rays
/// and mirror reflections see (UsdLux light:materialSyncMode).
enum class MaterialSync : uint32_t {
  kGlowTintsLight,  ///< the light emits the material's emission times the light's colour
  kIndependent,     ///< the light emits the light's colour, independently of the material
  /// As with `kGlowTintsLight`, the light emits the material's emission times the light's colour.
  /// Camera rays and mirror reflections see the same product.
  kNoResponse,
};

/// Description of a light in its local space, as authored in the stage. As in UsdLux, rects and
/// disks lie in the xy plane and emit along -z, distant lights emit along -z, and domes have their
/// pole at +y and the orientation of UsdLuxDomeLight.
struct Light {
  std::string name;
  LightKind kind{};  ///< a rect by default
  Affine to_world;   ///< transform at mid-shutter
  /// Transforms at equally spaced shutter times, two or more; empty if the light does not move. The
  /// light moves as a rigid body with the scale of `to_world`.
  std::vector<Affine> motion;
  bool moves() const { return !motion.empty(); }
  /// Emitted radiance, W / (m^2 sr). The unit differs for distant lights of angle 0 (irradiance)
  /// and spheres of radius 0 (radiant intensity); see build_lights
  /// (light/description/light_builder.h).
  Vec3<float> color{1, 1, 1};
  float width = 1, height = 1;  ///< size of a rect before `to_world`
  float radius = 0.5f;          ///< radius of a disk, sphere or cylinder before `to_world`
  float length = 1;             ///< length of a cylinder along x before `to_world`
  float angle = 0.53f;          ///< apparent diameter of a distant light, degrees
  /// UsdLux `normalize`: whether to divide `color` by the world-space area or, for distant lights,
  /// by the solid angle.
  bool normalize = false;
  /// Texture of a rect (u to the right, v up as seen from the front) or a dome (latlong).
  uint32_t texture = kNoTexture;
  uint32_t group = 0;  ///< light group id that SceneBuilder::light_group() returned
  Shaping shaping;     ///< directional emission, for area lights and point lights
  /// Factors of the diffuse and the specular response of materials to the light (UsdLux; not
  /// physically based).
  float diffuse = 1, specular = 1;
  /// Ids that SceneBuilder::add_geometry_set() returned: the set of objects that the light
  /// illuminates, and the set of objects that cast shadows from it.
  uint32_t light_link = kNoSet, shadow_link = kNoSet;
  ShadowAttributes shadow;
  /// Id that SceneBuilder::add_light_filter() returned; ignored for infinite lights.
  uint32_t filter = kNoFilter;
  bool visible = true;  ///< whether camera and bounce rays can hit the light's shape
  /// Whether camera rays can hit the light's shape. If not, the shape is hit only by rays that
  /// mirrors and clear glass reflect or transmit, and it blocks no other rays.
  bool visible_to_camera = true;
  /// Portals of a dome light: transforms from the unit square in the xy plane to the openings
  /// through which the dome is sampled. The -z side of a portal receives the light.
  std::vector<Affine> portals;
  /// Values of the parameters specific to the light's kind (LightKindInfo::own), if given.
  std::array<std::optional<float>, kMaxSpecificParameters> own;
  /// Relation to the emission of the mesh's material, used by mesh lights (kind `kMeshLight`). The
  /// `to_world` transform of a mesh light leads to the space of the mesh's group.
  MaterialSync sync = MaterialSync::kGlowTintsLight;
};

}  // namespace wavecomb
