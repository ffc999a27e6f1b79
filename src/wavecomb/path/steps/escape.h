// SPDX-License-Identifier: Apache-2.0
/// Light of the environment that a path receives when it leaves the scene.
#pragma once

#include "wavecomb/aov/light_groups.h"
#include "wavecomb/light/sampling/escape.h"
#include "wavecomb/path/steps/interact.h"

namespace wavecomb {

/// Returns the ray of a path that leaves the scene after `depth` vertices.
template <typename F>
inline EscapedRay<F> escaped_ray(const PathState<F>& path, uint32_t depth) {
  return {.from = path.o,
          .dir = path.dir,
          .bsdf_pdf = path.pdf,
          .is_delta = not_(Mask<F>(path.pdf > 0.f)),
          .from_camera = depth == 0,
          .link = path.link,
          .ratio = path.ratio,
          .time = path.time,
          .diffuse = path.diffuse};
}

/// Returns the contribution of the environment to a path that leaves the scene.
template <typename F>
inline Color<F> environment_emission(const SceneView& scene, const ShadeSettings& settings,
                                     uint32_t depth, const PathState<F>& path,
                                     const Mask<F>& active) {
  const Color<F> le = escaped_radiance<F>(scene.lights, escaped_ray<F>(path, depth), active);
  return clean<F>(path.throughput * le, clamp_limit(settings, depth));
}

/// Calls add(light, contribution) for each infinite light with is_wanted(light). The contributions
/// of all lights add up to environment_emission().
template <typename F, typename IsWanted, typename Add>
inline void split_environment(const SceneView& scene, const ShadeSettings& settings, uint32_t depth,
                              const PathState<F>& path, const Mask<F>& active,
                              const IsWanted& is_wanted, const Add& add) {
  const EscapedRay<F> ray = escaped_ray<F>(path, depth);
  const Color<F> all = path.throughput * escaped_radiance<F>(scene.lights, ray, active);
  const ContributionLimit<F> limit(all, clamp_limit(settings, depth));
  for (uint32_t i = 0; i < scene.lights.infinite_count; ++i) {
    if (!is_wanted(i)) continue;
    const Color<F> le = infinite_light_radiance<F>(scene.lights, i, ray, active);
    add(i, select<F>(active, limit.of(path.throughput * le), Color<F>(F(0.f))));
  }
}

}  // namespace wavecomb
