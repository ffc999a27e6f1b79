// SPDX-License-Identifier: Apache-2.0
/// Intersection of rays with light shapes.
#pragma once

#include <vector>

#include "wavecomb/accel/embree_accelerator.h"
#include "wavecomb/light/description/kind_info.h"
#include "wavecomb/scene/scene_view.h"

namespace wavecomb {

class Scene;

/// Geometry of a light, without its emission.
struct LightGeometry {
  LightShape shape = LightShape::kNone;
  /// Light record in which only the members kind, p, u, v and radius are set.
  LightRecord light{};
  const LightKindInfo* kind = nullptr;  ///< null for kNone
  /// Whether only rays that start with a delta bounce hit the light. Its shape is then kCustom.
  bool delta_bounces_only = false;
  LightMotion motion{};  ///< motion of the light; moving lights have the shape
                         ///< kCustom
  std::vector<LightStep> steps;

  bool operator==(const LightGeometry& other) const;
};

/// Returns the geometry of each light record. The shape is `kNone` if rays cannot hit the light.
std::vector<LightGeometry> light_shapes(const Scene& scene);

/// Returns whether the ray of path slot `slot` can hit a light of shape `kCustom`.
inline bool is_hit_by(const LightGeometry& shape, const PresenceKeys& keys, uint32_t slot) {
  if (!shape.delta_bounces_only) return true;
  return keys.bounce_pdf != nullptr && keys.bounce_pdf[size_t{slot} * keys.stride] == 0.f;
}

/// Returns bounds that contain a light of shape `kCustom` during its whole motion.
Bounds custom_shape_bounds(const LightGeometry& shape);

/// Returns the distance along `dir` to a light of shape `kCustom` in units of |dir|, or 0 if the
/// ray misses the light. The function tests one ray at a time in double precision, so that hits do
/// not depend on other rays. Embree's built-in spheres and discs are not used, since their rounding
/// differs between packets and single rays. `time`: shutter time in [0, 1].
float intersect_custom_shape(const LightGeometry& shape, const float (&origin)[3],
                             const float (&dir)[3], float time);

}  // namespace wavecomb
