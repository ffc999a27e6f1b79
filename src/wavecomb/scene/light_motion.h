// SPDX-License-Identifier: Apache-2.0
/// Lights that move while the shutter is open: turned and carried as stiff bodies from where they
/// are in mid-shutter, which is where their records are.
///
/// At a time, a light is its record turned by R about its origin and carried to its place there:
///   x = R (x_rest - origin) + place
/// R is the quaternion between those of the two steps around the time, of length 1. Distances,
/// solid angles, and so all densities are those of the record, seen from where x_rest is.
#pragma once

#include <span>

#include "wavecomb/scene/light_data.h"

namespace wavecomb {

struct LightSet;
struct LightCluster;

/// Gives `set`, whose records there are, the motion of `lights`.
void add_motions(LightSet& set, std::span<const Light> lights);

/// Where a light is at a time, in double precision: as LightPose (light/moving.h) has it.
struct LightPlace {
  double x[3], y[3], z[3];  ///< where its axes in mid-shutter point
  double place[3], origin[3];

  LightPlace(const LightMotion& motion, std::span<const LightStep> steps, double time);
  void to_rest(const double (&direction)[3], double (&out)[3]) const;
  void point_to_rest(const double (&point)[3], double (&out)[3]) const;
  void to_world(const double (&direction)[3], double (&out)[3]) const;
};

/// A ball around all places of a ball that moves with a light, in place of the one given.
struct Ball {
  double centre[3];
  double radius;
};
Ball along_way(const LightMotion& motion, std::span<const LightStep> steps, const Ball& at_rest);
/// Bounds of a light's whole way, of those where it rests.
LightCluster along_way(const LightMotion& motion, std::span<const LightStep> steps,
                       const LightCluster& at_rest);

}  // namespace wavecomb
