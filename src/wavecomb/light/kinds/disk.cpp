// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/light/kinds/disk.h"

#include "wavecomb/light/records/record_builder.h"

namespace wavecomb {
namespace {

using namespace record_builder;

void make(LightBuild& out, const Light& light, LightBuildContext& /*context*/) {
  const Affine& m = light.to_world;
  const double radius = std::fabs(double{light.radius});
  put(out.record.p, to_double(m.t));
  finish_flat(out, light, to_double(m.axis(0)) * radius, to_double(m.axis(1)) * radius, kPiD);
}

/// Computes the half extents of the axis-aligned box around the ellipse.
void half_box(const LightRecord& light, float (&half)[3]) {
  for (size_t k = 0; k < 3; ++k) half[k] = std::hypot(light.u[k], light.v[k]);
}

void bound(LightCluster& cluster, const LightRecord& light, double /*power*/) {
  float half[3];
  half_box(light, half);
  widen(cluster, half);
  bound_normals(cluster, light.n);
}

LightShape shape(const LightRecord& /*light*/) {
  return LightShape::kCustom;
}

Bounds box(const LightRecord& light) {
  float half[3];
  half_box(light, half);
  return box_around(light.p, light.p, half);
}

/// Solves o + t d = x u + y v with x^2 + y^2 <= 1. Returns the hit distance t, or 0 without a hit.
double intersect(const LightRecord& light, const double* o, const double* d) {
  const Double3 u = to_double(light.u), v = to_double(light.v);
  const Double3 from{o[0], o[1], o[2]}, along{d[0], d[1], d[2]};
  const Double3 m = cross(u, v);
  const double t = -dot(from, m) / dot(along, m);
  if (!(t > 0) || !std::isfinite(t)) return 0;
  const Double3 h{from.x + t * along.x, from.y + t * along.y, from.z + t * along.z};
  const double mm = dot(m, m), x = dot(cross(h, v), m) / mm, y = dot(cross(u, h), m) / mm;
  return x * x + y * y <= 1 ? t : 0;
}

}  // namespace

LightKindInfo DiskKind::describe() {
  using namespace light_trait;
  LightKindInfo kind;
  kind.name = "disk";
  kind.prims = {"DiskLight"};
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
