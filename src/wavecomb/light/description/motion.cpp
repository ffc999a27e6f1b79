// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/light/description/motion.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "wavecomb/light/description/light_builder.h"
#include "wavecomb/light/tree/light_cluster.h"

namespace wavecomb {
namespace {

/// Number of poses between two motion steps at which bounds are computed.
constexpr int kPosesPerStep = 8;

using Matrix = double[3][3];

void set_linear(Matrix& m, const Affine& a) {
  for (int i = 0; i < 3; ++i) {
    m[i][0] = double{a.row[i].x};
    m[i][1] = double{a.row[i].y};
    m[i][2] = double{a.row[i].z};
  }
}

/// Computes the transposed inverse of m; returns false if m is singular.
bool invert_transposed(const Matrix& m, Matrix& out) {
  for (int i = 0; i < 3; ++i) {
    const int a = (i + 1) % 3, b = (i + 2) % 3;
    for (int j = 0; j < 3; ++j) {
      const int c = (j + 1) % 3, d = (j + 2) % 3;
      out[i][j] = m[a][c] * m[b][d] - m[a][d] * m[b][c];
    }
  }
  const double det = m[0][0] * out[0][0] + m[0][1] * out[0][1] + m[0][2] * out[0][2];
  if (!std::isnormal(det)) return false;
  for (auto& row : out)
    for (double& x : row) x /= det;
  return true;
}

/// Computes the rotation closest to `to` times the inverse of `from`, by polar decomposition with
/// Newton steps X <- (X + X^-T) / 2 (N. Higham, "Computing the Polar Decomposition", 1986). Returns
/// false if no such rotation exists.
bool rotation_between(const Affine& from, const Affine& to, Matrix& x) {
  Matrix a, b, inverse;
  set_linear(a, from);
  set_linear(b, to);
  if (!invert_transposed(a, inverse)) return false;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j)
      x[i][j] = b[i][0] * inverse[j][0] + b[i][1] * inverse[j][1] + b[i][2] * inverse[j][2];
  for (int k = 0; k < 24; ++k) {
    if (!invert_transposed(x, inverse)) return false;
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) x[i][j] = 0.5 * (x[i][j] + inverse[i][j]);
  }
  const double det = x[0][0] * (x[1][1] * x[2][2] - x[1][2] * x[2][1]) -
                     x[0][1] * (x[1][0] * x[2][2] - x[1][2] * x[2][0]) +
                     x[0][2] * (x[1][0] * x[2][1] - x[1][1] * x[2][0]);
  return det > 0.5;  // Reject reflections, which are not rotations.
}

/// Writes the unit quaternion of a rotation. Of the two possible signs, chooses the one that is
/// closer to the quaternion `before`.
void store_rotation(const Matrix& m, const float (&before)[4], float (&to)[4]) {
  double q[4];
  const double trace = m[0][0] + m[1][1] + m[2][2];
  if (trace > 0) {
    q[3] = 1 + trace;
    for (int i = 0; i < 3; ++i) {
      const int a = (i + 1) % 3, b = (i + 2) % 3;
      q[i] = m[b][a] - m[a][b];
    }
  } else {
    const int i = m[1][1] > m[0][0] ? (m[2][2] > m[1][1] ? 2 : 1) : (m[2][2] > m[0][0] ? 2 : 0);
    const int a = (i + 1) % 3, b = (i + 2) % 3;
    q[i] = 1 + m[i][i] - m[a][a] - m[b][b];
    q[a] = m[a][i] + m[i][a];
    q[b] = m[b][i] + m[i][b];
    q[3] = m[b][a] - m[a][b];
  }
  double length = 0, along = 0;
  for (int i = 0; i < 4; ++i) {
    length += q[i] * q[i];
    along += q[i] * double{before[i]};
  }
  const double scale = (along < 0 ? -1 : 1) / std::sqrt(length);
  for (int i = 0; i < 4; ++i) to[i] = static_cast<float>(q[i] * scale);
}

template <typename T>
void put(T (&to)[3], T x, T y, T z) {
  to[0] = x;
  to[1] = y;
  to[2] = z;
}

double dot3(const double* a, const double* b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/// Calls one(pose) with the poses of a light at equally spaced times over its whole motion.
template <typename Function>
void for_each_pose(const LightMotion& motion, std::span<const LightStep> steps,
                   const Function& one) {
  const uint32_t pose_count = motion.segments * kPosesPerStep;
  for (uint32_t k = 0; k <= pose_count; ++k)
    one(PreciseLightPose(motion, steps, static_cast<double>(k) / static_cast<double>(pose_count)));
}

}  // namespace

void add_motions(LightSet& set, std::span<const Light> lights) {
  if (std::ranges::none_of(lights, [](const Light& l) { return l.moves(); })) return;
  set.motions.assign(set.record_count, {});
  for (size_t i = 0; i < lights.size(); ++i) {
    const Light& light = lights[i];
    if (!light.moves()) continue;
    LightMotion& motion = set.motions[set.of_input[i]];
    motion.first = static_cast<uint32_t>(set.motion_steps.size());
    motion.segments = static_cast<uint32_t>(light.motion.size() - 1);
    const Vec3<float>& rest = light.to_world.t;
    put(motion.origin, rest.x, rest.y, rest.z);
    LightStep step;
    for (const Affine& pose : light.motion) {
      Matrix turn;
      const float before[4] = {step.turn[0], step.turn[1], step.turn[2], step.turn[3]};
      if (rotation_between(light.to_world, pose, turn)) store_rotation(turn, before, step.turn);
      put(step.position, pose.t.x, pose.t.y, pose.t.z);
      set.motion_steps.push_back(step);
    }
  }
}

PreciseLightPose::PreciseLightPose(const LightMotion& motion, std::span<const LightStep> steps,
                                   double time) {
  const double at = std::clamp(time, 0.0, 1.0) * static_cast<double>(motion.segments);
  const uint32_t before = std::min(static_cast<uint32_t>(at), motion.segments - 1);
  const double part = at - static_cast<double>(before);
  const LightStep &a = steps[motion.first + before], &b = steps[motion.first + before + 1];
  const auto mix = [&](float p, float q) { return double{p} + part * (double{q} - double{p}); };
  double q[4], length = 0;
  for (int i = 0; i < 4; ++i) {
    q[i] = mix(a.turn[i], b.turn[i]);
    length += q[i] * q[i];
  }
  for (double& c : q) c /= std::sqrt(length);
  for (int i = 0; i < 3; ++i) {
    position[i] = mix(a.position[i], b.position[i]);
    origin[i] = double{motion.origin[i]};
  }
  const double xx = q[0] * q[0], yy = q[1] * q[1], zz = q[2] * q[2], xy = q[0] * q[1],
               xz = q[0] * q[2], yz = q[1] * q[2], xw = q[0] * q[3], yw = q[1] * q[3],
               zw = q[2] * q[3];
  put(x, 1 - 2 * (yy + zz), 2 * (xy + zw), 2 * (xz - yw));
  put(y, 2 * (xy - zw), 1 - 2 * (xx + zz), 2 * (yz + xw));
  put(z, 2 * (xz + yw), 2 * (yz - xw), 1 - 2 * (xx + yy));
}

void PreciseLightPose::to_rest(const double (&direction)[3], double (&out)[3]) const {
  out[0] = dot3(x, direction);
  out[1] = dot3(y, direction);
  out[2] = dot3(z, direction);
}

void PreciseLightPose::point_to_rest(const double (&point)[3], double (&out)[3]) const {
  const double away[3] = {point[0] - position[0], point[1] - position[1], point[2] - position[2]};
  to_rest(away, out);
  for (int i = 0; i < 3; ++i) out[i] += origin[i];
}

void PreciseLightPose::to_world(const double (&direction)[3], double (&out)[3]) const {
  for (int i = 0; i < 3; ++i)
    out[i] = x[i] * direction[0] + y[i] * direction[1] + z[i] * direction[2];
}

BoundingSphere swept_bounds(const LightMotion& motion, std::span<const LightStep> steps,
                            const BoundingSphere& at_rest) {
  const double off[3] = {at_rest.centre[0] - double{motion.origin[0]},
                         at_rest.centre[1] - double{motion.origin[1]},
                         at_rest.centre[2] - double{motion.origin[2]}};
  double lo[3], hi[3], before[3], opening = 0;
  bool first = true;
  for_each_pose(motion, steps, [&](const PreciseLightPose& pose) {
    double c[3], square = 0;
    pose.to_world(off, c);
    for (int i = 0; i < 3; ++i) {
      c[i] += pose.position[i];
      lo[i] = first ? c[i] : std::min(lo[i], c[i]);
      hi[i] = first ? c[i] : std::max(hi[i], c[i]);
      square += first ? 0 : (c[i] - before[i]) * (c[i] - before[i]);
      before[i] = c[i];
    }
    opening = std::max(opening, std::sqrt(square));
    first = false;
  });
  BoundingSphere all{};
  double reach = 0;
  for (int i = 0; i < 3; ++i) {
    all.centre[i] = 0.5 * (lo[i] + hi[i]);
    reach += (hi[i] - all.centre[i]) * (hi[i] - all.centre[i]);
  }
  // Between two tested poses, the distance of the light's centre from each of the two is at most
  // the distance between them, which is at most `opening`.
  all.radius = (at_rest.radius + std::sqrt(reach) + opening) * (1 + 1e-5);
  return all;
}

LightCluster swept_bounds(const LightMotion& motion, std::span<const LightStep> steps,
                          const LightCluster& at_rest) {
  LightCluster swept = at_rest;
  BoundingSphere sphere{};
  double square = 0;
  for (int i = 0; i < 3; ++i) {
    sphere.centre[i] = 0.5 * (double{at_rest.lo[i]} + double{at_rest.hi[i]});
    square += std::pow(0.5 * (double{at_rest.hi[i]} - double{at_rest.lo[i]}), 2);
  }
  sphere.radius = std::sqrt(square);
  sphere = swept_bounds(motion, steps, sphere);
  for (int i = 0; i < 3; ++i) {
    swept.lo[i] = static_cast<float>(sphere.centre[i] - sphere.radius);
    swept.hi[i] = static_cast<float>(sphere.centre[i] + sphere.radius);
  }
  DirectionCone cone = at_rest.normals;
  bool first = true;
  double before[3], opening = 0;
  for_each_pose(motion, steps, [&](const PreciseLightPose& pose) {
    DirectionCone turned = at_rest.normals;
    pose.to_world(at_rest.normals.axis, turned.axis);
    cone = first ? turned : unite(cone, turned);
    if (!first)
      opening = std::max(opening, std::acos(std::clamp(dot3(before, turned.axis), -1.0, 1.0)));
    std::copy_n(turned.axis, 3, before);
    first = false;
  });
  cone.angle = std::min(cone.angle + 0.5 * opening, std::numbers::pi);
  swept.normals = cone;
  return swept;
}

}  // namespace wavecomb
