// SPDX-License-Identifier: Apache-2.0
/// What lies under points of the picture.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "wavecomb/accel/embree_accelerator.h"
#include "wavecomb/light/light.h"
#include "wavecomb/scene/scene.h"

namespace wavecomb {

/// What a ray met first: a surface, or the shape of a light.
struct Pick {
  std::string object;            ///< ObjectNames::object
  std::string asset;             ///< ObjectNames::asset
  uint32_t light = kNoLight;     ///< index into Scene::lights; kNoLight: a surface
  uint32_t material = 0;         ///< of a surface, as all below but position and distances
  uint32_t instance = 0;         ///< into SceneView::instances
  Vec3<float> position, normal;  ///< world space; the unit shading normal
  Vec2<float> uv;
  Vec3<float> dir;     ///< of the ray that met it
  float depth = 0;     ///< along the camera's axis
  float distance = 0;  ///< from the camera
};

/// Traces the ray through point (x, y) of a picture of width x height pixels, (0, 0) being its top
/// left corner, through the middle of the lens. Nothing where it leaves the scene.
std::optional<Pick> pick(const Scene& scene, const EmbreeAccelerator& accel, float x, float y,
                         uint32_t width, uint32_t height);

/// Where rays through the middles of a grid of side x side cells of such a picture meet a surface.
std::vector<Vec3<float>> seen_places(const Scene& scene, const EmbreeAccelerator& accel,
                                     uint32_t width, uint32_t height, uint32_t side);

}  // namespace wavecomb
