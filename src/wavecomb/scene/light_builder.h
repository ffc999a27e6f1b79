// SPDX-License-Identifier: Apache-2.0
/// Makes the records that kernels read out of lights and emissive triangles.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <vector>

#include "wavecomb/scene/light_data.h"
#include "wavecomb/scene/light_tree.h"
#include "wavecomb/texture/texture.h"

namespace wavecomb {

/// A mesh light in one of the places where its mesh is.
struct PlacedMeshLight {
  const Light* light;
  Affine to_world;  ///< of the mesh's group
  double area;      ///< of all its triangles, one side, in world space
  bool is_sampled;  ///< false: only paths that meet it find it
};

/// A triangle of a mesh that emits, in world space.
struct EmissiveTriangle {
  float p0[3], p1[3], p2[3];
  float uv0[2] = {0, 0}, uv1[2] = {1, 0}, uv2[2] = {0, 1};
  /// Material whose emission or opacity varies; kNoLight where both are constant.
  uint32_t material = kNoLight;
  uint32_t instance = 0, mesh = 0, prim = 0;  ///< where it is
  /// Emitted radiance, W / (m^2 sr), to both sides; not read by kernels where `material` is set.
  float radiance[3] = {0, 0, 0};
  uint32_t mesh_light = kNoLight;  ///< index of its PlacedMeshLight
  /// How much of the triangle is there, in [0, 1]: what is sampled shines by as much. Where it
  /// varies, put what to expect of it; only the choice of lights depends on it then.
  float opacity = 1;
  bool opacity_varies = false;
  /// Luminance to expect of the emission is luminance(radiance) * mean_scale. With a texture, put
  /// the texture's mean (times scale, plus bias) into `radiance` and leave this at 1. Only the
  /// choice of lights depends on it.
  float mean_scale = 1;
};

/// All lights of a scene, ready for kernels. Order: infinite lights, then those with a shape and
/// points (`records`), then the triangles; each kind of group in the order of the input.
struct LightSet {
  /// Those of mesh lights follow; they are no lights that can be chosen.
  std::vector<LightRecord> records;
  uint32_t record_count = 0;  ///< without them
  std::vector<TriangleLight> triangles;
  std::vector<TriangleUvs> triangle_uvs;  ///< of triangles whose emission or opacity varies
  std::vector<uint32_t> mesh_lights;      ///< LightView::mesh_lights
  std::vector<uint32_t> pick_bins;        ///< empty where the tree alone chooses
  PickTable pick;                         ///< without its pointer
  LightTree tree;                         ///< an outline where it is left for later
  std::vector<double> powers;             ///< to build the tree by, where it is
  std::vector<Distribution2D> distributions;
  std::vector<LightRecord> portals;
  std::vector<PortalGroup> portal_groups;
  std::vector<ShapingRecord> shapings;
  std::vector<FilterRecord> filters;
  std::vector<ShadowLookRecord> shadows;
  std::vector<LightMotion> motions;  ///< by record; empty where no light moves
  std::vector<LightStep> motion_steps;
  std::vector<IesRecord> ies;
  std::vector<float> ies_numbers;
  uint32_t infinite_count = 0;
  std::vector<uint32_t> of_input;  ///< record of each input light
  double total_power = 0;          ///< estimate that the choice of lights rests on, W

  size_t size() const { return record_count + triangles.size(); }
  /// Index of the first triangle among all lights.
  uint32_t first_triangle() const { return record_count; }
  /// Probability of choosing light `i`.
  float pick_pdf(size_t i) const {
    return i < record_count ? records[i].pick_pdf : triangles[i - record_count].pick_pdf;
  }

  /// What kernels take. Contract: points into this set, which must stay where it is.
  LightView view(const MaterialView& materials) const;
};

/// Most lights that a choice by power can tell apart (its random number has 24 bits). Of more, the
/// tree alone chooses.
inline constexpr uint32_t kMaxPicked = (1u << 24) - 1;
/// Most lights that can be numbered: triangles have rows of 16 words each.
inline constexpr uint32_t kMaxLights = 1u << 28;

/// Throws Error for more lights and emissive triangles than kMaxLights.
void check_light_count(uint64_t count);

/// When the tree of lights is built.
enum class TreeTime { kNow, kWhenChosen };

/// Emissive triangle i. Called from many threads at once.
using TriangleSource = std::function<EmissiveTriangle(size_t i)>;

/// Builds the records, those of the `triangle_count` triangles in parallel.
///
/// Emission follows UsdLux. `color` is radiance L; with `normalize` it is divided by the light's
/// size:
///   rect, disk, sphere, cylinder   the area in world space as transformed
///   distant              pi sin^2(half angle) up to 90 degrees, pi (2 - sin^2) above, 1 for angle
///   0 dome                 not at all
/// A distant light of angle 0 gives the irradiance `color` at normal incidence. A sphere of radius
/// 0 is a point light: its radiant intensity is `color`, or with `normalize` color / 4, which is
/// what a normalized sphere tends to as it shrinks. Rects and disks shine to the side that -z is
/// mapped to, also where the transform mirrors. Negative colours count as 0.
///
/// `radius` is that of the scene's bounding sphere (0 or less: 1): infinite lights are weighed by
/// the power that they send through it. `before`: lights with the same textures, whose densities of
/// domes are taken over where they fit, or null. Throws Error for more than kMaxLights lights. Of
/// more than `most_picked` there is no table to choose by power. The tree is as large as all else:
/// at kWhenChosen it is built only where LightSelection::kAuto chooses by it.
///
/// Contract: each light has passed check_light, each mesh light check_mesh_light
/// (scene/light_table.h).
LightSet build_lights(std::span<const Light> lights, size_t triangle_count,
                      const TriangleSource& triangle, const Vec3<float>& centre, float radius,
                      std::span<const TexturePtr> textures, const LightSet* before = nullptr,
                      std::span<const IesProfile> profiles = {},
                      std::span<const PlacedMeshLight> mesh_lights = {},
                      size_t most_picked = kMaxPicked, TreeTime tree_time = TreeTime::kNow,
                      std::span<const LightFilter> filters = {});

/// The density that a latlong texture times `color` is sampled by: piecewise constant on a grid of
/// at most 1024 x 512 cells, proportional to the mean over the cell of the bilinear luminance,
/// times the sine of the polar angle. Row 0 is the top (the pole +y). Positive wherever the
/// bilinear texture is. An all-black texture gives width 0.
Distribution2D build_dome_distribution(const TextureView& texture, const Vec3<float>& color);

/// The same for the picture of a rect: at most 1024 x 1024 cells, evenly over the square.
Distribution2D build_rect_distribution(const TextureView& texture, const Vec3<float>& color);

/// 1 / (integral of the squared density of a dome's image over directions): 4 pi of an even one.
double image_solid_angle(const Distribution2D& d);

/// The table that chooses among lights of the given weights (>= 0), of which those before
/// `first_triangle` are one group, and how many of the 2^24 numbers choose each light. Lights of
/// weight 0 are never chosen, all others have some floor of probability. All weights 0: numbers 0.
/// At most kMaxPicked. The alias tables are Vose's, in integers: M. Vose, "A Linear Algorithm for
/// Generating Random Numbers with a Given Distribution", 1991.
PickTable build_pick_table(std::span<const double> weights, size_t first_triangle,
                           std::vector<uint32_t>& bins, std::vector<uint32_t>& numbers);

}  // namespace wavecomb
