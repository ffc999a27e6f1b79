// SPDX-License-Identifier: Apache-2.0
/// What paths keep for AOVs until their light goes to the film: a row a path (path_aovs.h).
#pragma once

#include <cstring>

#include "wavecomb/core/fields.h"
#include "wavecomb/core/soa.h"
#include "wavecomb/film/aov_film.h"

namespace wavecomb {

/// What the camera's ray met, before it is shaded; kNothingHit where it did not.
template <typename F>
struct FirstHitRow {
  Vec3<F> position;
  UInt<F> object, material, instance;
  F depth, distance;  ///< along the camera's axis, and from where the camera is
  WAVECOMB_FIELDS(position, object, material, instance, depth, distance)
};

/// What paths meet in a volume: its number, or, in a mesh, placed_geometry of the mesh; and the
/// material.
template <typename F>
struct VolumeSeen {
  UInt<F> volume, place, material;
  Mask<F> in_mesh;
};

/// How the camera's ray went.
template <typename F>
struct RayEndRow {
  F depth;           ///< infinite where the camera's ray has met nothing
  F in_volume;       ///< 1 where a volume has stopped it, else 0
  Color<F> through;  ///< what volumes let through of what it has met, 0 where they have stopped it
  WAVECOMB_FIELDS(depth, in_volume, through)
};

/// Values that AOVs of the nearest sample have of it: a line for each such row whose source is
/// kHit.
template <typename Put>
inline void for_each_hit_value(const FirstHitRow<float>& hit, const Put& put) {
  put(Aov::kPosition, hit.position);
  put(Aov::kMaterialId, id_value(hit.material));
  put(Aov::kInstanceId, id_value(hit.instance));
  put(Aov::kDepthNearest, hit.depth);
  put(Aov::kDistance, hit.distance);
}

/// Albedo and normal of the last vertex that guides a denoiser.
template <typename F>
struct GuideRow {
  Color<F> albedo;
  Vec3<F> normal;
  F is_final;  ///< 1 once a vertex was not clear
  WAVECOMB_FIELDS(albedo, normal, is_final)
};

/// Sums over the bounces of a path: of the probabilities with which the field chose their
/// directions, and of those with which roulette let them go on.
template <typename F>
struct BounceRow {
  F guided, survived, bounces;
  WAVECOMB_FIELDS(guided, survived, bounces)
};

/// Rows of some words a slot.
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

/// The words of a value, one after another from word `at` on.
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
