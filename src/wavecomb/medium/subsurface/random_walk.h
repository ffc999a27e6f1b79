// SPDX-License-Identifier: Apache-2.0
/// Subsurface random walks in homogeneous media, collision by collision.
///
/// A walk begins where a diffuse lobe enters a subsurface body (OpenPbrBsdf::enters). The walk ends
/// where it hits the surface of the same object from inside. At the exit point the path continues
/// as at a white diffuse surface that is seen from outside, with a light sample and a bounce. Light
/// is not refracted at the entry or exit point. Uniform incident light therefore leaves uniformly,
/// and a flat surface has the requested colour (medium/description/subsurface.h).
///
/// Techniques: each walk has a hero channel, which determines its distances (hero wavelengths,
/// Wilkie et al. 2014), and is either free or guided. A free walk follows the medium's phase
/// function. A guided walk prefers directions back to its entry point on the surface (Krivanek and
/// d'Eon, "A Zero-Variance-Based Sampling Scheme for Monte Carlo Subsurface Scattering", 2014):
/// with n the normal there, mu = d n, and nu the diffusion length in mean free paths, it samples
///
///   p(d) = 1 / (2 pi (nu - mu) ln((nu + 1) / (nu - 1))),
///   p(t) = s exp(-s t),   s = (1 - mu / nu) e
///
/// where e is the extinction. A random number that is stratified over the pixel's samples selects
/// the technique, and the weight includes all six techniques (balance heuristic over whole walks).
/// With q_k the probabilities of the techniques and p_k their densities,
///
///   T_c = T_c(0) A_c p_c / sum over k of q_k p_k
///
/// where A_c is the product of the albedos along the walk and p_c the density of a free walk of
/// channel c. Therefore no weight exceeds 1 / q, where q is the probability of selecting a free
/// walk.
#pragma once

#include <algorithm>

#include "wavecomb/core/frame.h"
#include "wavecomb/core/math.h"
#include "wavecomb/light/sampling/tree_choice.h"
#include "wavecomb/medium/description/subsurface.h"
#include "wavecomb/medium/volume/henyey_greenstein.h"

namespace wavecomb {

/// Number of collisions after which a walk survives each further collision only with probability
/// 1/2. This roulette guarantees that walks end, without changing the mean.
inline constexpr uint32_t kLongWalk = 512;
/// Fraction of the initial light below which a walk is subject to roulette.
inline constexpr float kFaintWalk = 0.25f;
/// Fraction of the walks that are guided. The value applies to a thick body with isotropic
/// scattering.
inline constexpr float kGuidedFraction = 0.75f;

/// State of a walk before its next collision.
template <typename F>
struct SubsurfaceWalk {
  Vec3<F> o, d;
  Color<F> throughput;
  F first;            ///< sum of the initial throughput over the channels
  F rest;             ///< distance to the next collision; set by begin_flight()
  UInt<F> seed;       ///< seed of the walk's random numbers
  UInt<F> number;     ///< number of collisions so far
  UInt<F> normal;     ///< pack_normal() of the outward surface normal at the entry point
  F choice, flight;   ///< random numbers for the technique and the first distance
  UInt<F> technique;  ///< hero channel, plus kGuided if the walk is guided
  /// q_k p_k of the free technique for each channel, divided by the sum over all techniques.
  Color<F> free;
  /// q_k p_k of the guided technique for each channel, divided by the sum over all techniques.
  Color<F> guided;

  static constexpr uint32_t kGuided = 4;

  UInt<F> channel() const { return technique & 3u; }
  Mask<F> is_guided() const { return Mask<F>(technique >= UInt<F>(kGuided)); }
};

/// Returns four random numbers for collision `number`.
template <typename F>
inline Sample4<F> walk_samples(const UInt<F>& seed, const UInt<F>& number) {
  using U = UInt<F>;
  const U a = hash_u32<U>(seed, number);
  return {unit_float<F>(hash_u32<U>(a ^ 0x68bc21ebu)), unit_float<F>(hash_u32<U>(a ^ 0x02e5be93u)),
          unit_float<F>(hash_u32<U>(a ^ 0x967a889bu)), unit_float<F>(hash_u32<U>(a ^ 0x368cc8b7u))};
}

namespace detail {

template <typename F>
inline Vec3<F> walk_normal(const SubsurfaceWalk<F>& w) {
  return normalize(unpack_normal<F>(w.normal));
}
template <typename F>
inline F component(const Color<F>& c, const UInt<F>& channel) {
  using U = UInt<F>;
  return select(channel == U(0u), c.x, select(channel == U(1u), c.y, c.z));
}
template <typename F>
inline F sum(const Color<F>& c) {
  return c.x + c.y + c.z;
}
/// Returns the colour with the components f(a.x, b.x), f(a.y, b.y) and f(a.z, b.z).
template <typename F, typename Function>
inline Color<F> each_channel(const Color<F>& a, const Color<F>& b, const Function& f) {
  return {f(a.x, b.x), f(a.y, b.y), f(a.z, b.z)};
}
/// Multiplies the density of each technique by the technique's density for one step of the walk,
/// `free` or `guided`, and updates the weight of the walk. `through` is the factor by which the
/// step attenuates the light.
template <typename F>
inline void weigh_step(const Color<F>& free, const Color<F>& guided, const Color<F>& through,
                       SubsurfaceWalk<F>& w) {
  w.free = w.free * free;
  w.guided = w.guided * guided;
  const F all = sum(w.free) + sum(w.guided);
  const F scale = select(all > 0.f, F(1.f / all), F(0.f));
  w.free = w.free * scale;
  w.guided = w.guided * scale;
  w.throughput = w.throughput * through * scale;
}
/// Returns s / e for each channel. The first flight of a walk has mu = 0, so s = e.
template <typename F>
inline Color<F> guided_density(const SubsurfaceMedium<F>& medium, const SubsurfaceWalk<F>& w) {
  const F mu = select(Mask<F>(w.number == UInt<F>(0u)), F(0.f), dot(w.d, walk_normal(w)));
  const auto density = [&](const F& nu) { return max(F(1.f - mu / nu), F(1e-3f)); };
  return {density(medium.diffusion.x), density(medium.diffusion.y), density(medium.diffusion.z)};
}

}  // namespace detail

/// Selects the technique of a walk that enters a body. `across` is the thickness of the object
/// along the ray. Channels are selected in proportion to the light that a thick body would reflect.
/// Few walks are guided if the body is thin or scattering is anisotropic.
template <typename F>
inline void choose_technique(const SubsurfaceMedium<F>& medium, const F& across,
                             SubsurfaceWalk<F>& w) {
  using U = UInt<F>;
  const Color<F> part = w.throughput * medium.color;
  const Color<F> share = part * F(1.f / max(detail::sum(part), F(1e-30f)));
  const F depth = across * abs(dot(w.d, detail::walk_normal(w)));
  const F isotropy = 1.f - abs(medium.anisotropy);
  const Color<F> guided_part = detail::each_channel<F>(
      medium.extinction, medium.diffusion, [&](const F& extinction, const F& nu) {
        return F(F(kGuidedFraction) * isotropy * isotropy * isotropy *
                 (1.f - exp(F(-(depth * extinction / nu)))));
      });
  w.guided = share * guided_part;
  w.free = share - w.guided;
  w.technique = U(SubsurfaceWalk<F>::kGuided + 2u);
  F after = detail::sum(w.free) + w.guided.x + w.guided.y;
  const auto before = [&](const F& size, uint32_t technique) {
    w.technique = select(Mask<U>(w.choice < after), U(technique), w.technique);
    after = after - size;
  };
  before(w.guided.y, SubsurfaceWalk<F>::kGuided + 1u);
  before(w.guided.x, SubsurfaceWalk<F>::kGuided);
  before(w.free.z, 2u);
  before(w.free.y, 1u);
  before(w.free.x, 0u);
}

/// Samples the distance of a walk to its next collision.
template <typename F>
inline void begin_flight(const SubsurfaceMedium<F>& medium, SubsurfaceWalk<F>& w) {
  using U = UInt<F>;
  const U channel = w.channel();
  const F extinction_factor = detail::component<F>(detail::guided_density(medium, w), channel);
  const F extinction = detail::component<F>(medium.extinction, channel) *
                       select(w.is_guided(), extinction_factor, F(1.f));
  const F number =
      select(Mask<F>(w.number == U(0u)), w.flight, walk_samples<F>(w.seed, w.number).x);
  w.rest = max(F(-log(F(1.f - number)) / extinction), F(1e-30f));
}

/// Advances a walk by the distance `t`. The walk then scatters in the lanes `collides`, and has
/// reached the surface in all other lanes. Returns the lanes that continue inside the body.
template <typename F>
inline Mask<F> end_flight(const SubsurfaceMedium<F>& medium, const F& t, const Mask<F>& collides,
                          SubsurfaceWalk<F>& w) {
  using U = UInt<F>;
  const auto density = [&](const F& extinction, const F& extinction_factor) {
    const F thick = extinction * extinction_factor;
    const F through = exp(F(-thick * t));
    return select(collides, F(through * thick), through);
  };
  const Color<F> free = detail::each_channel<F>(medium.extinction, Color<F>(F(1.f)), density);
  const Color<F> guided =
      detail::each_channel<F>(medium.extinction, detail::guided_density(medium, w), density);
  detail::weigh_step<F>(free, guided, select<F>(collides, free * medium.albedo, free), w);
  w.o = fma(w.d, t, w.o);

  // These random numbers are independent of the random numbers for the flight.
  const Sample4<F> r = walk_samples<F>(w.seed, U(w.number + 0x80000000u));
  const F left = detail::sum(w.throughput);
  F q = select(left < F(kFaintWalk) * w.first, F(left / w.first), F(1.f));
  q = select(w.number >= kLongWalk, F(0.5f * q), q);
  const Mask<F> on = collides & (r.z < q);
  if (none(on)) return on;
  const Vec3<F> d = w.d;
  const Color<F> throughput = w.throughput;
  w.throughput = w.throughput * F(F(1.f) / select(on, q, F(1.f)));

  const U channel = w.channel();
  const Mask<F> is_guided = w.is_guided();
  const F g = select(abs(medium.anisotropy) < F(kMinMeanCosine), F(0.f), medium.anisotropy);
  const F nu = detail::component<F>(medium.diffusion, channel);
  const F log_nu = detail::component<F>(medium.log_diffusion, channel);
  const F c =
      select(is_guided, clamp(F(nu - (nu + 1.f) * exp(F(-(r.x * log_nu)))), F(-1.f), F(1.f)),
             sample_henyey_greenstein<F>(g, r.x));
  const F s = safe_sqrt(F(1.f - c * c));
  const SinCos<F> turn = sincos_2pi(r.y);
  const Vec3<F> n = detail::walk_normal(w);
  const Vec3<F> next = normalize(make_frame<F>(select<F>(is_guided, n, w.d))
                                     .to_world(Vec3<F>(F(s * turn.cos), F(s * turn.sin), c)));
  const F phase = henyey_greenstein<F>(g, dot(w.d, next));
  const F mu = dot(next, n);
  const Color<F> guided_ratio = detail::each_channel<F>(
      medium.diffusion, medium.log_diffusion, [&](const F& wide, const F& log_wide) {
        return F(kInv2Pi / (max(F(wide - mu), F(1e-3f)) * log_wide * phase));
      });
  w.d = next;
  detail::weigh_step<F>(Color<F>(F(1.f)), guided_ratio, Color<F>(F(1.f)), w);
  w.number = w.number + 1u;
  w.d = select<F>(on, w.d, d);
  w.throughput = select<F>(on, w.throughput, throughput);
  return on;
}

/// Returns the subsurface medium of a material.
template <typename F>
inline SubsurfaceMedium<F> subsurface_medium(const SubsurfaceView& view, const UInt<F>& material,
                                             const Mask<F>& active) {
  return load_row<SubsurfaceMedium, F>(reinterpret_cast<const float*>(view.media), material,
                                       active);
}

}  // namespace wavecomb
