// SPDX-License-Identifier: Apache-2.0
/// Shading normals that a viewer may see.
///
/// A shading normal n that differs from the geometric one, g, is seen from directions from which no
/// surface could be: it may look away from the viewer, and mirror what is behind the surface, from
/// where no light comes. Below, w points to the viewer, and g and n to his side.
#pragma once

#include "wavecomb/core/vec.h"

namespace wavecomb {

namespace detail {
/// 1 where a ray along `dir` meets the side that `ng` points to, else -1.
template <typename F>
WAVECOMB_INLINE F side_met(const Vec3<F>& dir, const Vec3<F>& ng) {
  return select(dot(dir, ng) < 0.f, F(1.f), F(-1.f));
}
}  // namespace detail

/// `n` for a ray along `dir`, bent towards it until it is seen edge-on (w . n >= 0.001) where it
/// looks away.
template <typename F>
WAVECOMB_INLINE Vec3<F> facing_normal(const Vec3<F>& dir, const Vec3<F>& ng, const Vec3<F>& n) {
  constexpr float kEdge = 1e-3f;
  const F towards = detail::side_met(dir, ng);
  const F seen = -dot(dir, n) * towards;
  const Mask<F> away = seen < kEdge;
  if (none(away)) return n;
  return select<F>(away, normalize(fma(dir, F(-towards * (kEdge - seen)), n)), n);
}

/// `n`, which faces the ray, bent until its mirror direction r = 2 (w . n) n - w leaves the
/// surface: where r . g is below t = min(0.9 w . g, 0.01), r is lifted to that height, and n is
/// half way between w and that (A. Keller et al., "The Iray Light Transport Simulation and
/// Rendering System", 2017, appendix A.3). Without, glossy surfaces with a normal map have black
/// rims.
template <typename F>
WAVECOMB_INLINE Vec3<F> reflecting_normal(const Vec3<F>& dir, const Vec3<F>& ng, const Vec3<F>& n) {
  constexpr float kHeight = 0.01f, kLeastCosine = 1e-4f;
  const F towards = detail::side_met(dir, ng);
  const Vec3<F> g = ng * towards, w = -dir;
  const F c = dot(w, g);
  const Vec3<F> r = fma(n, F(2.f * dot(w, n)), dir);
  const F height = dot(r, g), least = min(F(0.9f * c), F(kHeight));
  const Mask<F> below = height < least;
  if (none(below)) return n;
  const Vec3<F> lifted = normalize(fma(g, F(least - height), r));
  // At the very edge both would cancel.
  const Vec3<F> between = select<F>(c < kLeastCosine, g, w + lifted);
  return select<F>(below, normalize(between) * towards, n);
}

}  // namespace wavecomb
