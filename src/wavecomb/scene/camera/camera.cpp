// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/scene/camera/camera.h"

#include <cmath>

namespace wavecomb {

bool distorts(const Camera& c) {
  return !c.lens_map.empty() || c.lens_k1 != 0 || c.lens_k2 != 0 || c.lens_k3 != 0 ||
         c.lens_p1 != 0 || c.lens_p2 != 0;
}

uint32_t lens_map_nodes(const Camera& camera) {
  const size_t nodes = 2 * camera.lens_map.size();
  const auto across = static_cast<uint32_t>(std::lround(std::sqrt(static_cast<double>(nodes))));
  return across >= 2 && size_t{across} * across == nodes ? across : 0;
}

FittedWindow fitted_window(const Camera& camera, uint32_t width, uint32_t height) {
  const float* w = camera.window;
  FittedWindow fitted{0.5f * (w[0] + w[1]), 0.5f * (w[2] + w[3]), 0.5f * (w[1] - w[0]),
                      0.5f * (w[3] - w[2])};
  if (camera.projection == Projection::kLatlong) return fitted;
  const float aspect = static_cast<float>(width) / static_cast<float>(height) * camera.pixel_aspect;
  const bool is_narrow = fitted.half_x / fitted.half_y < aspect;
  const auto fit_width = [&] { fitted.half_x = fitted.half_y * aspect; };
  const auto fit_height = [&] { fitted.half_y = fitted.half_x / aspect; };
  switch (camera.conform) {
    case Conform::kExpandAperture:
      is_narrow ? fit_width() : fit_height();
      break;
    case Conform::kCropAperture:
      is_narrow ? fit_height() : fit_width();
      break;
    case Conform::kAdjustApertureWidth:
      fit_width();
      break;
    case Conform::kAdjustApertureHeight:
      fit_height();
      break;
    case Conform::kAdjustPixelAspectRatio:
      break;
  }
  return fitted;
}

}  // namespace wavecomb
