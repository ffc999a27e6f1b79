// SPDX-License-Identifier: Apache-2.0
/// Bounds of a set of lights for the light tree: position, emission directions and intensity.
#pragma once

#include "wavecomb/light/description/light_records.h"

namespace wavecomb {

/// A cone of directions about a unit axis. If `two_sided` is set, the cone about the opposite axis
/// is also included.
struct DirectionCone {
  double axis[3] = {0, 0, 1};
  double angle = 0;  ///< half of the opening angle in radians
  bool two_sided = false;
};

/// Bounds of a set of lights: a box that contains them, a cone of their normals, the maximum angle
/// `emission` in radians between a normal and an emitted direction, and their total intensity.
struct LightCluster {
  float lo[3], hi[3];
  DirectionCone normals;
  double emission = 0;
  /// Intensity emitted along the normals, relative to the total intensity of the tree.
  double intensity = 0;
  uint32_t next = 0;  ///< index of the child node, or kTreeLeaf | light index
};

// Functions for computing the bounds of a light.
/// Extends the box to contain a point.
void include(LightCluster& cluster, const float (&p)[3]);
/// Extends the box by `half` on each side.
void widen(LightCluster& cluster, const float (&half)[3]);
/// Returns bounds of the corners p, p + u and p + v, and of p + u + v if `opposite` is set.
LightCluster bound_corners(const float (&p)[3], const float (&u)[3], const float (&v)[3],
                           bool opposite);
/// Sets the emission bounds of a surface that emits over the hemisphere about n.
void bound_normals(LightCluster& cluster, const float (&n)[3]);
/// Sets the emission bounds of a shape with normals in all directions, such as a sphere.
void bound_round(LightCluster& cluster);

/// Returns a cone that contains both cones (Conty Estevez and Kulla 2018, algorithm 1).
DirectionCone unite(const DirectionCone& a, const DirectionCone& b);
/// Returns the bounds of the union of two sets of lights. The member `next` is not set.
LightCluster unite(const LightCluster& a, const LightCluster& b);

/// Returns the bounds of one light of the given power in W. The `intensity` of the bounds is in W /
/// sr.
LightCluster bound_light(const LightRecord& light, double power);
LightCluster bound_light(const TriangleLight& light, double power);

/// Packs the bounds of lights for kernels, with conservative rounding.
LightTreeChild encode(const LightCluster& cluster);

}  // namespace wavecomb
