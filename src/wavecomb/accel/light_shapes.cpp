// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/accel/light_shapes.h"

#include <algorithm>

namespace wavecomb {

bool PlacedShape::operator==(const PlacedShape& other) const {
  const LightRecord &a = light, &b = other.light;
  return shape == other.shape && a.kind == b.kind && a.radius == b.radius &&
         std::ranges::equal(a.p, b.p) && std::ranges::equal(a.u, b.u) &&
         std::ranges::equal(a.v, b.v);
}

std::vector<PlacedShape> light_shapes(const Scene& scene) {
  std::vector<PlacedShape> shapes;
  for (const LightRecord& record : scene.light_set().records) {
    PlacedShape& placed = shapes.emplace_back();
    const LightKindInfo& kind = info_of(static_cast<LightKind>(record.kind));
    if (!kind.shape || !(record.area > 0) || record.hidden != 0) continue;
    placed.shape = kind.shape(record);
    if (placed.shape == LightShape::kNone) continue;
    placed.kind = &kind;
    placed.light.kind = record.kind;
    placed.light.radius = record.radius;
    std::ranges::copy(record.p, placed.light.p);
    std::ranges::copy(record.u, placed.light.u);
    std::ranges::copy(record.v, placed.light.v);
  }
  return shapes;
}

Bounds own_shape_bounds(const PlacedShape& shape) {
  return shape.kind->box(shape.light);
}

float intersect_own_shape(const PlacedShape& shape, const float (&origin)[3],
                          const float (&dir)[3]) {
  double o[3], d[3];
  for (int i = 0; i < 3; ++i) {
    o[i] = static_cast<double>(origin[i]) - shape.light.p[i];
    d[i] = dir[i];
  }
  const double t = shape.kind->intersect(shape.light, o, d);
  return t > 0 ? static_cast<float>(t) : 0.f;
}

}  // namespace wavecomb
