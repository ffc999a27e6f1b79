// SPDX-License-Identifier: Apache-2.0
/// Rays against the shapes of lights.
#pragma once

#include <vector>

#include "wavecomb/scene/light_kind.h"
#include "wavecomb/scene/scene.h"

namespace wavecomb {

/// Where a light is; nothing of what it shines.
struct PlacedShape {
  LightShape shape = LightShape::kNone;
  LightRecord light{};                  ///< kind, p, u, v and radius
  const LightKindInfo* kind = nullptr;  ///< of shapes of their own
  LightMotion motion{};                 ///< of what moves, which has a shape of its own
  std::vector<LightStep> steps;

  bool operator==(const PlacedShape& other) const;
};

/// By record; kNone where rays do not meet it.
std::vector<PlacedShape> light_shapes(const Scene& scene);

/// A box around a shape of its own and all its way, a little larger.
Bounds own_shape_bounds(const PlacedShape& shape);

/// Distance along dir to a shape of its own, in units of |dir|; 0 where it is not ahead. One ray at
/// a time and in double precision, so that a hit is the same whatever the rays beside it are:
/// Embree's own spheres and discs round differently in packets and alone. `time`: of the shutter.
float intersect_own_shape(const PlacedShape& shape, const float (&origin)[3], const float (&dir)[3],
                          float time);

}  // namespace wavecomb
