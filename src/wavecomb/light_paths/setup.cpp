// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/light_paths/setup.h"

#include <algorithm>
#include <cmath>

#include "wavecomb/accel/light_shapes.h"
#include "wavecomb/core/error.h"
#include "wavecomb/core/settings.h"
#include "wavecomb/light_paths/context.h"
#include "wavecomb/path/camera/camera_ray.h"
#include "wavecomb/scene/scene.h"

namespace wavecomb {

LightPathContext::LightPathContext(const Settings& settings, const LightSplatFilter& filter,
                                   float paths_per_sample, const MergeGrid* grid)
    : filter(&filter),
      grid(grid),
      connects(settings.connects()),
      share(1.f / (static_cast<float>(settings.width) * static_cast<float>(settings.height) *
                   paths_per_sample)),
      merge_scale(grid ? settings.merge_radius / kConeShare : 0.f) {}

namespace {

/// Factor, slightly above 1, by which the bounding sphere of all surfaces is enlarged.
constexpr float kRadiusMargin = 1.001f;

Bounds shape_bounds(const LightGeometry& shape) {
  if (shape.shape == LightShape::kCustom) return custom_shape_bounds(shape);
  Bounds box;
  const LightRecord& l = shape.light;
  for (const float a : {0.f, 1.f})
    for (const float b : {0.f, 1.f})
      box.add(Vec3<float>{l.p[0] + a * l.u[0] + b * l.v[0], l.p[1] + a * l.u[1] + b * l.v[1],
                          l.p[2] + a * l.u[2] + b * l.v[2]});
  return box;
}

bool emits_own_paths(const LightRecord& record) {
  return record.camera_only == 0;
}

float farthest(const Bounds& box, const Vec3<float>& from) {
  const float x = std::max(std::abs(box.lo.x - from.x), std::abs(box.hi.x - from.x));
  const float y = std::max(std::abs(box.lo.y - from.y), std::abs(box.hi.y - from.y));
  const float z = std::max(std::abs(box.lo.z - from.z), std::abs(box.hi.z - from.z));
  return std::sqrt(x * x + y * y + z * z);
}

}  // namespace

LightPathConflict light_path_conflict(const Scene& scene) {
  const Camera& camera = scene.camera();
  if (distorts(camera) && camera.projection != Projection::kLatlong)
    return {"lenses that distort", "a camera without lens distortion"};
  if (camera.rolling_shutter != RollingShutter::kOff)
    return {"rolling shutters", "a camera without one"};
  if (scene.view().visibility)
    return {"prims that some rays do not see, nor with holdouts", "a stage without them"};
  if (scene.view().subsurface.media)
    return {"subsurface scattering", "a stage without subsurface scattering"};
  if (scene.view().nested_media.media)
    return {
        "media inside of meshes",
        "a stage without transmission scatter, priorities and objects inside of absorbing glass"};
  if (scene.material_part()->has_absorbing_graphs)
    return {"glass whose absorption comes from a value graph",
            "a stage with constant transmission colors"};
  if (!scene.volumes().empty())
    return {"volumes, such as '" + scene.volumes()[0].name + "'", "a stage without them"};
  return {};
}

LightSplatFilter make_light_splat_filter(const CameraSetup& camera, const FilterTable& filter,
                                         const Region& rendered, bool one_pixel) {
  if (camera.projection != Projection::kLatlong) return {filter, rendered, {}, one_pixel};
  const auto row = [&](float latitude) { return (camera.y1 - latitude) / camera.step_y; };
  return {
      filter, rendered, {2 * kPi / camera.step_x, row(0.5f * kPi), row(-0.5f * kPi)}, one_pixel};
}

void check_light_paths(const Scene& scene, const Settings& settings) {
  if (const LightPathConflict conflict = light_path_conflict(scene); !conflict.what.empty())
    throw light_path_error(settings, conflict);
}

float scene_brightness(const Scene& scene) {
  const double radius = double{scene.view().scale};
  const double pi = 3.14159265358979323846;
  const double brightness =
      scene.light_set().total_power * double{scene.camera().exposure} / (pi * pi * radius * radius);
  const int exponent = brightness > 0 && std::isfinite(brightness) ? std::ilogb(brightness) + 1 : 0;
  return std::ldexp(1.f, std::clamp(exponent, -100, 100));
}

FixedPoint light_splat_unit(const Scene& scene) {
  return {std::ilogb(scene_brightness(scene)) - 44};
}

void send_paths(const Scene& scene, LightView& view) {
  const Bounds& b = scene.bounds();
  if (b.empty() || view.count == 0 || !view.power_table.bins) return;
  const Vec3<float> centre = (b.lo + b.hi) * 0.5f;
  view.centre[0] = centre.x;
  view.centre[1] = centre.y;
  view.centre[2] = centre.z;
  view.radius = scene.view().scale * kRadiusMargin;
  view.reach = view.radius;
  for (const LightGeometry& shape : light_shapes(scene))
    if (shape.shape != LightShape::kNone)
      view.reach = std::max(view.reach, farthest(shape_bounds(shape), centre) * kRadiusMargin);
}

bool emits_paths(const Scene& scene) {
  const LightSet& set = scene.light_set();
  return !set.triangles.empty() ||
         std::any_of(set.records.begin(), set.records.end(), emits_own_paths);
}

std::vector<std::string> lights_without_paths(const Scene& scene) {
  std::vector<std::string> names;
  const LightSet& set = scene.light_set();
  for (size_t i = 0; i < scene.lights().size(); ++i) {
    if (!emits_own_paths(set.records[set.of_input[i]])) names.push_back(scene.lights()[i].name);
  }
  for (const Light& light : scene.geometry()->mesh_lights) names.push_back(light.name);
  return names;
}

}  // namespace wavecomb
