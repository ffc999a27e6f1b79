// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/integrate/camera_ray.h"

#include <algorithm>

namespace wavecomb {

CameraSetup::CameraSetup(const Camera& camera, uint32_t width, uint32_t height,
                         const FilterTable& table)
    : to_world(camera.to_world),
      steps(camera.steps.begin(), camera.steps.end()),
      lens_radius(camera.lens_radius),
      focus_distance(camera.focus_distance),
      near_clip(camera.near_clip),
      far_clip(camera.far_clip),
      filter(table.offsets()),
      has_far(camera.far_clip < 1e29f) {
  const Vec3<float> z = to_world.axis(2);
  backward = z * (1.f / length(z));
  const float* w = camera.window;
  const float cx = 0.5f * (w[0] + w[1]), cy = 0.5f * (w[2] + w[3]);
  float half_x = 0.5f * (w[1] - w[0]), half_y = 0.5f * (w[3] - w[2]);
  const float aspect = static_cast<float>(width) / static_cast<float>(height);
  if (half_x / half_y < aspect)
    half_x = half_y * aspect;
  else
    half_y = half_x / aspect;
  x0 = cx - half_x;
  y1 = cy + half_y;
  step_x = 2 * half_x / static_cast<float>(width);
  step_y = 2 * half_y / static_cast<float>(height);
}

}  // namespace wavecomb
