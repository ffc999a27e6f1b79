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
/// up to it.
template <typename F, typename IsWanted, typename Add>
inline void split_environment(const SceneView& scene, const ShadeSettings& settings, uint32_t depth,
                              const PathState<F>& path, const Mask<F>& active,
                              const IsWanted& is_wanted, const Add& add) {
  const Mask<F> delta = not_(Mask<F>(path.pdf > 0.f));
  const Color<F> all =
      path.throughput * escaped_radiance<F>(scene.lights, path.o, path.dir, path.pdf, delta, active,
                                            depth == 0, path.link, path.joined(), path.time,
                                            path.diffuse);
  const Mask<F> ok = active & is_finite(all.x) & is_finite(all.y) & is_finite(all.z);
  const float limit = clamp_limit(settings, depth);
  const F y = luminance(all);
  const F scale = limit > 0 ? select(y > limit, F(limit / max(y, F(1e-30f))), F(1.f)) : F(1.f);
  for (uint32_t i = 0; i < scene.lights.infinite_count; ++i) {
    if (!is_wanted(i)) continue;
    const Color<F> le =
        infinite_light_radiance<F>(scene.lights, i, path.o, path.dir, path.pdf, delta, active,
                                   depth == 0, path.link, path.joined(), path.time, path.diffuse);
    add(i, select<F>(ok, path.throughput * le * scale, Color<F>(F(0.f))));
  }
}

}  // namespace wavecomb
