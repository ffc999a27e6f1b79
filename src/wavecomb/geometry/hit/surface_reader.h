// SPDX-License-Identifier: Apache-2.0
/// Types for hits and shading points, and functions that read the mesh and instance of each lane.
#pragma once

#include "wavecomb/core/frame.h"
#include "wavecomb/core/math.h"
#include "wavecomb/core/rows/fields.h"
#include "wavecomb/core/rows/rows.h"
#include "wavecomb/geometry/hit/motion.h"
#include "wavecomb/scene/scene_view.h"

namespace wavecomb {

/// A hit on a mesh: instance (index into SceneView::instances), mesh, primitive, and the
/// barycentrics of vertices 1 and 2 of a triangle, or the coordinates defined in
/// geometry/curve/segment.h.
template <typename F>
struct MeshHit {
  UInt<F> inst, mesh, prim;
  F u, v;
  F time{};  ///< shutter time of the path, used if the scene has motion
};

/// A shading point in world space.
template <typename F>
struct Surface {
  Vec3<F> p;
  Vec3<F> ng;    ///< unit geometric normal, pointing outwards by the winding order
  Vec3<F> ns;    ///< unit shading normal on the same side as ng
  Vec3<F> dpdu;  ///< tangent along u, of any length; zero if uv was not requested
  /// 1 if v increases along ng x dpdu; -1 if v increases in the opposite direction, as in a
  /// mirrored texture.
  F handedness;
  Vec2<F> uv;
  F uv_per_length;  ///< sqrt(uv area / world-space area) of the triangle
  F offset;         ///< upper bound of the error of p along ng
  /// Vector along ng from p to the smooth surface that the vertex normals imply (see surface.h).
  Vec3<F> terminator;
  Vec3<F> unadjusted;  ///< shading normal before facing_normal() adjusts it to the viewing
                       ///< direction
};

namespace detail {

/// Reads rows of the arrays of the mesh that each lane hit.
template <typename F>
class MeshReader {
 public:
  WAVECOMB_INLINE MeshReader(const MeshRecord* meshes, const UInt<F>& mesh, const Mask<F>& active) {
    if (!kIsScalar<F> && any(active) && is_uniform<F>(mesh, active)) {
      shared_ = meshes + first_active(mesh, Mask<UInt<F>>(active));
      for (const MeshRecord*& record : records_) record = shared_;
      flags = select(Mask<UInt<F>>(active), UInt<F>(shared_->flags), UInt<F>(0u));
      return;
    }
    const InMemory<UInt<F>> index(select(Mask<UInt<F>>(active), mesh, UInt<F>(0u)));
    for (size_t i = 0; i < kWidth<F>; ++i) records_[i] = meshes + index.value[i];
    flags = gather_member<F>(meshes, &MeshRecord::flags, mesh, active);
  }

  /// Returns row `index` of a mesh array whose rows have N 32-bit words.
  template <size_t N>
  WAVECOMB_INLINE std::array<F, N> row(uint64_t MeshRecord::* array, const UInt<F>& index,
                                       const Mask<F>& active) const {
    const UInt<F> word = index * static_cast<uint32_t>(N);
    const auto rows = [&](size_t lane) {
      return reinterpret_cast<const void*>(records_[lane]->*array);
    };
    if constexpr (kIsScalar<F>) return load_rows_of<N, F>(rows, word, active);
    if (!all(active)) return some_rows<N>(array, word, active);
    if (!shared_) return load_all_rows_of<N, F>(rows, word);
    const void* const base = rows(0);
    return load_all_rows_of<N, F>([base](size_t) { return base; }, word);
  }
  Vec3<F> vec3(uint64_t MeshRecord::* array, const UInt<F>& index, const Mask<F>& active) const {
    const auto r = row<3>(array, index, active);
    return {r[0], r[1], r[2]};
  }
  Vec2<F> vec2(uint64_t MeshRecord::* array, const UInt<F>& index, const Mask<F>& active) const {
    const auto r = row<2>(array, index, active);
    return {r[0], r[1]};
  }
  /// Returns the vertex indices of triangle `prim`.
  std::array<UInt<F>, 3> corners(const UInt<F>& prim, const Mask<F>& active) const {
    const auto r = row<3>(&MeshRecord::indices, prim, active);
    return {float_bits<F>(r[0]), float_bits<F>(r[1]), float_bits<F>(r[2])};
  }

  /// Returns 32-bit word `index` of a mesh array.
  UInt<F> word(uint64_t MeshRecord::* array, const UInt<F>& index, const Mask<F>& active) const {
    const InMemory<UInt<F>> at(index);
    InMemory<UInt<F>> out(UInt<F>(0u));
    const uint32_t bits = lane_bits<F>(active);
    for (size_t i = 0; i < kWidth<F>; ++i)
      if ((bits >> i & 1u) != 0)
        out.value[i] = reinterpret_cast<const uint32_t*>(records_[i]->*array)[at.value[i]];
    return load<UInt<F>>(out.value);
  }

  UInt<F> flags;

 private:
  /// Reads rows for a packet in which some lanes are inactive. The function is not inlined, since
  /// most packets are full.
  template <size_t N>
  [[gnu::noinline]] std::array<F, N> some_rows(uint64_t MeshRecord::* array, UInt<F> word,
                                               Mask<F> active) const {
    return load_rows_of<N, F>(
        [&](size_t lane) { return reinterpret_cast<const void*>(records_[lane]->*array); }, word,
        active);
  }

  /// Mesh of the active lanes if it is the same in all of them; else null.
  const MeshRecord* shared_ = nullptr;
  const MeshRecord* records_[kWidth<F>];
};

/// Object-to-world transforms of the lanes' instances.
template <typename F>
struct InstanceMaps {
  Vec3<F> row[3], t;
  F side;  ///< sign of the determinant of the linear map

  WAVECOMB_INLINE InstanceMaps(const InstanceRecord* instances, const UInt<F>& inst,
                               const Mask<F>& active) {
    if (!kIsScalar<F> && any(active) && is_uniform<F>(inst, active)) {
      const auto* shared =
          reinterpret_cast<const float*>(instances + first_active(inst, Mask<UInt<F>>(active)));
      take([shared](size_t k) { return F(shared[k]); });
    } else {
      const auto r = load_rows<16, F>(instances, inst * 16u, active);
      take([&r](size_t k) { return r[k]; });
    }
  }

  /// Replaces the transforms of moving instances by their transforms at the hit's time.
  void set_instance(const MovedInstance<F>& to) {
    for (int i = 0; i < 3; ++i) row[i] = select<F>(to.moves, to.to_world.row[i], row[i]);
    t = select<F>(to.moves, to.to_world.t, t);
    side = select(to.moves, to.side, side);
  }
  Vec3<F> point(const Vec3<F>& p) const {
    return {fma(row[0].z, p.z, fma(row[0].y, p.y, fma(row[0].x, p.x, t.x))),
            fma(row[1].z, p.z, fma(row[1].y, p.y, fma(row[1].x, p.x, t.y))),
            fma(row[2].z, p.z, fma(row[2].y, p.y, fma(row[2].x, p.x, t.z)))};
  }
  Vec3<F> vector(const Vec3<F>& v) const {
    return {dot(row[0], v), dot(row[1], v), dot(row[2], v)};
  }
  /// Maps a normal by the cofactor matrix, whose rows are the cross products of pairs of rows.
  Vec3<F> map_normal(const Vec3<F>& n) const {
    return Vec3<F>(dot(cross(row[1], row[2]), n), dot(cross(row[2], row[0]), n),
                   dot(cross(row[0], row[1]), n)) *
           side;
  }
  /// Returns row j of the inverse of the linear map. A normal (a, b, c) in local space has the
  /// direction a row(0) + b row(1) + c row(2) in world space.
  Vec3<F> inverse_row(int j) const {
    const Vec3<F> c[3] = {cross(row[1], row[2]), cross(row[2], row[0]), cross(row[0], row[1])};
    const F det = dot(row[0], c[0]), inverse = 1.f / select(det == 0.f, F(1.f), det);
    const auto part = [j](const Vec3<F>& v) { return j == 0 ? v.x : (j == 1 ? v.y : v.z); };
    return Vec3<F>{part(c[0]), part(c[1]), part(c[2])} * inverse;
  }

 private:
  /// Reads the transform from the 32-bit words of an InstanceRecord.
  template <typename Word>
  WAVECOMB_INLINE void take(const Word& word) {
    for (uint32_t i = 0; i < 3; ++i) row[i] = {word(4 * i), word(4 * i + 1), word(4 * i + 2)};
    t = {word(3), word(7), word(11)};
    side = word(15);
  }
};

/// Returns the lanes whose meshes are curves, points or splats.
template <typename F>
inline Mask<F> is_curved(const SceneView& scene, const UInt<F>& mesh, const Mask<F>& active) {
  const UInt<F> flags = gather_member<F>(scene.meshes, &MeshRecord::flags, mesh, active);
  return active & Mask<F>((flags & uint32_t{kIsCurved}) != UInt<F>(0u));
}

template <typename F>
inline Vec3<F> abs3(const Vec3<F>& v) {
  return {abs(v.x), abs(v.y), abs(v.z)};
}

}  // namespace detail

}  // namespace wavecomb
