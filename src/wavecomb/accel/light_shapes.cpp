// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/accel/light_shapes.h"

#include <algorithm>
#include <cmath>

#include "wavecomb/light/description/motion.h"
#include "wavecomb/scene/scene.h"

namespace wavecomb {
namespace {

/// Returns the distance along `d` to the parallelogram of a light record, which rays hit from both
/// sides. Distances have the same unit and range as results of `LightKindInfo::intersect`. Solves o
/// + t d = a u + b v (T. Moller and B. Trumbore, "Fast, Minimum Storage Ray-Triangle Intersection",
/// 1997).
double intersect_parallelogram(const LightRecord& light, const double (&o)[3],
                               const double (&d)[3]) {
  const auto cross = [](const double* a, const double* b, double (&c)[3]) {
    for (int i = 0; i < 3; ++i)
      c[i] = a[(i + 1) % 3] * b[(i + 2) % 3] - a[(i + 2) % 3] * b[(i + 1) % 3];
  };
  const auto dot = [](const double* a, const double* b) {
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
  };
  double u[3], v[3], dv[3], ou[3];
  std::ranges::copy(light.u, u);
  std::ranges::copy(light.v, v);
  cross(d, v, dv);
  cross(o, u, ou);
  const double det = dot(u, dv);
  if (det == 0) return 0;
  const double a = dot(o, dv) / det, b = dot(d, ou) / det;
  if (!(a >= 0 && a <= 1 && b >= 0 && b <= 1)) return 0;
  return dot(v, ou) / det;
}

/// Returns the bounds of a light at mid-shutter.
Bounds box_at_mid_shutter(const LightGeometry& shape) {
  const LightRecord& l = shape.light;
  if (shape.kind->box) return shape.kind->box(l);
  float lo[3], hi[3];
  for (int i = 0; i < 3; ++i) {
    lo[i] = l.p[i] + std::min(l.u[i], 0.f) + std::min(l.v[i], 0.f);
    hi[i] = l.p[i] + std::max(l.u[i], 0.f) + std::max(l.v[i], 0.f);
  }
  return {{lo[0], lo[1], lo[2]}, {hi[0], hi[1], hi[2]}};
}

}  // namespace

bool LightGeometry::operator==(const LightGeometry& other) const {
  const LightRecord &a = light, &b = other.light;
  return shape == other.shape && delta_bounces_only == other.delta_bounces_only &&
         a.kind == b.kind && a.radius == b.radius && std::ranges::equal(a.p, b.p) &&
         std::ranges::equal(a.u, b.u) && std::ranges::equal(a.v, b.v) &&
         std::ranges::equal(motion.origin, other.motion.origin) && steps == other.steps;
}

std::vector<LightGeometry> light_shapes(const Scene& scene) {
  std::vector<LightGeometry> shapes;
  const LightSet& set = scene.light_set();
  for (const LightRecord& record : set.records) {
    const size_t number = shapes.size();
    LightGeometry& geometry = shapes.emplace_back();
    const LightKindInfo& kind = info_of(static_cast<LightKind>(record.kind));
    const auto visibility = static_cast<ShapeVisibility>(record.visibility);
    if (!kind.shape || !(record.area > 0) || visibility == ShapeVisibility::kNoRays) continue;
    geometry.shape = kind.shape(record);
    if (geometry.shape == LightShape::kNone) continue;
    geometry.delta_bounces_only = visibility == ShapeVisibility::kDeltaBounces;
    if (geometry.delta_bounces_only) geometry.shape = LightShape::kCustom;
    geometry.kind = &kind;
    geometry.light.kind = record.kind;
    geometry.light.radius = record.radius;
    std::ranges::copy(record.p, geometry.light.p);
    std::ranges::copy(record.u, geometry.light.u);
    std::ranges::copy(record.v, geometry.light.v);
    if (number >= set.motions.size() || set.motions[number].segments == 0) continue;
    const LightMotion& motion = set.motions[number];
    geometry.shape = LightShape::kCustom;
    geometry.motion = motion;
    geometry.motion.first = 0;
    const auto first = set.motion_steps.begin() + motion.first;
    geometry.steps.assign(first, first + motion.segments + 1);
  }
  return shapes;
}

Bounds custom_shape_bounds(const LightGeometry& shape) {
  const Bounds rests = box_at_mid_shutter(shape);
  if (shape.steps.empty()) return rests;
  const Vec3<float> centre = (rests.lo + rests.hi) * 0.5f, half = (rests.hi - rests.lo) * 0.5f;
  const double x{half.x}, y{half.y}, z{half.z};
  const BoundingSphere swept =
      swept_bounds(shape.motion, shape.steps,
                   BoundingSphere{{double{centre.x}, double{centre.y}, double{centre.z}},
                                  std::sqrt(x * x + y * y + z * z)});
  float lo[3], hi[3];
  for (int i = 0; i < 3; ++i) {
    const double slack = swept.radius + 1e-6 * std::abs(swept.centre[i]);
    lo[i] = static_cast<float>(swept.centre[i] - slack);
    hi[i] = static_cast<float>(swept.centre[i] + slack);
  }
  return {{lo[0], lo[1], lo[2]}, {hi[0], hi[1], hi[2]}};
}

float intersect_custom_shape(const LightGeometry& shape, const float (&origin)[3],
                             const float (&dir)[3], float time) {
  double o[3], d[3];
  std::ranges::copy(origin, o);
  std::ranges::copy(dir, d);
  if (!shape.steps.empty()) {
    const double ray_origin[3] = {o[0], o[1], o[2]}, along[3] = {d[0], d[1], d[2]};
    const PreciseLightPose pose(shape.motion, shape.steps, double{time});
    pose.point_to_rest(ray_origin, o);
    pose.to_rest(along, d);
  }
  for (int i = 0; i < 3; ++i) o[i] -= double{shape.light.p[i]};
  const double t = shape.kind->intersect ? shape.kind->intersect(shape.light, o, d)
                                         : intersect_parallelogram(shape.light, o, d);
  return t > 0 ? static_cast<float>(t) : 0.f;
}

}  // namespace wavecomb
