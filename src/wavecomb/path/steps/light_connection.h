// SPDX-License-Identifier: Apache-2.0
/// Connection of a vertex to a light: the light sample, and the origin of its shadow ray.
///
/// A ray that leaves the surface at p starts at one of two origins, depending on its side:
///   o+ = p + terminator + offset n  outside,   o- = p - offset n  inside (geometry/hit/surface.h).
/// Bounces therefore estimate two integrals over solid angle, one about each origin,
///   sum over s of  int_{s} f(wo, wi) |cos theta_i| L(o_s, wi) dwi.
/// Emission that a bounce hits is weighted with the density of a light sample as seen from o_s
/// (PathState::o). Light sampling estimates the same two integrals: a light sample belongs to side
/// s if it lies on this side as seen from o_s. Its direction, distance, density and shadow ray
/// start at o_s, so that the densities of both techniques have the same measure and their weights
/// add up to 1.
///
/// If p has no terminator offset, the two origins differ only by rounding. A single light sample,
/// taken from the viewer's side, is then used for both sides, and only the origin and the length of
/// its shadow ray depend on the side. If p has a terminator offset, a light is sampled from both
/// origins with the same random numbers. If both samples lie on the sides of their origins, one of
/// them is chosen with probability 1/2 and its contribution is doubled.
#pragma once

#include "wavecomb/core/sampler.h"
#include "wavecomb/light/sampling/light_sample.h"
#include "wavecomb/path/path_state.h"

namespace wavecomb {

/// Light sample and the origin of its shadow ray. Direction, distance and density of the sample are
/// relative to this origin.
template <typename F>
struct LightConnection {
  LightSample<F> light;
  Vec3<F> origin;
};

/// Returns a random number of a vertex that is independent of the sampler.
template <typename F>
inline F candidate_number(const SampleKey<F>& key, uint32_t depth) {
  using U = UInt<F>;
  return unit_float<F>(hash_u32<U>(key.pixel_hash, U(key.sample + 0x7f4a7c15u * (depth + 1))));
}

namespace detail {

template <typename F>
inline LightSample<F> select_light(const Mask<F>& m, const LightSample<F>& a,
                                   const LightSample<F>& b) {
  const auto masks = [&](const Mask<F>& x, const Mask<F>& y) {
    return Mask<F>((m & x) | (not_(m) & y));
  };
  return {select<F>(m, a.wi, b.wi),
          select(m, a.distance, b.distance),
          select<F>(m, a.weight, b.weight),
          select(m, a.pdf, b.pdf),
          masks(a.is_delta, b.is_delta),
          masks(a.valid, b.valid),
          select(Mask<UInt<F>>(m), a.light, b.light)};
}

}  // namespace detail

/// Samples a light and a point on it with the sample values `r`. `receiver.p` is the ray origin on
/// the viewer's side.
template <typename Bsdf, typename F, uint32_t kFeatures, typename Interaction>
WAVECOMB_INLINE LightConnection<F> connect_to_light(const Vertex<F, kFeatures>& v,
                                                    const Interaction& at,
                                                    const LightReceiver<F>& receiver,
                                                    const Sample4<F>& r,
                                                    const Mask<F>& active_lights) {
  const LightView& lights = v.scene.lights;
  LightConnection<F> c{sample_light<F>(lights, receiver, r.x, r.y, r.z, active_lights), receiver.p};
  if constexpr (Bsdf::kOnSurface && Bsdf::kTransmits) {
    const Vec3<F>& through = v.path.dir;
    const auto outside = [&](const Vec3<F>& d) { return Mask<F>(dot(d, at.s.ng) > 0.f); };
    const Mask<F> viewed_inside = outside(through);
    const auto crosses = [&](const Vec3<F>& d) {
      const Mask<F> out = outside(d);
      return Mask<F>((out & viewed_inside) | not_(Mask<F>(out | viewed_inside)));
    };
    const Vec3<F> far = at.origin(through);
    LightSample<F>& near = c.light;
    const Mask<F> crossing = crosses(near.wi);
    const F closer = dot(Vec3<F>(far - receiver.p), near.wi);
    c.origin = select<F>(crossing, far, receiver.p);
    const F distance = near.distance;
    near.distance = select(crossing, max(F(distance - closer), F(0.f)), distance);
    if constexpr (Bsdf::kHasTerminator) {
      const Mask<F> has_terminator =
          active_lights & Mask<F>(at.bsdf.passes_light()) & (length_squared(at.s.terminator) > 0.f);
      if (any(has_terminator)) {
        LightReceiver<F> beyond = receiver;
        beyond.p = far;
        LightSample<F> other = sample_light<F>(lights, beyond, r.x, r.y, r.z, has_terminator);
        near.distance = select(has_terminator, distance, near.distance);
        near.valid = near.valid & not_(Mask<F>(has_terminator & crossing));
        other.valid = other.valid & has_terminator & crosses(other.wi);
        const Mask<F> both = near.valid & other.valid;
        const Mask<F> uses_other =
            other.valid & (not_(near.valid) | (candidate_number<F>(v.key, v.depth) < 0.5f));
        near = detail::select_light<F>(uses_other, other, near);
        near.weight = near.weight * select(both, F(2.f), F(1.f));
        c.origin = select<F>(has_terminator, select<F>(uses_other, far, receiver.p), c.origin);
      }
    }
  }
  return c;
}

}  // namespace wavecomb
