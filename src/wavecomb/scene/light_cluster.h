// SPDX-License-Identifier: Apache-2.0
/// What a light tree knows of some lights: where they are, whereto they shine and how much.
#pragma once

#include "wavecomb/scene/light_data.h"

namespace wavecomb {

/// A cone of directions about a unit axis. `two_sided`: about the opposite axis too.
struct DirectionCone {
  double axis[3] = {0, 0, 1};
  double angle = 0;  ///< half the opening, radians
  bool two_sided = false;
};

/// Bounds of some lights. A light shines from within the box, at most `emission` radians off a
/// normal, and normals are in the cone.
struct LightCluster {
  float lo[3], hi[3];
  DirectionCone normals;
  double emission = 0;
  double intensity = 0;  ///< along the normals, relative to all lights of the tree
  uint32_t next = 0;     ///< node, or kTreeLeaf | light
};

// Ways to bounds, for kinds of lights.
/// Widens the box to hold a point.
void include(LightCluster& cluster, const float (&p)[3]);
/// Widens the box by `half` on each side.
void widen(LightCluster& cluster, const float (&half)[3]);
/// Of the corners p, p + u, p + v and, where there is one `opposite`, p + u + v.
LightCluster bound_corners(const float (&p)[3], const float (&u)[3], const float (&v)[3],
                           bool opposite);
/// Light over the hemisphere about n.
void bound_normals(LightCluster& cluster, const float (&n)[3]);
/// Light outwards from something round.
void bound_round(LightCluster& cluster);

/// A cone around two others (as small as theirs allow: Conty Estevez and Kulla 2018, algorithm 1).
DirectionCone unite(const DirectionCone& a, const DirectionCone& b);
/// Bounds of both; `next` is left to the caller.
LightCluster unite(const LightCluster& a, const LightCluster& b);

/// Bounds of one light. `intensity`: W / sr, for the given power in W.
LightCluster bound_light(const LightRecord& light, double power);
LightCluster bound_light(const TriangleLight& light, double power);

/// As lanes read it, rounded so that nothing is left out.
LightTreeChild encode(const LightCluster& cluster);

}  // namespace wavecomb
