// SPDX-License-Identifier: Apache-2.0
/// Structs of AOV values that are stored for each path until the path's values are added to the
/// film (path_aovs.h).
#pragma once

#include <cstring>

#include "wavecomb/core/rows/fields.h"
#include "wavecomb/core/rows/soa.h"
#include "wavecomb/film/aov_film.h"

namespace wavecomb {

/// AOV values of the first hit of a camera ray. Indices are `kNoHitId` if the ray hit nothing.
template <typename F>
struct FirstHitRow {
  Vec3<F> position;
  UInt<F> object, material, instance;
  F depth, distance;  ///< distances along the camera's axis and from the camera's position
  WAVECOMB_FIELDS(position, object, material, instance, depth, distance)
};

/// Scattering event of a path in a medium. The medium is a volume with the index `volume` or, in
/// the lanes `in_mesh`, fills the mesh `object` (a result of `instance_geometry`).
template <typename F>
struct VolumeHit {
  UInt<F> volume, object, material;
  Mask<F> in_mesh;
};

/// Geometry and material that a camera ray hits first.
template <typename F>
struct FirstSurface {
  UInt<F> inst, geom;  ///< instance, and index of the geometry within the instance's group
  UInt<F> material;
};

/// AOV values of the end point of a camera ray.
template <typename F>
struct RayEndRow {
  F depth;      ///< depth of the end point; infinite if the ray hits nothing
  F in_volume;  ///< 1 if a volume stopped the ray, else 0
  Color<F>
      through;  ///< transmittance of the volumes in front of the hit; 0 if a volume stopped the ray
  WAVECOMB_FIELDS(depth, in_volume, through)
};

/// Calls `put(aov, value)` for each AOV of kind `kNearest` whose source is `kHit`.
template <typename Put>
inline void for_each_hit_value(const FirstHitRow<float>& hit, const Put& put) {
  put(Aov::kPosition, hit.position);
  put(Aov::kMaterialId, id_value(hit.material));
  put(Aov::kInstanceId, id_value(hit.instance));
  put(Aov::kDepthNearest, hit.depth);
  put(Aov::kDistance, hit.distance);
}

/// Inputs of the denoiser: albedo and normal of the path's first vertex on a surface that is not
/// clear (glass and mirrors are clear), or of the latest vertex if all surfaces so far were clear.
template <typename F>
struct GuideRow {
  Color<F> albedo;
  Vec3<F> normal;
  F is_final;  ///< 1 if the path had a vertex on a surface that is not clear, else 0
  WAVECOMB_FIELDS(albedo, normal, is_final)
};

/// Sums over the bounces of a path: the probabilities that directions were sampled from the guiding
/// field, the survival probabilities of Russian roulette, and the number of bounces.
template <typename F>
struct BounceRow {
  F guided, survived, bounces;
  WAVECOMB_FIELDS(guided, survived, bounces)
};

/// Array with a row of `words` 32-bit words for each path slot.
struct SlotRows {
  SoaBlock owner;
  float* rows = nullptr;
  size_t words = 0;

  SlotRows() = default;
  SlotRows(size_t capacity, size_t words_)
      : owner(1, capacity * words_), rows(owner.floats(0)), words(words_) {}
  explicit operator bool() const { return rows != nullptr; }
  void zero(size_t slots) const {
    if (rows) std::memset(rows, 0, slots * words * sizeof(float));
  }
  size_t bytes() const { return owner.bytes(); }
};

/// Stores the components of `value` in consecutive words of `rows`. `at` is the index of the first
/// word in each lane.
template <typename F>
inline void scatter_words(float* rows, const F& value, const UInt<F>& at, const Mask<F>& active) {
  scatter<F>(rows, value, at, active);
}
template <typename F>
inline void scatter_words(float* rows, const Vec2<F>& value, const UInt<F>& at,
                          const Mask<F>& active) {
  scatter<F>(rows, value.x, at, active);
  scatter<F>(rows, value.y, at + 1u, active);
}
template <typename F>
inline void scatter_words(float* rows, const Vec3<F>& value, const UInt<F>& at,
                          const Mask<F>& active) {
  scatter<F>(rows, value.x, at, active);
  scatter<F>(rows, value.y, at + 1u, active);
  scatter<F>(rows, value.z, at + 2u, active);
}

}  // namespace wavecomb
