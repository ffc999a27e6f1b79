// SPDX-License-Identifier: Apache-2.0
/// Light that a path meets where it leaves the scene.
#pragma once

#include "wavecomb/integrate/light_groups.h"
#include "wavecomb/integrate/steps/interact.h"
#include "wavecomb/light/escape.h"

namespace wavecomb {

/// Radiance of the environment met by a path that left the scene.
template <typename F>
inline Color<F> environment_emission(const SceneView& scene, const ShadeSettings& settings,
                                     uint32_t depth, const PathState<F>& path,
                                     const Mask<F>& active) {
  const Mask<F> delta = not_(Mask<F>(path.pdf > 0.f));
  const Color<F> le =
      escaped_radiance<F>(scene.lights, path.o, path.dir, path.pdf, delta, active, depth == 0,
                          path.link, path.joined(), path.time, path.diffuse);
  return clean<F>(path.throughput * le, clamp_limit(settings, depth));
}

/// Calls add(i, radiance) for each infinite light i that `is_wanted`; the sum over all is
/// environment_emission.
template <typename F, typename IsWanted, typename Add>
inline void split_environment(const SceneView& scene, const ShadeSettings& settings, uint32_t depth,
                              const PathState<F>& path, const Mask<F>& active,
                              const IsWanted& is_wanted, const Add& add) {
  const Mask<F> delta = not_(Mask<F>(path.pdf > 0.f));
  const Color<F> all =
      path.throughput * escaped_radiance<F>(scene.lights, path.o, path.dir, path.pdf, delta, active,
                                            depth == 0, path.link, path.joined(), path.time,
                                            path.diffuse);
  const ContributionLimit<F> limit(all, clamp_limit(settings, depth));
  for (uint32_t i = 0; i < scene.lights.infinite_count; ++i) {
    if (!is_wanted(i)) continue;
    const Color<F> le =
        infinite_light_radiance<F>(scene.lights, i, path.o, path.dir, path.pdf, delta, active,
                                   depth == 0, path.link, path.joined(), path.time, path.diffuse);
    add(i, select<F>(active, limit.of(path.throughput * le), Color<F>(F(0.f))));
  }
}

}  // namespace wavecomb
