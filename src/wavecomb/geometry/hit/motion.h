// SPDX-License-Identifier: Apache-2.0
/// Positions at the time of a path. motion.inl defines the functions that read moving meshes.
///
/// All motion is linear between the motion steps that the scene stores, as in Embree's traversal.
/// Time runs from 0 at shutter open to 1 at shutter close.
#pragma once

#include <array>
#include <cmath>

#include "wavecomb/core/rows/rows.h"
#include "wavecomb/core/sampler.h"
#include "wavecomb/core/vec.h"
#include "wavecomb/scene/scene_view.h"

namespace wavecomb {

/// Returns the shutter time of a path, which is in [0, 1) and the same for all rays of the path.
/// The time depends only on the sample key.
template <typename F>
inline F path_time(SamplerKind sampler, const SampleKey<F>& key) {
  return sample_4d<F>(sampler, key, kTimeSet).x;
}

/// Affine transform of each lane: the rows of the matrix and the translation.
template <typename F>
struct MatrixLanes {
  Vec3<F> row[3], t;
};

namespace detail {

/// Transforms of two consecutive motion steps and the interpolation weight of the second.
template <typename F>
struct MatrixPair {
  std::array<F, 16> a, b;
  F part;

  /// The instances of all active lanes must move. `first` and `segments` are the members of
  /// `StepRange` for each lane.
  MatrixPair(const MatrixStep* steps, const UInt<F>& first, const UInt<F>& segments, const F& time,
             const Mask<F>& active) {
    const StepInterpolation<F> at(time, segments);
    const UInt<F> word = (first + at.before) * 16u;
    a = load_rows<16, F>(steps, word, active);
    b = load_rows<16, F>(steps, word + 16u, active);
    part = at.part;
  }
  F at(size_t k) const { return fma(F(b[k] - a[k]), part, a[k]); }
  MatrixLanes<F> matrix() const {
    return {{{at(0), at(1), at(2)}, {at(4), at(5), at(6)}, {at(8), at(9), at(10)}},
            {at(3), at(7), at(11)}};
  }
  /// Returns the larger of the magnitudes of matrix entry k in the two transforms.
  F reach(size_t k) const { return max(abs(a[k]), abs(b[k])); }
};

/// Mesh array, such as positions, whose values may differ between motion steps.
template <typename F>
class MovingRows {
 public:
  MovingRows(const SceneView& scene, const UInt<F>& mesh, const F& time,
             uint64_t MeshRecord::* array, uint64_t MeshMotion::* stride, const Mask<F>& active) {
    const InMemory<UInt<F>> index(mesh);
    alignas(64) float at[kWidth<F>], parts[kWidth<F>];
    store(at, time);
    const uint32_t bits = lane_bits<F>(active);
    for (size_t i = 0; i < kWidth<F>; ++i) {
      const MeshRecord& record = scene.meshes[(bits >> i & 1u) != 0 ? index.value[i] : 0u];
      const MeshMotion& motion = scene.motion.meshes[record.motion];
      const StepInterpolation<float> interpolation(at[i], motion.segments);
      before_[i] = record.*array + interpolation.before * (motion.*stride);
      after_[i] = before_[i] + (motion.*stride);  // the stride is 0 for a mesh that does not deform
      parts[i] = interpolation.part;
    }
    part_ = load<F>(parts);
  }

  struct Value {
    /// Interpolated value, and for each component the larger of its magnitudes at the two motion
    /// steps.
    Vec3<F> v, reach;
  };
  Value operator()(const UInt<F>& index, const Mask<F>& active) const {
    const auto rows = [&](const uint64_t* base) {
      const auto r =
          load_rows_of<3, F>([&](size_t lane) { return reinterpret_cast<const void*>(base[lane]); },
                             index * 3u, active);
      return Vec3<F>(r[0], r[1], r[2]);
    };
    const Vec3<F> a = rows(before_), b = rows(after_);
    const auto larger = [](const F& x, const F& y) { return max(abs(x), abs(y)); };
    // Do not use fma, so that the result is bit-identical to the result of curve traversal in every
    // build.
    return {Vec3<F>(b - a) * part_ + a, {larger(a.x, b.x), larger(a.y, b.y), larger(a.z, b.z)}};
  }

 private:
  uint64_t before_[kWidth<F>], after_[kWidth<F>];
  F part_;
};

}  // namespace detail

/// Transforms of the hit instances at the times of the hits.
template <typename F>
struct MovedInstance {
  Mask<F> moves;
  MatrixLanes<F> to_world;  ///< transforms, valid in lanes whose instances move
  F side;                   ///< sign of the determinant of to_world
  F size;                   ///< upper bound of the magnitudes of the summands of a world position
};

/// Returns the transforms of moving instances. `maps` holds the transforms of instances that do not
/// move: their linear part `row` and translation `t`. `reach` is an upper bound of the magnitudes
/// of local coordinates. This function and the following functions are not inlined, so that kernels
/// of scenes without motion stay small.
template <typename F, typename Maps>
[[gnu::noinline, gnu::cold]] MovedInstance<F> moved_instance(const SceneView& scene,
                                                             const UInt<F>& inst, const F& time,
                                                             const Maps& maps, const Vec3<F>& reach,
                                                             const Mask<F>& active);

/// Vertices of a hit triangle at the time of the hit, and the transform of its instance.
template <typename F>
struct MovedTriangle {
  Vec3<F> p[3];
  MovedInstance<F> instance;
};

template <typename F, typename Maps>
[[gnu::noinline, gnu::cold]] MovedTriangle<F> moved_triangle(
    const SceneView& scene, const UInt<F>& inst, const UInt<F>& mesh,
    const std::array<UInt<F>, 3>& corners, const F& time, const Maps& maps, const Mask<F>& active);

/// Returns the vertex or corner normals with the given indices at the time of a hit.
template <typename F>
[[gnu::noinline, gnu::cold]] std::array<Vec3<F>, 3> moved_normals(
    const SceneView& scene, const UInt<F>& mesh, const std::array<UInt<F>, 3>& indices,
    const F& time, const Mask<F>& active);

}  // namespace wavecomb
