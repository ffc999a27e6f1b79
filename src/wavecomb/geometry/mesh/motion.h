// SPDX-License-Identifier: Apache-2.0
/// Motion while the shutter is open: values at equally spaced times, interpolated linearly.
#pragma once

#include <cmath>
#include <cstdint>
#include <span>
#include <vector>

#include "wavecomb/core/affine.h"
#include "wavecomb/core/math.h"

namespace wavecomb {

/// Maximum number of motion steps, as in Embree.
inline constexpr uint32_t kMaxSteps = 129;

/// Distances in memory between the arrays of consecutive motion steps of a mesh.
/// `MeshRecord::motion` is an index into `MotionView::meshes`, whose entry 0 is for meshes that do
/// not deform.
struct MeshMotion {
  uint64_t positions = 0, normals = 0;  ///< bytes
  /// Number of motion steps minus one; 0 if the mesh does not deform.
  uint32_t segments = 0;
  uint32_t pad = 0;
};
static_assert(sizeof(MeshMotion) == 24);

/// Position of a time in [0, 1] among `segments` + 1 equally spaced motion steps.
template <typename F>
struct StepInterpolation {
  UInt<F> before;  ///< index of the last motion step that is not after the time
  F part;          ///< interpolation weight of the next step

  StepInterpolation(const F& time, const UInt<F>& segments) {
    const F at = time * F(Int<F>(segments));
    const UInt<F> whole(to_int<F>(at)), last = segments - 1u;
    before = select(Mask<UInt<F>>(whole < last), whole, last);
    part = at - F(Int<F>(before));
  }
};

/// Range of a list of steps: [first, first + segments]. 0 segments means no motion.
struct StepRange {
  uint32_t first = 0, segments = 0;
  bool moves() const { return segments > 0; }
};

/// Packed transform of an instance at one motion step.
struct alignas(64) MatrixStep {
  /// Rows of a 3 x 4 matrix. Each row holds a row of the linear part and a component of the
  /// translation.
  float to_world[12] = {};
  float pad[4] = {};

  MatrixStep() = default;
  explicit MatrixStep(const Affine& m)
      : to_world{m.row[0].x, m.row[0].y, m.row[0].z, m.t.x,      m.row[1].x, m.row[1].y,
                 m.row[1].z, m.t.y,      m.row[2].x, m.row[2].y, m.row[2].z, m.t.z} {}
  Affine affine() const {
    const float* w = to_world;
    return {{{w[0], w[1], w[2]}, {w[4], w[5], w[6]}, {w[8], w[9], w[10]}}, {w[3], w[7], w[11]}};
  }
};
static_assert(sizeof(MatrixStep) == 64);

/// Device view of a scene's motion.
struct MotionView {
  const MeshMotion* meshes = nullptr;
  const StepRange* instances = nullptr;  ///< indexed by instance; null if no instance moves
  const MatrixStep* steps = nullptr;
};

/// Interpolates the matrix entries of the transforms a and b linearly, where `part` is the weight
/// of b, as Embree does.
inline Affine between(const Affine& a, const Affine& b, float part) {
  const auto mix = [&](const Vec3<float>& p, const Vec3<float>& q) {
    return p * (1.f - part) + q * part;
  };
  return {{mix(a.row[0], b.row[0]), mix(a.row[1], b.row[1]), mix(a.row[2], b.row[2])},
          mix(a.t, b.t)};
}

/// Returns the transform at step k of n, resampled from `steps`.
inline Affine at_step(std::span<const Affine> steps, uint32_t k, uint32_t n) {
  const uint64_t offset = uint64_t{k} * (steps.size() - 1);
  const size_t before = offset / n;
  if (offset % n == 0) return steps[before];
  return between(steps[before], steps[before + 1],
                 static_cast<float>(offset % n) / static_cast<float>(n));
}

/// Returns the number of time segments for the product of two moving transforms with `a` and `b`
/// time segments. The result is a common multiple of `a` and `b`, up to a limit.
uint32_t common_segments(uint32_t a, uint32_t b);

}  // namespace wavecomb
