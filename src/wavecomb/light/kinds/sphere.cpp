// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/light/kinds/sphere.h"

#include "wavecomb/light/records/record_builder.h"

namespace wavecomb {
namespace {

using namespace record_builder;

/// Makes the record of a sphere with the volume of the transformed sphere, or of a point light if
/// the radius is 0.
void make(LightBuild& out, const Light& light, LightBuildContext& /*context*/) {
  const Affine& m = light.to_world;
  const Double3 x = to_double(m.axis(0)), y = to_double(m.axis(1)), z = to_double(m.axis(2));
  const double radius = std::fabs(light.radius) * std::cbrt(std::fabs(dot(x, cross(y, z))));
  put(out.record.p, to_double(m.t));
  out.record.radius = static_cast<float>(radius);
  if (light.radius == 0) {
    const LightColour colour(light);
    const double scale = light.normalize ? 0.25 : 1;  // pi r^2 / (4 pi r^2)
    set_radiance(out.record, colour.rgb * scale);
    out.power = 4 * kPiD * scale * colour.mean;
    return;
  }
  const double area = 4 * kPiD * radius * radius;
  finish_area(out, light, area);
  // Keep the radius of a tiny sphere above 0, since a record of radius 0 is a point light.
  if (!(area >= kMinArea)) out.record.radius = 1e-18f;
}

void bound(LightCluster& cluster, const LightRecord& light, double power) {
  widen(cluster, {light.radius, light.radius, light.radius});
  bound_round(cluster);
  cluster.intensity = power / (4 * kPiD);
}

LightShape shape(const LightRecord& light) {
  return light.radius > 0 ? LightShape::kCustom : LightShape::kNone;
}

Bounds box(const LightRecord& light) {
  return box_around(light.p, light.p, {light.radius, light.radius, light.radius});
}

/// Solves |o + t d|^2 = r^2. Returns the smallest positive root, which is the far side if the
/// origin is inside, or 0 without a hit.
double intersect(const LightRecord& light, const double* o, const double* d) {
  const Double3 from{o[0], o[1], o[2]}, along{d[0], d[1], d[2]};
  const double radius = light.radius;
  const double a = dot(along, along), b = dot(from, along), c = dot(from, from) - radius * radius;
  const double discriminant = b * b - a * c;
  if (!(discriminant >= 0)) return 0;
  const double root = std::sqrt(discriminant);
  return (-b - root > 0 ? -b - root : -b + root) / a;
}

}  // namespace

LightKindInfo SphereKind::describe() {
  using namespace light_trait;
  LightKindInfo kind;
  kind.name = "sphere";
  kind.prims = {"SphereLight"};
  kind.traits = kHasTransform | kSized | kShaped | kVisibleShape | kOwnShape | kFiltered;
  kind.parameters = {"radius"};
  kind.make = &make;
  kind.bound = &bound;
  kind.shape = &shape;
  kind.box = &box;
  kind.intersect = &intersect;
  return kind;
}

}  // namespace wavecomb
