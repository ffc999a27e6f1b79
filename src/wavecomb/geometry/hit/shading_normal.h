// SPDX-License-Identifier: Apache-2.0
/// Adjustment of shading normals to the viewing direction.
///
/// A shading normal n that differs from the geometric normal g can be inconsistent with the viewing
/// direction: n may point away from the viewer, or the mirror direction about n may point below the
/// surface, where no light comes from. In the following, w points to the viewer, and g and n are on
/// the viewer's side.
#pragma once

#include "wavecomb/core/vec.h"

namespace wavecomb {

namespace detail {
/// Returns 1 if a ray along `dir` hits the side of the surface to which `ng` points, else -1.
template <typename F>
WAVECOMB_INLINE F incident_side(const Vec3<F>& dir, const Vec3<F>& ng) {
  return select(dot(dir, ng) < 0.f, F(1.f), F(-1.f));
}
}  // namespace detail

/// Returns `n` or, if w . n < 0.001, `n` bent towards the viewer until w . n >= 0.001. `dir` = -w
/// is the direction of the ray.
template <typename F>
WAVECOMB_INLINE Vec3<F> facing_normal(const Vec3<F>& dir, const Vec3<F>& ng, const Vec3<F>& n) {
  constexpr float kEdge = 1e-3f;
  const F towards = detail::incident_side(dir, ng);
  const F view_cosine = -dot(dir, n) * towards;
  const Mask<F> away = view_cosine < kEdge;
  if (none(away)) return n;
  return select<F>(away, normalize(fma(dir, F(-towards * (kEdge - view_cosine)), n)), n);
}

/// Bends `n`, which faces the viewer, until the mirror direction r = 2 (w . n) n - w leaves the
/// surface, and returns the result. If r . g is below t = min(0.9 w . g, 0.01), r is raised to r .
/// g = t, and n becomes the half vector of w and the raised r (A. Keller et al., "The Iray Light
/// Transport Simulation and Rendering System", 2017, appendix A.3). The adjustment avoids black
/// rims on glossy surfaces with a normal map.
template <typename F>
WAVECOMB_INLINE Vec3<F> reflecting_normal(const Vec3<F>& dir, const Vec3<F>& ng, const Vec3<F>& n) {
  constexpr float kHeight = 0.01f, kMinCosine = 1e-4f;
  const F towards = detail::incident_side(dir, ng);
  const Vec3<F> g = ng * towards, w = -dir;
  const F c = dot(w, g);
  const Vec3<F> r = fma(n, F(2.f * dot(w, n)), dir);
  const F height = dot(r, g), least = min(F(0.9f * c), F(kHeight));
  const Mask<F> below = height < least;
  if (none(below)) return n;
  const Vec3<F> raised = normalize(fma(g, F(least - height), r));
  // At grazing incidence, w and the raised direction would cancel out.
  const Vec3<F> between = select<F>(c < kMinCosine, g, w + raised);
  return select<F>(below, normalize(between) * towards, n);
}

}  // namespace wavecomb
