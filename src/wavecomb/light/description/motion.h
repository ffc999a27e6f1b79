// SPDX-License-Identifier: Apache-2.0
/// Lights that move while the shutter is open. Moving lights are rigid bodies; their records
/// describe the pose at mid-shutter.
///
/// At a given time, the record is rotated by R about its pivot `origin`, which moves to `position`:
///   x = R (x_rest - origin) + place
/// where `place` is the position of the pivot, and R is given by a unit quaternion; both are
/// interpolated between the two motion steps around that time. The motion is rigid, so distances,
/// solid angles and densities as seen from x equal the values for the light at rest as seen from
/// x_rest.
#pragma once

#include <span>

#include "wavecomb/light/description/light_records.h"

namespace wavecomb {

struct LightSet;
struct LightCluster;

/// Adds the motion of `lights` to `set`, which already contains their records.
void add_motions(LightSet& set, std::span<const Light> lights);

/// Pose of a light at a given time, in double precision. LightPose (light/sampling/moving.h) is the
/// corresponding type in kernels.
struct PreciseLightPose {
  double x[3], y[3], z[3];  ///< directions of the light's mid-shutter axes at the given time
  double position[3], origin[3];

  PreciseLightPose(const LightMotion& motion, std::span<const LightStep> steps, double time);
  void to_rest(const double (&direction)[3], double (&out)[3]) const;
  void point_to_rest(const double (&point)[3], double (&out)[3]) const;
  void to_world(const double (&direction)[3], double (&out)[3]) const;
};

/// A ball.
struct BoundingSphere {
  double centre[3];
  double radius;
};
/// Returns a ball that contains the ball `at_rest` in all its positions while it moves with a
/// light.
BoundingSphere swept_bounds(const LightMotion& motion, std::span<const LightStep> steps,
                            const BoundingSphere& at_rest);
/// Returns bounds of a light over its whole motion, from its bounds at mid-shutter.
LightCluster swept_bounds(const LightMotion& motion, std::span<const LightStep> steps,
                          const LightCluster& at_rest);

}  // namespace wavecomb
