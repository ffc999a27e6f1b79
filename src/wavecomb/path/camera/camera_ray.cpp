// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/path/camera/camera_ray.h"

#include "wavecomb/core/error.h"

namespace wavecomb {
namespace {

/// Returns CameraSetup::rolling. Across the image without overscan, the start of a pixel's exposure
/// moves from 0 to 1 - duration.
std::array<float, 3> rolling_of(const Camera& camera, float width, float height, float overscan) {
  const float all = 1.f - camera.rolling_duration;
  const float per_x = all / (width - 2 * overscan), per_y = all / (height - 2 * overscan);
  switch (camera.rolling_shutter) {
    case RollingShutter::kOff:
      break;
    case RollingShutter::kTop:
      return {-overscan * per_y, 0.f, per_y};
    case RollingShutter::kBottom:
      return {all + overscan * per_y, 0.f, -per_y};
    case RollingShutter::kLeft:
      return {-overscan * per_x, per_x, 0.f};
    case RollingShutter::kRight:
      return {all + overscan * per_x, -per_x, 0.f};
  }
  return {};
}

}  // namespace

CameraSetup::CameraSetup(const Camera& camera, uint32_t width, uint32_t height,
                         const FilterTable& table, uint32_t overscan)
    : Camera(camera),
      transforms(camera.steps.begin(), camera.steps.end()),
      filter(table.offsets()),
      has_far(camera.far_clip < 1e29f || !camera.clip_planes.empty()) {
  const bool is_latlong = projection == Projection::kLatlong;
  if (is_latlong && overscan > 0)
    throw Error("a latlong picture shows all directions and has no overscan; give overscan 0");
  if (is_latlong) lens_radius = 0;
  const Vec3<float> z = to_world.axis(2);
  backward = z * (1.f / length(z));
  const uint32_t visible_x = width - 2 * overscan, visible_y = height - 2 * overscan;
  const FittedWindow window = fitted_window(camera, visible_x, visible_y);
  step_x = 2 * window.half_x / static_cast<float>(visible_x);
  step_y = 2 * window.half_y / static_cast<float>(visible_y);
  const auto beyond = static_cast<float>(overscan);
  x0 = window.centre_x - window.half_x - beyond * step_x;
  y1 = window.centre_y + window.half_y + beyond * step_y;
  if (distorts(camera) && !is_latlong)
    distortion = LensTable(camera, {x0, y1, step_x, step_y}, width, height);
  rolling = rolling_of(camera, static_cast<float>(width), static_cast<float>(height), beyond);
}

}  // namespace wavecomb
