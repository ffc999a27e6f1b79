// SPDX-License-Identifier: Apache-2.0
/// Surface and light picking at points of the image.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "wavecomb/accel/embree_accelerator.h"
#include "wavecomb/light/sampling/light_sample.h"
#include "wavecomb/scene/scene.h"

namespace wavecomb {

/// First hit of a picking ray: a surface or the shape of a light.
struct Pick {
  std::string object;            ///< ObjectNames::object
  std::string asset;             ///< ObjectNames::asset
  uint32_t light = kNoLight;     ///< index into Scene::lights; kNoLight for a surface
  uint32_t material = 0;         ///< set only for surfaces, as are `instance`, `normal` and `uv`
  uint32_t instance = 0;         ///< index into SceneView::instances
  Vec3<float> position, normal;  ///< world space; unit shading normal
  Vec2<float> uv;
  Vec3<float> dir;     ///< unit direction of the ray
  float depth = 0;     ///< depth along the camera's axis
  float distance = 0;  ///< from the camera
};

/// Traces the ray from the centre of the lens through the point (x, y) of an image of width x
/// height pixels, where (0, 0) is the top left corner. Returns the first hit, or nothing if the ray
/// leaves the scene.
std::optional<Pick> pick(const Scene& scene, const EmbreeAccelerator& accel, float x, float y,
                         uint32_t width, uint32_t height);

/// Returns the surface points hit by rays through the centres of side x side cells of the image.
std::vector<Vec3<float>> visible_surface_points(const Scene& scene, const EmbreeAccelerator& accel,
                                                uint32_t width, uint32_t height, uint32_t side);

}  // namespace wavecomb
