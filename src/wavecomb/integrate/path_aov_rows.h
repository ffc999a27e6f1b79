// SPDX-License-Identifier: Apache-2.0
/// What paths keep for AOVs until their light goes to the film: a row a path (path_aovs.h).
#pragma once

#include "wavecomb/core/fields.h"
#include "wavecomb/film/aov_film.h"

namespace wavecomb {

/// What the camera's ray met, before it is shaded; kNothingHit where it did not.
template <typename F>
struct FirstHitRow {
  Vec3<F> position;
  UInt<F> object, material, instance;
  WAVECOMB_FIELDS(position, object, material, instance)
};

/// Values that AOVs of the nearest sample have of it: a line for each such row whose source is
/// kHit.
template <typename Put>
inline void for_each_hit_value(const FirstHitRow<float>& hit, const Put& put) {
  put(Aov::kPosition, hit.position);
  put(Aov::kMaterialId, id_value(hit.material));
  put(Aov::kInstanceId, id_value(hit.instance));
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

}  // namespace wavecomb
