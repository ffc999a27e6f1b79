// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/integrate/camera_ray.h"

namespace wavecomb {

CameraSetup::CameraSetup(const Camera& camera, uint32_t width, uint32_t height,
                         const FilterTable& table)
    : Camera(camera),
      places(camera.steps.begin(), camera.steps.end()),
      filter(table.offsets()),
      has_far(camera.far_clip < 1e29f || !camera.clip_planes.empty()) {
  if (projection == Projection::kLatlong) lens_radius = 0;
  const Vec3<float> z = to_world.axis(2);
  backward = z * (1.f / length(z));
  const FittedWindow window = fitted_window(camera, width, height);
  x0 = window.centre_x - window.half_x;
  y1 = window.centre_y + window.half_y;
  step_x = 2 * window.half_x / static_cast<float>(width);
  step_y = 2 * window.half_y / static_cast<float>(height);
}

}  // namespace wavecomb
