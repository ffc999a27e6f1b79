// SPDX-License-Identifier: Apache-2.0
/// Packs lights and emissive triangles into the records that kernels read.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <vector>

#include "wavecomb/light/description/light_records.h"
#include "wavecomb/light/tree/light_tree.h"
#include "wavecomb/texture/texture.h"

namespace wavecomb {

/// An instance of a mesh light.
struct MeshLightInstance {
  const Light* light;
  Affine to_world;  ///< transform of the mesh's group
  double area;      ///< total one-sided area of the triangles in world space
  /// Whether light samples can select the mesh. Otherwise, only paths that hit the mesh find its
  /// emission.
  bool is_sampled;
};

/// A triangle of an emissive mesh, in world space.
struct EmissiveTriangle {
  float p0[3], p1[3], p2[3];
  float uv0[2] = {0, 0}, uv1[2] = {1, 0}, uv2[2] = {0, 1};
  /// Material whose emission or opacity varies; kNoLight if both are constant.
  uint32_t material = kNoLight;
  uint32_t instance = 0, mesh = 0, prim = 0;  ///< identifies the triangle
  /// Emitted radiance on both sides, W / (m^2 sr). Kernels ignore this radiance if `material` is
  /// set.
  float radiance[3] = {0, 0, 0};
  uint32_t mesh_light = kNoLight;  ///< index of the triangle's MeshLightInstance, or kNoLight
  /// Opacity of the triangle in [0, 1], which scales its sampled emission. If the opacity varies,
  /// this is its expected value, which affects only light selection probabilities.
  float opacity = 1;
  bool opacity_varies = false;
  /// The expected luminance of the emission is luminance(radiance) * mean_scale. For a texture,
  /// pass the mean of the texture (times scale, plus bias) in `radiance` and leave mean_scale at 1.
  /// mean_scale affects only light selection probabilities.
  float mean_scale = 1;
};

/// All lights of a scene, packed for kernels. Light indices count infinite lights first, then
/// lights with a shape and point lights (together `records`), then triangles; within each of the
/// three groups, lights are in input order.
struct LightSet {
  /// Records of all lights except triangles. The records from index `record_count` on belong to
  /// mesh lights. They hold values that the triangles of a mesh light share, and are never selected
  /// by light sampling.
  std::vector<LightRecord> records;
  uint32_t record_count = 0;  ///< number of records, not counting records of mesh lights
  std::vector<TriangleLight> triangles;
  /// Texture coordinates of the triangles whose emission or opacity varies.
  std::vector<TriangleUvs> triangle_uvs;
  std::vector<uint32_t> mesh_lights;  ///< LightView::mesh_lights
  /// Bins of `power_table`; empty if only the light tree is used for selection.
  std::vector<uint32_t> power_bins;
  /// Table for selection by power. Its pointer to the bins is null here and set in the device view.
  PowerTable power_table;
  LightTree tree;              ///< light tree; has no nodes yet if the tree is built later
  std::vector<double> powers;  ///< powers of all lights in W, kept if the tree is built later
  std::vector<Distribution2D> distributions;
  std::vector<LightRecord> portals;
  std::vector<PortalGroup> portal_groups;
  std::vector<ShapingRecord> shapings;
  std::vector<FilterRecord> filters;
  std::vector<ShadowRecord> shadows;
  std::vector<LightMotion> motions;  ///< motion of each record's light; empty if no light moves
  std::vector<LightStep> motion_steps;
  std::vector<IesRecord> ies;
  std::vector<float> ies_numbers;
  uint32_t infinite_count = 0;
  std::vector<uint32_t> of_input;  ///< record index of each input light
  double total_power = 0;  ///< estimated power on which selection probabilities are based, W

  size_t size() const { return record_count + triangles.size(); }
  /// Returns the light index of the first triangle.
  uint32_t first_triangle() const { return record_count; }
  /// Returns the probability of selecting light `i` by power.
  float selection_pdf(size_t i) const {
    return i < record_count ? records[i].selection_pdf : triangles[i - record_count].selection_pdf;
  }

  /// Returns the device view of these lights. Contract: the view points into this set, which must
  /// not be moved.
  LightView view(const MaterialView& materials) const;
};

/// Maximum number of lights for selection by power, which uses a 24-bit random number. Scenes with
/// more lights use only the light tree.
inline constexpr uint32_t kMaxPowerLights = (1u << 24) - 1;
/// Maximum number of lights: kernels address triangle records of 16 32-bit words each with 32-bit
/// indices.
inline constexpr uint32_t kMaxLights = 1u << 28;

/// Throws Error if there are more than kMaxLights lights and emissive triangles.
void check_light_count(uint64_t count);

/// Time at which the light tree is built.
enum class TreeTime { kNow, kWhenChosen };

/// Function that returns emissive triangle i. The function is called from several threads at once.
using TriangleSource = std::function<EmissiveTriangle(size_t i)>;

/// Lights of a scene, and options for building their sampling structures.
struct LightInputs {
  std::span<const Light> lights = {};  ///< lights that have passed check_light()
  size_t triangle_count = 0;
  TriangleSource triangle = {};  ///< may be empty if triangle_count is 0
  /// Radius of the scene's bounding sphere; 0 or less means 1. The power of an infinite light is
  /// the power that it sends through the bounding sphere.
  float scene_radius = 0;
  std::span<const TexturePtr> textures = {};
  /// Light set of an earlier version of the scene with the same textures, whose sampling densities
  /// of unchanged dome lights are reused; may be null.
  const LightSet* before = nullptr;
  std::span<const IesProfile> profiles = {};
  /// Mesh lights that have passed check_mesh_light().
  std::span<const MeshLightInstance> mesh_lights = {};
  /// Maximum number of lights for which the table for selection by power is built.
  size_t max_power_lights = kMaxPowerLights;
  /// Time at which the light tree is built; the tree takes as much memory as all other data of the
  /// lights together. With kWhenChosen the light tree is built only if LightSelection::kAuto
  /// selects by tree.
  TreeTime tree_time = TreeTime::kNow;
  std::span<const LightFilter> filters = {};
};

/// Packs all lights. Triangles are packed in parallel.
///
/// Emission follows UsdLux. `color` is radiance L; with `normalize` it is divided by the size of
/// the light:
///   rect, disk, sphere, cylinder   world-space area after the transform
///   distant                        pi sin^2(a) for a half angle a up to 90 degrees,
///                                  pi (2 - sin^2(a)) above, 1 for angle 0
///   dome                           not divided
/// A distant light of angle 0 gives the irradiance `color` at normal incidence. A sphere of radius
/// 0 is a point light of radiant intensity `color`, or color / 4 with `normalize`, the limit of a
/// normalized sphere of shrinking radius. Rects and disks emit to the side to which their transform
/// maps -z, even if the transform mirrors. Negative colours are treated as 0.
///
/// Throws Error for more than kMaxLights lights.
///
/// Contract: lights have passed the checks of light/description/light_table.h.
LightSet build_lights(const LightInputs& inputs);

/// Builds the sampling density of a latlong texture times `color`: piecewise constant on a grid of
/// at most 1024 x 512 cells, proportional to the mean bilinear luminance of the cell times the sine
/// of the polar angle. Row 0 of the texture is at the top, towards the pole +y. The density is
/// positive wherever the bilinear texture is. For an all-black texture, the density has width 0.
Distribution2D build_dome_distribution(const TextureView& texture, const Vec3<float>& color);

/// Builds the sampling density of the texture of a rect light: at most 1024 x 1024 cells, with
/// uniform measure over the square.
Distribution2D build_rect_distribution(const TextureView& texture, const Vec3<float>& color);

/// Returns 1 / (integral over directions of the squared density of a dome's image), in sr; a
/// uniform image gives 4 pi.
double image_solid_angle(const Distribution2D& d);

/// Builds the table that selects a light with probability proportional to its weight (>= 0). Lights
/// before index `first_triangle` and emissive triangles form two groups. `numbers` receives how
/// many of the 2^24 random numbers select each light: none for weight 0, and at least a small
/// number for every other light. If all weights are 0, no random number selects a light. There may
/// be at most kMaxPowerLights lights. Alias tables in integers after M. Vose, "A Linear Algorithm
/// for Generating Random Numbers with a Given Distribution", 1991.
PowerTable build_power_table(std::span<const double> weights, size_t first_triangle,
                             std::vector<uint32_t>& bins, std::vector<uint32_t>& numbers);

}  // namespace wavecomb
