// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/render/inspection/picking.h"

#include <algorithm>

#include "wavecomb/film/filter.h"
#include "wavecomb/geometry/hit/hit_material.h"
#include "wavecomb/geometry/hit/surface.h"
#include "wavecomb/path/camera/camera_ray.h"
#include "wavecomb/scene/names.h"

namespace wavecomb {
namespace {

/// Hit of a single ray, with the fields that the accelerator writes.
struct SingleRayHit {
  float t, u, v;
  uint32_t prim, geom, inst;
};

/// Shutter time at which objects are picked, the middle of the shutter interval.
constexpr float kMiddle = 0.5f;

SingleRayHit trace(const EmbreeAccelerator& accel, const CameraRay<float>& ray) {
  SingleRayHit hit{};
  const float time = kMiddle;
  const uint32_t path = 0;  // index that seeds the random presence tests of cut-out surfaces
  accel.intersect(
      {&ray.o.x, &ray.o.y, &ray.o.z, &ray.d.x, &ray.d.y, &ray.d.z, &ray.tfar, nullptr, 1, &time},
      {&hit.t, &hit.u, &hit.v, &hit.prim, &hit.geom, &hit.inst}, 1, false, {&path, &path, 1, 0});
  return hit;
}

uint32_t light_of_record(const LightSet& set, uint32_t record) {
  const auto at = std::find(set.of_input.begin(), set.of_input.end(), record);
  return static_cast<uint32_t>(at - set.of_input.begin());
}

}  // namespace

std::optional<Pick> pick(const Scene& scene, const EmbreeAccelerator& accel, float x, float y,
                         uint32_t width, uint32_t height) {
  const FilterTable filter(FilterKind::kBox, 1.f);
  Camera sharp = scene.camera();
  sharp.lens_radius = 0;
  const CameraSetup camera(sharp, width, height, filter);
  const CameraRay<float> ray = ray_through<float>(camera, x, y, 0.5f, 0.5f, kMiddle, true);
  const SingleRayHit hit = trace(accel, ray);
  if (hit.inst == kNoHit) return std::nullopt;

  Pick out;
  out.dir = ray.d;
  const ObjectNames names(scene);
  uint32_t object;
  if (hit.inst == kLightShape) {
    object = names.first_light() + hit.geom;
    out.light = light_of_record(scene.light_set(), hit.geom);
    out.position = ray.o + ray.d * hit.t;
  } else {
    object = names.first_object()[hit.inst] + hit.geom;
    const SceneView view = scene.view();
    const InstanceRecord& instance = view.instances[hit.inst];
    const uint32_t mesh_id = view.geometry_mesh[instance.geometry + hit.geom];
    out.instance = hit.inst;
    out.material = hit_material<float>(view, instance.material, mesh_id, hit.prim, true);
    const Surface<float> surface = setup_surface<float>(
        view, {hit.inst, mesh_id, hit.prim, hit.u, hit.v, kMiddle}, ray.d, true, false, true);
    out.position = surface.p;
    out.normal = surface.ns;
    out.uv = surface.uv;
  }
  out.object = names.object(object);
  out.asset = names.asset(object);
  out.depth = camera_depth<float>(camera, out.position, kMiddle, true);
  out.distance = length(out.position - camera_transform<float>(camera, kMiddle, true).t);
  return out;
}

std::vector<Vec3<float>> visible_surface_points(const Scene& scene, const EmbreeAccelerator& accel,
                                                uint32_t width, uint32_t height, uint32_t side) {
  const FilterTable filter(FilterKind::kBox, 1.f);
  const CameraSetup camera(scene.camera(), width, height, filter);
  std::vector<Vec3<float>> points;
  const auto middle = [&](uint32_t cell, uint32_t pixels) {
    return (static_cast<float>(cell) + 0.5f) * static_cast<float>(pixels) /
           static_cast<float>(side);
  };
  for (uint32_t i = 0; i < side * side; ++i) {
    const CameraRay<float> ray = ray_through<float>(
        camera, middle(i % side, width), middle(i / side, height), 0.5f, 0.5f, kMiddle, true);
    const SingleRayHit hit = trace(accel, ray);
    if (hit.inst != kNoHit && hit.inst != kLightShape) points.push_back(fma(ray.d, hit.t, ray.o));
  }
  return points;
}

}  // namespace wavecomb
