// SPDX-License-Identifier: Apache-2.0
/// Aiming of light paths at spheres (light/description/aim.h; docs/light-paths.md).
///
/// Aiming changes a light's emission density D to D g. Let a_0 be the fraction of paths that start
/// with the light's emission distribution, and a_k the fraction aimed at sphere k of radius r_k:
///   infinite lights   g = a_0 + sum a_k [the line hits sphere k] R^2 / r_k^2
///   finite lights     g = a_0 + sum a_k [d hits sphere k] / (W_k p(d)),
/// where R is the radius of the sphere around the scene, W_k the solid angle of sphere k as seen
/// from the point on the light (4 pi inside the sphere), and p the density of directions without
/// aiming. The factor g can be computed from both ends of a path, so all MIS weights include it.
#pragma once

#include "wavecomb/core/frame.h"
#include "wavecomb/core/warp.h"
#include "wavecomb/light/description/aim.h"
#include "wavecomb/light/kinds/kinds.h"

namespace wavecomb::detail {

/// Returns 1 - cos of the half angle that a sphere of radius r subtends if its centre is at the
/// squared distance `distance2`; 2 for points inside the sphere.
template <typename F>
inline F sphere_one_minus_cos(const F& radius, const F& distance2) {
  const F radius2 = radius * radius;
  const Mask<F> outside = distance2 > radius2;
  const F sin2 = radius2 / select(outside, distance2, F(1.f));
  const F rest = 1.f - min(sin2, F(1.f));
  return select(outside, F(sin2 / F(1.f + sqrt(rest))), F(2.f));
}

/// Returns the factor g by which aiming changes the emission density of an infinite light, for
/// paths along the line through `p` with direction +-d.
template <typename F>
[[gnu::noinline]] F aim_density_infinite(const LightView& view, const Vec3<F>& p,
                                         const Vec3<F>& d) {
  const LightAim& aim = *view.aim;
  F g(aim.even);
  for (uint32_t k = 0; k < aim.count; ++k) {
    const float r2 = aim.radius[k] * aim.radius[k];
    const Vec3<F> to_centre = Vec3<F>(F(aim.x[k]), F(aim.y[k]), F(aim.z[k])) - p;
    const Vec3<F> across = to_centre - d * dot(to_centre, d);
    g += select(length_squared(across) < r2, F(aim.share[k] * (view.radius * view.radius / r2)),
                F(0.f));
  }
  return g;
}

/// Returns the factor g by which aiming changes the emission density of a finite light, for paths
/// from the point `p` along d. `own` is the density of d without aiming.
template <typename F>
[[gnu::noinline]] F aim_density_finite(const LightView& view, const Vec3<F>& p, const Vec3<F>& d,
                                       const F& own) {
  const LightAim& aim = *view.aim;
  F sum(0.f);
  for (uint32_t k = 0; k < aim.count; ++k) {
    const F radius(aim.radius[k]);
    const Vec3<F> to_centre = Vec3<F>(F(aim.x[k]), F(aim.y[k]), F(aim.z[k])) - p;
    const F along = dot(to_centre, d);
    const F one_minus_cos = sphere_one_minus_cos<F>(radius, length_squared(to_centre));
    const Mask<F> ahead = (along > 0.f) & (length_squared(to_centre - d * along) < radius * radius);
    sum += select(ahead | (one_minus_cos == 2.f), F(aim.share[k] / one_minus_cos), F(0.f));
  }
  return F(sum * kInv2Pi) / select(own > 0.f, own, F(1.f)) + aim.even;
}

/// Returns the solid angle density with which the finite light `light`, without aiming, emits paths
/// from `p` along d.
template <typename Kind, typename F>
inline F unaimed_direction_density(const LightReader<F>& light, const Vec3<F>& p,
                                   const Vec3<F>& d) {
  const F by_cosine = max(dot(Kind::template emission_normal<F>(light, p), d), F(0.f)) * kInvPi;
  return select(Kind::template is_delta<F>(light), F(kInv4Pi), by_cosine);
}

/// Returns the factor g by which aiming changes the emission density of `light`, for paths that
/// arrive at `from` along -dir over the distance t.
template <typename Kind, typename F>
inline F aim_of_kind(const LightView& view, const LightReader<F>& light, const Vec3<F>& from,
                     const Vec3<F>& dir, const F& t) {
  if constexpr (Kind::kIsInfinite) {
    return aim_density_infinite<F>(view, from, dir);
  } else {
    const Vec3<F> p = fma(dir, t, from);
    return aim_density_finite<F>(view, p, -dir, unaimed_direction_density<Kind, F>(light, p, -dir));
  }
}

/// Target sphere that each lane selects with a random number in [0, 1).
template <typename F>
struct AimChoice {
  Mask<F> aims;  ///< lanes whose paths are aimed; other lanes use the light's emission distribution
  Vec3<F> centre;
  F radius;

  AimChoice(const LightAim& aim, const F& number, const Mask<F>& active) {
    using U = UInt<F>;
    U k(0u);
    for (uint32_t i = 0; i + 1 < aim.count; ++i)
      k += select(Mask<U>(number >= aim.end[i]), U(1u), U(0u));
    aims = active & (number >= aim.even);
    centre = {gather<F>(aim.x, k, active), gather<F>(aim.y, k, active),
              gather<F>(aim.z, k, active)};
    radius = gather<F>(aim.radius, k, active);
  }
};

/// Aims paths from infinite lights by replacing their origins. (u, v) is the 2D sample for the
/// origin.
template <typename F>
[[gnu::noinline]] void aim_origins(const LightView& view, const F& number, const F& u, const F& v,
                                   KindEmission<F>& e, const Mask<F>& lanes) {
  const AimChoice<F> choice(*view.aim, number, lanes);
  const Vec2<F> at = square_to_disk(u, v);
  const Frame<F> frame = make_frame(e.d);
  const Vec3<F> middle{F(view.centre[0]), F(view.centre[1]), F(view.centre[2])};
  const F back = F(-view.reach) - dot(choice.centre - middle, e.d);
  const Vec3<F> across = fma(frame.s, F(at.x * choice.radius),
                             fma(frame.t, F(at.y * choice.radius), Vec3<F>(e.d * back)));
  e.p = select<F>(choice.aims, choice.centre + across, e.p);
  e.density = e.density * aim_density_infinite<F>(view, e.p, e.d);
}

/// Aims paths from finite lights by replacing their directions. (s, t) is the 2D sample for the
/// direction. `sides` is 1, or 2 if the light emits on both sides.
template <typename F>
[[gnu::noinline]] void aim_directions(const LightView& view, const F& number, const F& s,
                                      const F& t, float sides, KindEmission<F>& e,
                                      const Mask<F>& lanes) {
  const AimChoice<F> choice(*view.aim, number, lanes);
  const Vec3<F> to_centre = choice.centre - e.p;
  const F distance2 = length_squared(to_centre);
  const F one_minus_cos = sphere_one_minus_cos<F>(choice.radius, distance2);
  const Mask<F> away = distance2 > 0.f;
  const Vec3<F> axis = select<F>(away, to_centre * F(1.f / sqrt(select(away, distance2, F(1.f)))),
                                 Vec3<F>(F(0.f), F(0.f), F(1.f)));
  const Vec3<F> d = make_frame(axis).to_world(square_to_cone(s, t, one_minus_cos));
  e.d = select<F>(choice.aims, d, e.d);
  const F cosine = dot(e.n, e.d);
  if (sides == 2.f) e.n = select<F>(cosine < 0.f, -e.n, e.n);
  const Mask<F> point = length_squared(e.n) == 0.f;
  const F front_cosine = sides == 2.f ? F(abs(cosine)) : cosine;
  const F own = select(point, F(kInv4Pi), F(front_cosine * (kInvPi / sides)));
  e.density = select(own > 0.f, F(e.density * aim_density_finite<F>(view, e.p, e.d, own)), F(0.f));
}

}  // namespace wavecomb::detail
