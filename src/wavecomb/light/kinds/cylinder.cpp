// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/light/kinds/cylinder.h"

#include "wavecomb/light/records/record_builder.h"

namespace wavecomb {
namespace {

using namespace record_builder;

/// Makes the record of a circular cylinder about the transformed axis, with the volume of the
/// transformed cylinder.
void make(LightBuild& out, const Light& light, LightBuildContext& /*context*/) {
  const Affine& m = light.to_world;
  const Double3 x = to_double(m.axis(0)), y = to_double(m.axis(1)), z = to_double(m.axis(2));
  const Double3 axis = x * std::fabs(double{light.length});
  const double stretch = length(x) > 0 ? std::fabs(dot(x, cross(y, z))) / length(x) : 0;
  const double radius = std::fabs(double{light.radius}) * std::sqrt(stretch);
  put(out.record.p, subtract(to_double(m.t), axis * 0.5));
  put(out.record.u, axis);
  out.record.radius = static_cast<float>(radius);
  finish_area(out, light, 2 * kPiD * radius * length(axis));
}

/// Returns the end of the cylinder's axis, which starts at the point p of the record.
Vec3<float> axis_end(const LightRecord& light) {
  return {light.p[0] + light.u[0], light.p[1] + light.u[1], light.p[2] + light.u[2]};
}

void bound(LightCluster& cluster, const LightRecord& light, double power) {
  const Vec3<float> end = axis_end(light);
  include(cluster, {end.x, end.y, end.z});
  widen(cluster, {light.radius, light.radius, light.radius});
  bound_round(cluster);
  cluster.intensity = power / (kPiD * kPiD);  // intensity as seen from the side
}

LightShape shape(const LightRecord& /*light*/) {
  return LightShape::kCustom;
}

Bounds box(const LightRecord& light) {
  const Vec3<float> end = axis_end(light);
  return box_around(light.p, {end.x, end.y, end.z}, {light.radius, light.radius, light.radius});
}

/// Returns the nearest positive hit distance with the open cylinder whose axis u starts at the
/// origin, or 0.
double intersect(const LightRecord& light, const double* o, const double* d) {
  const double u[3] = {light.u[0], light.u[1], light.u[2]};
  const auto dot3 = [](const double* a, const double* b) {
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
  };
  const double radius = light.radius;
  const double uu = dot3(u, u), ou = dot3(o, u) / uu, du = dot3(d, u) / uu;
  double across_o[3], across_d[3];
  for (int i = 0; i < 3; ++i) {
    across_o[i] = o[i] - ou * u[i];
    across_d[i] = d[i] - du * u[i];
  }
  const double a = dot3(across_d, across_d), b = dot3(across_o, across_d),
               c = dot3(across_o, across_o) - radius * radius;
  const double discriminant = b * b - a * c;
  if (!(discriminant >= 0) || !(a > 0)) return 0;
  const double root = std::sqrt(discriminant);
  for (const double t : {(-b - root) / a, (-b + root) / a}) {
    const double along = ou + t * du;
    if (t > 0 && along >= 0 && along <= 1) return t;
  }
  return 0;
}

}  // namespace

LightKindInfo CylinderKind::describe() {
  using namespace light_trait;
  LightKindInfo kind;
  kind.name = "cylinder";
  kind.prims = {"CylinderLight"};
  kind.traits = kHasTransform | kSized | kShaped | kVisibleShape | kOwnShape | kFiltered;
  kind.parameters = {"radius", "length"};
  kind.make = &make;
  kind.bound = &bound;
  kind.shape = &shape;
  kind.box = &box;
  kind.intersect = &intersect;
  return kind;
}

}  // namespace wavecomb
