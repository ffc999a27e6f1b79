// SPDX-License-Identifier: Apache-2.0
/// Definitions for nested_media.h, which includes this file. Each step advances a ray to the next
/// medium boundary or collision.
#pragma once

#include "wavecomb/medium/nested/nested_media.h"

namespace wavecomb {

template <typename F>
inline Mask<F> NestedMedia::is_visible(const Rays<F>& r, const UInt<F>& object,
                                       const Mask<F>& lanes) const {
  using U = UInt<F>;
  Mask<F> visible = lanes;
  if (scene_.visibility) [[unlikely]] {
    const U bits = gather<U>(scene_.visibility, object, Mask<U>(visible));
    visible = visible & Mask<F>((bits & r.kind) != U(0u));
  }
  const LinkView& links = scene_.lights.links;
  const Mask<F> linked = visible & Mask<F>(r.shadow_set != U(0u));
  if (!links.members || none(linked)) return visible;
  // Test whether the object casts a shadow, like casts_shadow() in accel/presence.h.
  const U set = select(Mask<U>(linked), r.shadow_set, U(1u)) - 1u;
  const U link = gather<U>(links.classes, object, Mask<U>(linked));
  const U word = gather<U>(links.members, (link - 1u) * links.words + (set >> 5), Mask<U>(linked));
  return visible & (not_(linked) | Mask<F>(((word >> (set & 31u)) & 1u) != U(0u)));
}

template <typename F>
inline detail::BoundaryHits<F> NestedMedia::intersect_boundary(Rays<F>& r, MediumStack<F>& stack,
                                                               const MediumBoundary<F>& current,
                                                               const Mask<F>& lanes) const {
  using U = UInt<F>;
  const Hit<F>& h = r.hit;
  BoundaryHits<F> boundary;
  boundary.surface = lanes & Mask<F>(h.inst != U(kNoHit)) & Mask<F>(h.inst != U(kLightShape));
  boundary.passes = boundary.bound = Mask<F>(false);
  if (none(boundary.surface)) return boundary;
  const HitObject<F> hit = hit_object<F>(scene_, h.inst, h.geom, h.prim, boundary.surface);
  boundary.object = hit.object;
  const U kind = gather_field<F>(scene_.nested_media.media, &MeshMedium<float>::kind, hit.material,
                                 boundary.surface);
  boundary.bound =
      boundary.surface & Mask<F>(kind != U(static_cast<uint32_t>(BoundaryKind::kNone)));
  if (scene_.has_curves)
    boundary.bound =
        boundary.bound & not_(detail::is_curved<F>(scene_, hit.mesh, boundary.surface));
  const Mask<F> invisible = boundary.surface & not_(is_visible<F>(r, hit.object, boundary.surface));
  const Mask<F> by = invisible & not_(boundary.bound);
  r.s.o = select<F>(by, fma(r.s.d, past_hit<F>(h.t), r.s.o), r.s.o);
  boundary.passes = by;
  if (none(boundary.bound)) return boundary;
  const Surface<F> at = setup_surface<F>(scene_, {h.inst, hit.mesh, h.prim, h.u, h.v, r.l.time},
                                         r.s.d, false, false, boundary.bound);
  const BoundaryHit<F> b =
      cross_boundary<F>(scene_.nested_media, stack, current, {hit.object, hit.material},
                        dot(r.s.d, at.ng) < 0.f, boundary.bound);
  const Mask<F> through = b.passes | (invisible & boundary.bound);
  boundary.passes = boundary.passes | through;
  boundary.outer = select(boundary.bound, b.outer, boundary.outer);
  stack.assign(b.after, through);
  r.s.o = select<F>(through, spawn_origin<F>(at, r.s.d), r.s.o);
  return boundary;
}

template <typename F>
inline void NestedMedia::sample_distance(Rays<F>& r, const MediumStack<F>& stack, const F& u,
                                         const Mask<F>& lanes) const {
  using U = UInt<F>;
  const MeshMedium<F> m = medium_of<F>(r, stack.top(scene_.nested_media, lanes), lanes);
  const F of_hero = select(r.s.hero == U(0u), m.scattering.x,
                           select(r.s.hero == U(1u), m.scattering.y, m.scattering.z));
  const Mask<F> some = lanes & (of_hero > 0.f);
  const F length = max(F(-log(F(1.f - u)) / select(some, of_hero, F(1.f))), F(1e-30f));
  const F no_distance = max(r.s.rest, F(kFar));
  F rest = select(some, min(length, F(kFar)), no_distance);
  if (equiangular_) rest = select(is_lit<F>(m), F(kFar * F(1.f + max(u, F(2.4e-7f)))), rest);
  r.s.rest = select(lanes, rest, r.s.rest);
}

template <typename F>
inline EquiangularDistribution<F> NestedMedia::sample_equiangular(Rays<F>& r,
                                                                  const MeshMedium<F>& medium,
                                                                  const F& far,
                                                                  const Mask<F>& lanes) const {
  using U = UInt<F>;
  const Color<F> e = medium.absorption + medium.scattering;
  const Sample4<F> n = walk_samples<F>(r.s.seed, U(r.s.number + 0x40000000u));
  const F angle = walk_samples<F>(r.s.seed, U(r.s.number + 0x50000000u)).x;
  const EquiangularDistribution<F> distribution = equiangular_distribution<F>(
      scene_.lights,
      {.o = r.s.o, .d = r.s.d, .begin = F(0.f), .end = far, .extinction = min(e.x, min(e.y, e.z))},
      n, lanes);
  const Color<F>& b = medium.scattering;
  const F own = select(r.s.hero == U(0u), b.x, select(r.s.hero == U(1u), b.y, b.z));
  const F u = min(F(F(r.s.rest * (1.f / kFar)) - 1.f), F(1.f));
  F at = -log(F(1.f - u)) / max(own, F(1e-30f));
  at =
      select(n.w < distribution.share, clamp(distribution.sample_distance(angle), F(0.f), far), at);
  r.s.rest = select(lanes, clamp(at, F(1e-30f), F(kFar)), r.s.rest);
  return distribution;
}

template <typename F>
inline Mask<F> NestedMedia::scatter_ray(const NestedRays& all, Rays<F>& r,
                                        const MeshMedium<F>& medium, const F& length,
                                        const Mask<F>& lanes) const {
  using U = UInt<F>;
  detail::NestedRayState<F>& s = r.s;
  detail::NestedRayMedia<F>& l = r.l;
  const Color<F> one(F(1.f));
  const Color<F> weight = flight_weight<F>(l.ratio, s.throughput) * l.absorbed;
  s.throughput = select<F>(lanes, s.throughput * weight, s.throughput);
  l.ratio = select<F>(lanes, one, l.ratio);
  l.absorbed = select<F>(lanes, one, l.absorbed);
  s.o = select<F>(lanes, fma(s.d, length, s.o), s.o);
  s.start = select(lanes, F(0.f), s.start);
  s.flags = select(Mask<U>(lanes), s.flags | U(kHasScattered), s.flags);

  const Sample4<F> n = walk_samples<F>(s.seed, U(s.number + 0x80000000u));
  const F sum = s.throughput.x + s.throughput.y + s.throughput.z;
  F q = select(sum < F(kFaintWalk) * s.first, F(sum / s.first), F(1.f));
  q = select(s.number >= kLongWalk, F(0.5f * q), q);
  const Mask<F> on = lanes & (n.z < q);
  s.throughput = select<F>(on, s.throughput * F(F(1.f) / select(on, q, F(1.f))), s.throughput);
  s.hero = select(Mask<U>(on), hero_of<F>(n.w, s.throughput), s.hero);

  const F g = select(abs(medium.anisotropy) < F(kMinMeanCosine), F(0.f), medium.anisotropy);
  const F c = sample_henyey_greenstein<F>(g, n.x);
  const F across = safe_sqrt(F(1.f - c * c));
  const SinCos<F> angle = sincos_2pi(n.y);
  const Vec3<F> local(F(across * angle.cos), F(across * angle.sin), c);
  s.d = select<F>(on, normalize(make_frame<F>(s.d).to_world(local)), s.d);
  const F* const from[6] = {&s.o.x, &s.o.y, &s.o.z, &s.d.x, &s.d.y, &s.d.z};
  for (size_t k = 0; k < 3; ++k) {
    scatter<F>(all.o[k], *from[k], r.ray_index, on);
    scatter<F>(all.d[k], *from[3 + k], r.ray_index, on);
  }
  return lanes & not_(on);
}

template <typename F>
inline size_t NestedMedia::advance(const NestedRays& all, const HitSpan& hits,
                                   const NestedEvents& events, Rays<F>& r, size_t left) const {
  using U = UInt<F>;
  detail::NestedRayState<F>& s = r.s;
  detail::NestedRayMedia<F>& l = r.l;
  MediumStack<F> stack(l);
  const MediumBoundary<F> current = stack.top(scene_.nested_media, r.active);
  const MeshMedium<F> medium = medium_of<F>(r, current, r.active);
  const Mask<F> open = Mask<F>(r.hit.inst == U(kNoHit));
  F far = select(open, F(kFar), min(r.hit.t, F(kFar)));
  Mask<F> by_lights(false);
  if (equiangular_) [[unlikely]]
    by_lights = r.active & is_lit<F>(medium) & (s.rest > kFar);
  EquiangularDistribution<F> distribution;
  if (any(by_lights)) distribution = sample_equiangular<F>(r, medium, far, by_lights);
  const Limit<F> limit = limit_of<F>(events, r);
  const Mask<F> stopped = r.active & (limit.length < far) & not_(s.rest < limit.length);
  far = select(stopped, limit.length, far);
  const Mask<F> collides = r.active & not_(stopped) & (s.rest < far);
  const F length = select(collides, s.rest, far);

  // Compute densities relative to the colour channel with the least scattering, to avoid overflow.
  const Color<F>&a = medium.absorption, &b = medium.scattering;
  const F least = min(b.x, min(b.y, b.z)), most = max(max_component(b), F(1e-30f));
  const auto density = [&](const F& scattering) {
    const F through = exp(F(F(least - scattering) * length));
    return select(collides, F(through * F(scattering / most)), through);
  };
  Color<F> ratio(density(b.x), density(b.y), density(b.z));
  if (any(by_lights)) [[unlikely]] {
    const auto equiangular_density = [&](const F& scattering) {
      return outcome_density<F>(distribution, scattering, length, length, collides);
    };
    const OutcomeDensity<F> x = equiangular_density(b.x), y = equiangular_density(b.y),
                            z = equiangular_density(b.z);
    const F greatest = max(max(x.sampled, max(y.sampled, z.sampled)), F(1e-30f));
    const auto share = [](const OutcomeDensity<F>& c) {
      return F(c.exact / select(c.sampled > 0.f, c.sampled, F(1.f)));
    };
    ratio = select<F>(by_lights, Color<F>(x.sampled, y.sampled, z.sampled) * F(F(1.f) / greatest),
                      ratio);
    const Color<F> weight(share(x), share(y), share(z));
    l.absorbed = select<F>(by_lights, l.absorbed * weight, l.absorbed);
  }
  l.ratio = l.ratio * ratio;
  l.absorbed =
      l.absorbed * Color<F>(exp(F(-a.x * length)), exp(F(-a.y * length)), exp(F(-a.z * length)));
  s.start = s.start + length;
  const Mask<F> is_clear = Mask<F>(medium.kind == U(static_cast<uint32_t>(BoundaryKind::kClear)));
  const Mask<F> event = collides & is_clear, walks = collides & not_(is_clear);
  Mask<F> terminated(false);
  if (any(walks)) terminated = scatter_ray<F>(all, r, medium, length, walks);
  const BoundaryHits<F> boundary =
      intersect_boundary<F>(r, stack, current, r.active & not_(collides) & not_(stopped));
  const Mask<F> continues = boundary.passes | (walks & not_(terminated));
  if (any(continues)) {
    s.number = select(Mask<U>(continues), s.number + 1u, s.number);
    const F first = F(s.rest * (1.f / kFar)) - 1.f, other = walk_samples<F>(s.seed, s.number).x;
    sample_distance<F>(r, stack, select(s.rest > kFar, first, other), continues);
  }
  stack.store_in(l);
  const Mask<F> done = r.active & not_(continues);
  if (any(done)) {
    MediumStackRow<F> row;
    stack.store_in(row);
    row.object = select(Mask<U>(event), current.object, boundary.object);
    row.crossed = U(0u);
    row.outer = boundary.outer;
    row.medium = current.material;
    // These rays have left the scene while inside a mesh, so the mesh is not closed.
    s.start = select(open & not_(collides) & not_(stopped), F(kInfinity), s.start);
    const U by_event = select(Mask<U>(event), U(scene_.nested_media.event_material),
                              U(uint32_t{Flights::kNoEvent}));
    const U material = select(Mask<U>(stopped), limit.material, by_event);
    finish<F>(all, hits, events, r, {.stack = row, .material = material, .terminated = terminated},
              done);
  }
  return store_active<F>(all, r, continues, left);
}

template <typename F>
inline void NestedMedia::finish(const NestedRays& all, const HitSpan& hits,
                                const NestedEvents& events, const Rays<F>& r,
                                const SegmentEnd<F>& end, const Mask<F>& done) const {
  using U = UInt<F>;
  const U slot = gather<U>(all.slot, r.ray_index, Mask<U>(done));
  store_row<MediumStackRow, F>(all.stacks, slot, end.stack, done);
  const Mask<F> has_scattered = done & Mask<F>((r.s.flags & U(kHasScattered)) != U(0u));
  if (any(has_scattered)) {
    const auto column = [&](const float* x) { return gather<F>(x, r.ray_index, has_scattered); };
    PathRow<F> path = load_row<PathRow, F>(all.paths, slot, has_scattered);
    path.o = {column(all.o[0]), column(all.o[1]), column(all.o[2])};
    path.d = r.s.d;
    path.throughput = select<F>(end.terminated, Color<F>(F(0.f)), r.s.throughput);
    path.pdf = F(0.f);
    path.receiver = U(0u);
    store_row<PathRow, F>(all.paths, slot, path, has_scattered);
  }
  const auto real = [&](float* to, const F& x) { scatter<F>(to, x, r.ray_index, done); };
  const auto number = [&](uint32_t* to, const U& x) {
    scatter<U>(to, x, r.ray_index, Mask<U>(done));
  };
  real(events.t, r.s.start);
  number(events.material, end.material);
  number(events.hero, select(Mask<U>(has_scattered), U(uint32_t{Flights::kNoHero}), r.s.hero));
  const Color<F>&ratio = r.l.ratio, &absorbed = r.l.absorbed;
  const F* const from[6] = {&ratio.x, &ratio.y, &ratio.z, &absorbed.x, &absorbed.y, &absorbed.z};
  for (size_t k = 0; k < 3; ++k) {
    real(events.ratio[k], *from[k]);
    real(events.absorbed[k], *from[3 + k]);
  }
  const Hit<F>& h = r.hit;
  real(hits.t, r.s.start);
  real(hits.u, h.u);
  real(hits.v, h.v);
  number(hits.prim, h.prim);
  number(hits.geom, h.geom);
  number(hits.inst, select(Mask<U>(end.terminated), U(kNoHit), h.inst));
}

template <typename F>
inline size_t NestedMedia::store_active(const NestedRays& all, const Rays<F>& r,
                                        const Mask<F>& continues, size_t left) const {
  using U = UInt<F>;
  if (none(continues)) return 0;
  store_row<detail::NestedRayState, F>(states(), r.ray_index, r.s, continues);
  store_row<detail::NestedRayMedia, F>(loads(all.size), r.ray_index, r.l, continues);
  const SoaBlock& c = b_.columns;
  const auto real = [&](size_t k, const F& x) {
    compress_store<F>(c.floats(k) + left, x, continues);
  };
  const F* const from[6] = {&r.s.o.x, &r.s.o.y, &r.s.o.z, &r.s.d.x, &r.s.d.y, &r.s.d.z};
  for (size_t k = 0; k < 6; ++k) real(kO + k, *from[k]);
  real(kTfar, r.s.rest);
  real(kTime, r.l.time);
  const Mask<U> on(continues);
  compress_store<U>(c.uints(kSlot) + left, gather<U>(all.slot, r.ray_index, on), on);
  return compress_store<U>(c.uints(kRayIndex) + left, r.ray_index, on);
}

template <typename F>
inline size_t NestedMedia::advance_shadow(const NestedRays& all, float* const (&product)[3],
                                          Rays<F>& r, size_t left) const {
  using U = UInt<F>;
  MediumStack<F> stack(r.l);
  const MediumBoundary<F> current = stack.top(scene_.nested_media, r.active);
  const MeshMedium<F> medium = medium_of<F>(r, current, r.active);
  const Mask<F> open = r.active & Mask<F>(r.hit.inst == U(kNoHit));
  const F length = select(open, r.s.rest, min(r.hit.t, r.s.rest));
  const Color<F> e = medium.absorption + medium.scattering;
  r.l.absorbed =
      r.l.absorbed * Color<F>(exp(F(-e.x * length)), exp(F(-e.y * length)), exp(F(-e.z * length)));
  const Vec3<F> o = r.s.o;
  const BoundaryHits<F> boundary = intersect_boundary<F>(r, stack, current, r.active & not_(open));
  // Hits that bound no medium do not block the shadow ray, because an earlier query found the ray
  // unoccluded.
  const Mask<F> by = r.active & not_(open) & not_(boundary.bound);
  const F past = past_hit<F>(r.hit.t);
  r.s.o = select<F>(by, fma(r.s.d, past, o), r.s.o);
  r.s.rest = r.s.rest - select(by, past, length);
  stack.store_in(r.l);
  const Mask<F> continues = (by | boundary.passes) & (r.s.rest > 0.f);
  const Mask<F> blocked = boundary.bound & not_(boundary.passes);
  const Mask<F> done = r.active & not_(continues);
  const F* const from[3] = {&r.l.absorbed.x, &r.l.absorbed.y, &r.l.absorbed.z};
  for (size_t k = 0; k < 3; ++k) {
    const F before = gather<F>(product[k], r.ray_index, done);
    scatter<F>(product[k], select(blocked, F(0.f), F(before * *from[k])), r.ray_index, done);
  }
  return store_active<F>(all, r, continues, left);
}

}  // namespace wavecomb
