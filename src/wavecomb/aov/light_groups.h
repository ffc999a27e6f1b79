// SPDX-License-Identifier: Apache-2.0
/// Functions that add radiance to light groups. They are called only if the render has light group
/// AOVs.
#pragma once

#include "wavecomb/aov/aov_tables.h"
#include "wavecomb/path/steps/emit.h"

namespace wavecomb {

/// Returns the index of each light's group among the film's light groups. Returns `kNoGroup` if the
/// group has no layer or the light is `kNoLight`.
template <typename F>
inline UInt<F> film_group(const uint32_t* kept, const UInt<F>& light, const Mask<F>& active) {
  using U = UInt<F>;
  const Mask<U> known(active & Mask<F>(light != U(kNoLight)));
  return select(known, gather<U>(kept, light, known), U(kNoGroup));
}

/// Splits the result of `environment_emission` by light: calls `add(light, colour)` for each
/// infinite light for which `is_wanted(light)` is true. Clamping scales all contributions by the
/// same factor, so that they add up to the clamped sum. The function is defined in
/// path/steps/escape.h.
template <typename F, typename IsWanted, typename Add>
void split_environment(const SceneView& scene, const ShadeSettings& settings, uint32_t depth,
                       const PathState<F>& path, const Mask<F>& active, const IsWanted& is_wanted,
                       const Add& add);

}  // namespace wavecomb
