// SPDX-License-Identifier: Apache-2.0
/// Control points of curves and points at a shutter time.
#pragma once

#include <cstddef>
#include <span>

#include "wavecomb/core/lanes/lanes.h"
#include "wavecomb/geometry/mesh/mesh.h"
#include "wavecomb/geometry/mesh/motion.h"

namespace wavecomb {

/// Points and normals of a mesh at a given time. The values are bit-identical to the values of
/// `detail::MovingRows`, which shading uses.
class PointsAt {
 public:
  PointsAt(const Mesh& mesh, float time) : mesh_(mesh), place_(time, mesh.steps - 1) {}

  Vec3<float> position(size_t point) const { return at(mesh_.positions, point); }
  Vec3<float> normal(size_t point) const { return at(mesh_.normals, point); }

 private:
  WAVECOMB_INLINE Vec3<float> at(std::span<const float> values, size_t point) const {
    if (mesh_.deforms()) [[unlikely]]
      return between(values, point);
    return {values[3 * point], values[3 * point + 1], values[3 * point + 2]};
  }

  [[gnu::noinline]] Vec3<float> between(std::span<const float> values, size_t point) const {
    const size_t stride = values.size() / mesh_.steps;
    const float* p = &values[place_.before * stride + 3 * point];
    const float* q = p + stride;
    const Vec3<float> a(p[0], p[1], p[2]), b(q[0], q[1], q[2]);
    return (b - a) * place_.part + a;
  }

  const Mesh& mesh_;
  const StepInterpolation<float> place_;
};

}  // namespace wavecomb
