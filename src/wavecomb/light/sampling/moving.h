// SPDX-License-Identifier: Apache-2.0
/// Lights that move while the shutter is open (light/description/motion.h has the formula). Points
/// and directions at the shutter time are transformed to the light's rest pose, samples and
/// densities are computed there, and directions are transformed back.
#pragma once

#include "wavecomb/core/rows/rows.h"
#include "wavecomb/geometry/mesh/motion.h"
#include "wavecomb/light/records/record_reader.h"

namespace wavecomb {

/// Pose of the light of each lane at a given time, relative to the light's rest pose. For lights
/// without motion the transform is exactly the identity.
template <typename F>
struct LightPose {
  Vec3<F> x, y, z;  ///< directions of the rest pose's axes at the given time
  Vec3<F> position, origin;

  Vec3<F> to_rest(const Vec3<F>& direction) const {
    return {dot(x, direction), dot(y, direction), dot(z, direction)};
  }
  Vec3<F> point_to_rest(const Vec3<F>& p) const { return to_rest(p - position) + origin; }
  Vec3<F> to_world(const Vec3<F>& direction) const {
    return fma(x, direction.x, fma(y, direction.y, Vec3<F>(z * direction.z)));
  }
  Vec3<F> point_to_world(const Vec3<F>& p) const { return to_world(p - origin) + position; }
};

/// Returns the pose of light records `light` at `time`. The pose is used only if LightView::motions
/// is not null.
template <typename F>
[[gnu::noinline]] LightPose<F> light_pose(const LightView& view, const UInt<F>& light,
                                          const F& time, const Mask<F>& lanes) {
  using U = UInt<F>;
  const auto m = load_rows<8, F>(view.motions, light * 8u, lanes);
  const U first = float_bits<F>(m[3]), segments = float_bits<F>(m[4]);
  const Mask<F> moves = lanes & Mask<F>(segments != U(0u));
  const StepInterpolation<F> at(time, select(Mask<U>(moves), segments, U(1u)));
  const U step = (first + at.before) * 8u;
  const auto a = load_rows<8, F>(view.motion_steps, step, moves);
  const auto b = load_rows<8, F>(view.motion_steps, step + 8u, moves);
  const auto mix = [&](size_t i) { return F(fma(at.part, F(b[i] - a[i]), a[i])); };
  F q[4] = {mix(0), mix(1), mix(2), mix(3)};
  const F square = fma(q[0], q[0], fma(q[1], q[1], fma(q[2], q[2], F(q[3] * q[3]))));
  const F scale = 1.f / sqrt(select(moves, square, F(1.f)));
  for (F& c : q) c = select(moves, F(c * scale), F(0.f));
  const F xx = q[0] * q[0], yy = q[1] * q[1], zz = q[2] * q[2], xy = q[0] * q[1], xz = q[0] * q[2],
          yz = q[1] * q[2], xw = q[0] * q[3], yw = q[1] * q[3], zw = q[2] * q[3];
  const auto rest = [](const F& square_sum) { return F(1.f - 2.f * square_sum); };
  const auto twice = [](const F& sum) { return F(2.f * sum); };
  const auto moved = [&](const F& v) { return select(moves, v, F(0.f)); };
  return {{rest(F(yy + zz)), twice(F(xy + zw)), twice(F(xz - yw))},
          {twice(F(xy - zw)), rest(F(xx + zz)), twice(F(yz + xw))},
          {twice(F(xz + yw)), twice(F(yz - xw)), rest(F(xx + yy))},
          {moved(mix(4)), moved(mix(5)), moved(mix(6))},
          {moved(m[0]), moved(m[1]), moved(m[2])}};
}

}  // namespace wavecomb
