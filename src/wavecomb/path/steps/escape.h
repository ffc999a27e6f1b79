// SPDX-License-Identifier: Apache-2.0
/// Light of the environment that a path receives when it leaves the scene.
#pragma once

#include "wavecomb/aov/light_groups.h"
#include "wavecomb/light/sampling/escape.h"
#include "wavecomb/path/steps/interact.h"

namespace wavecomb {

/// Returns the contribution of the environment to a path that leaves the scene.
template <typename F>
inline Color<F> environment_emission(const SceneView& scene, const ShadeSettings& settings,
                                     uint32_t depth, const PathState<F>& path,
                                     const Mask<F>& active) {
  const Mask<F> delta = not_(Mask<F>(path.pdf > 0.f));
  const Color<F> le =
      escaped_radiance<F>(scene.lights, path.o, path.dir, path.pdf, delta, active, depth == 0,
                          path.link, path.ratio, path.time, path.diffuse);
  return clean<F>(path.throughput * le, clamp_limit(settings, depth));
}

template <typename F, typename IsWanted, typename Add>
inline void split_environment(const SceneView& scene, const ShadeSettings& settings, uint32_t depth,
                              const PathState<F>& path, const Mask<F>& active,
                              const IsWanted& is_wanted, const Add& add) {
  const Mask<F> delta = not_(Mask<F>(path.pdf > 0.f));
  const Color<F> all =
      path.throughput * escaped_radiance<F>(scene.lights, path.o, path.dir, path.pdf, delta, active,
                                            depth == 0, path.link, path.ratio, path.time,
                                            path.diffuse);
  const Mask<F> ok = active & is_finite(all.x) & is_finite(all.y) & is_finite(all.z);
  const float limit = clamp_limit(settings, depth);
  const F y = luminance(all);
  const F scale = limit > 0 ? select(y > limit, F(limit / max(y, F(1e-30f))), F(1.f)) : F(1.f);
  for (uint32_t i = 0; i < scene.lights.infinite_count; ++i) {
    if (!is_wanted(i)) continue;
    const Color<F> le =
        infinite_light_radiance<F>(scene.lights, i, path.o, path.dir, path.pdf, delta, active,
                                   depth == 0, path.link, path.ratio, path.time, path.diffuse);
    add(i, select<F>(ok, path.throughput * le * scale, Color<F>(F(0.f))));
  }
}

}  // namespace wavecomb
