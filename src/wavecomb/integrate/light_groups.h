// SPDX-License-Identifier: Apache-2.0
/// Whose light a contribution is. Run only where light groups are asked for.
#pragma once

#include "wavecomb/integrate/aov_tables.h"
#include "wavecomb/integrate/steps/emit.h"

namespace wavecomb {

/// Where the groups of the lanes' lights are kept; kNoGroup where they are not, and for kNoLight.
template <typename F>
inline UInt<F> kept_group(const uint32_t* kept, const UInt<F>& light, const Mask<F>& active) {
  using U = UInt<F>;
  const Mask<U> known(active & Mask<F>(light != U(kNoLight)));
  return select(known, gather<U>(kept, light, known), U(kNoGroup));
}

/// Splits what environment_emission gives by light: runs add(light, colour) for each infinite light
/// that is_wanted(light). The shares are cut by the same factor as their sum is, so that they add
/// up to it. The body is in steps/escape.h.
template <typename F, typename IsWanted, typename Add>
void split_environment(const SceneView& scene, const ShadeSettings& settings, uint32_t depth,
                       const PathState<F>& path, const Mask<F>& active, const IsWanted& is_wanted,
                       const Add& add);

}  // namespace wavecomb
