// SPDX-License-Identifier: Apache-2.0
/// Lights as data: what a SceneBuilder takes and what kernels read.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "wavecomb/core/affine.h"
#include "wavecomb/scene/material_data.h"
#include "wavecomb/texture/texture.h"

namespace wavecomb {

enum class LightKind : uint8_t { kRect, kDisk, kSphere, kDistant, kDome, kTriangle };
inline constexpr uint32_t kLightKindCount = 6;
inline constexpr uint32_t kNoLight = 0xffffffffu;

/// A light as the stage gives it, in its own space (UsdLux: rect, disk in the xy plane, shining
/// along -z; distant shining along -z; dome's pole +y, texture's centre towards +z ... as
/// UsdLuxDomeLight says).
struct Light {
  std::string name;
  LightKind kind = LightKind::kRect;
  Affine to_world;
  /// Emitted radiance (area lights and dome: W / (m^2 sr)); for a distant light of angle 0 and for
  /// a sphere of radius 0 (a point light), see `color`'s use in light/.
  Vec3<float> color{1, 1, 1};
  float width = 1, height = 1;  ///< rect, before to_world
  float radius = 0.5f;          ///< disk, sphere, before to_world
  float angle = 0.53f;          ///< distant: apparent diameter in degrees
  /// UsdLux: divide by the area in world space (distant: by its solid angle).
  bool normalize = false;
  uint32_t texture = kNoTexture;  ///< rect (u right, v up as seen from the front), dome (latlong)
};

/// A light as lanes read it: 32 words. Vectors are in world space. Use by kind:
///   rect      p corner, u, v edges, n unit normal (direction of emission), area
///   disk      p centre, u, v half axes, n, area
///   sphere    p centre, radius (0: point light, radiance then is radiant intensity), area
///   distant   n unit direction the light travels, one_minus_cos of its half angle (0: a direction,
///             radiance then is irradiance at normal incidence)
///   dome      u, v, n: world axes of the dome's local x, y, z
///   triangle  p vertex 0, u, v edges, n unit geometric normal, area; shines to both sides;
///             uv0, uv1, uv2 and `material` for textured emission
struct alignas(64) LightRecord {
  float p[3], u[3], v[3], n[3];
  float radiance[3];
  float area;
  float radius;
  float one_minus_cos;
  float pick_pdf;  ///< probability of choosing this light
  uint32_t kind;
  uint32_t texture;
  uint32_t material;  ///< triangle: material whose emission slot is textured, else kNoLight
  float uv0[2], uv1[2], uv2[2];
  uint32_t distribution;  ///< dome: index into LightView::distributions
  uint32_t pad;
};
static_assert(sizeof(LightRecord) == 128);

/// A piecewise constant density over [0,1]^2 for importance sampling a dome: rows of `width` + 1
/// cumulative values in [0, 1] per row, and one column of `height` + 1.
struct Distribution2D {
  uint32_t width = 0, height = 0;
  std::vector<float> conditional;  ///< height rows of width + 1
  std::vector<float> marginal;     ///< height + 1
  std::vector<float> density;      ///< height x width, pdf over the unit square
  /// Where inversion finds numbers in [k, k + 1) / kGuide: the first interval, and the last one in
  /// the upper 16 bits. kGuide entries for each row of `conditional`, then those of `marginal`.
  static constexpr uint32_t kGuide = 128;
  std::vector<uint32_t> guide;
};

/// An entry of Vose's alias table.
struct AliasEntry {
  float threshold;  ///< keep the bin where the remapped number is below this
  uint32_t alias;
};

/// What kernels need of all lights. Infinite lights (distant, dome) come first.
struct LightView {
  const LightRecord* lights = nullptr;
  const AliasEntry* alias = nullptr;
  uint32_t count = 0;
  uint32_t infinite_count = 0;
  const Distribution2D* distributions = nullptr;
  MaterialView materials;  ///< textures, and emission of textured triangle lights
};

}  // namespace wavecomb
