// SPDX-License-Identifier: Apache-2.0
/// Steps of rays through media inside meshes, each to the next bound or collision. Included by
/// nested_media.h.
#pragma once

#include "wavecomb/medium/nested/nested_media.h"

namespace wavecomb {

template <typename F>
inline Mask<F> Interiors::sees(const Rays<F>& r, const UInt<F>& object,
                               const Mask<F>& lanes) const {
  using U = UInt<F>;
  Mask<F> seen = lanes;
  if (scene_.visibility) [[unlikely]] {
    const U bits = gather<U>(scene_.visibility, object, Mask<U>(seen));
    seen = seen & Mask<F>((bits & r.kind) != U(0u));
  }
  const LinkView& links = scene_.lights.links;
  const Mask<F> linked = seen & Mask<F>(r.shadow_set != U(0u));
  if (!links.members || none(linked)) return seen;
  // Same test as casts_shadow() (accel/presence.h).
  const U set = select(Mask<U>(linked), r.shadow_set, U(1u)) - 1u;
  const U link = gather<U>(links.classes, object, Mask<U>(linked));
  const U word = gather<U>(links.members, (link - 1u) * links.words + (set >> 5), Mask<U>(linked));
  return seen & (not_(linked) | Mask<F>(((word >> (set & 31u)) & 1u) != U(0u)));
}

template <typename F>
inline detail::InteriorMet<F> Interiors::meet(Rays<F>& r, Inside<F>& inside, const Bound<F>& now,
                                              const Mask<F>& lanes) const {
  using U = UInt<F>;
  const Hit<F>& h = r.hit;
  Met<F> met;
  met.surface = lanes & Mask<F>(h.inst != U(kNoHit)) & Mask<F>(h.inst != U(kLightShape));
  met.passes = met.bound = Mask<F>(false);
  if (none(met.surface)) return met;
  const HitPlace<F> place = hit_place<F>(scene_, h.inst, h.geom, h.prim, met.surface);
  met.object = place.object;
  const U kind = gather_field<F>(scene_.interiors.media, &InteriorMedium<float>::kind,
                                 place.material, met.surface);
  met.bound = met.surface & Mask<F>(kind != U(static_cast<uint32_t>(InteriorKind::kNone)));
  if (scene_.has_curves)
    met.bound = met.bound & not_(detail::is_curved<F>(scene_, place.mesh, met.surface));
  const Mask<F> unseen = met.surface & not_(sees<F>(r, place.object, met.surface));
  const Mask<F> by = unseen & not_(met.bound);
  r.s.o = select<F>(by, fma(r.s.d, past_hit<F>(h.t), r.s.o), r.s.o);
  met.passes = by;
  if (none(met.bound)) return met;
  const Surface<F> at = setup_surface<F>(scene_, {h.inst, place.mesh, h.prim, h.u, h.v, r.l.time},
                                         r.s.d, false, false, met.bound);
  const BoundMet<F> b = meet_bound<F>(scene_.interiors, inside, now, {place.object, place.material},
                                      dot(r.s.d, at.ng) < 0.f, met.bound);
  const Mask<F> through = b.passes | (unseen & met.bound);
  met.passes = met.passes | through;
  met.outer = select(met.bound, b.outer, met.outer);
  inside.take(b.after, through);
  r.s.o = select<F>(through, spawn_origin<F>(at, r.s.d), r.s.o);
  return met;
}

template <typename F>
inline void Interiors::draw(Rays<F>& r, const Inside<F>& inside, const F& u,
                            const Mask<F>& lanes) const {
  using U = UInt<F>;
  const InteriorMedium<F> m = medium_of<F>(r, inside.top(scene_.interiors, lanes), lanes);
  const F of_hero = select(r.s.hero == U(0u), m.scattering.x,
                           select(r.s.hero == U(1u), m.scattering.y, m.scattering.z));
  const Mask<F> some = lanes & (of_hero > 0.f);
  const F length = max(F(-log(F(1.f - u)) / select(some, of_hero, F(1.f))), F(1e-30f));
  const F none_drawn = max(r.s.rest, F(kFar));
  F rest = select(some, min(length, F(kFar)), none_drawn);
  if (by_lamps_) rest = select(is_lit<F>(m), F(kFar * F(1.f + max(u, F(2.4e-7f)))), rest);
  r.s.rest = select(lanes, rest, r.s.rest);
}

template <typename F>
inline LampWay<F> Interiors::draw_by_lamps(Rays<F>& r, const InteriorMedium<F>& medium,
                                           const F& far, const Mask<F>& lanes) const {
  using U = UInt<F>;
  const Color<F> e = medium.absorption + medium.scattering;
  const Sample4<F> n = walk_numbers<F>(r.s.seed, U(r.s.number + 0x40000000u));
  const F angle = walk_numbers<F>(r.s.seed, U(r.s.number + 0x50000000u)).x;
  const LampWay<F> lamp = lamp_way<F>(
      scene_.lights,
      {.o = r.s.o, .d = r.s.d, .begin = F(0.f), .end = far, .extinction = min(e.x, min(e.y, e.z))},
      n, lanes);
  const Color<F>& b = medium.scattering;
  const F own = select(r.s.hero == U(0u), b.x, select(r.s.hero == U(1u), b.y, b.z));
  const F u = min(F(F(r.s.rest * (1.f / kFar)) - 1.f), F(1.f));
  F at = -log(F(1.f - u)) / max(own, F(1e-30f));
  at = select(n.w < lamp.share, clamp(lamp.draw(angle), F(0.f), far), at);
  r.s.rest = select(lanes, clamp(at, F(1e-30f), F(kFar)), r.s.rest);
  return lamp;
}

template <typename F>
inline Mask<F> Interiors::turn(const InteriorRays& all, Rays<F>& r, const InteriorMedium<F>& medium,
                               const F& length, const Mask<F>& lanes) const {
  using U = UInt<F>;
  detail::InteriorState<F>& s = r.s;
  detail::InteriorLoad<F>& l = r.l;
  const Color<F> one(F(1.f));
  const Color<F> weight = flight_weight<F>(l.ratio, s.throughput) * l.absorbed;
  s.throughput = select<F>(lanes, s.throughput * weight, s.throughput);
  l.ratio = select<F>(lanes, one, l.ratio);
  l.absorbed = select<F>(lanes, one, l.absorbed);
  s.o = select<F>(lanes, fma(s.d, length, s.o), s.o);
  s.start = select(lanes, F(0.f), s.start);
  s.flags = select(Mask<U>(lanes), s.flags | U(kWalked), s.flags);

  const Sample4<F> n = walk_numbers<F>(s.seed, U(s.number + 0x80000000u));
  const F sum = s.throughput.x + s.throughput.y + s.throughput.z;
  F q = select(sum < F(kFaintWalk) * s.first, F(sum / s.first), F(1.f));
  q = select(s.number >= kLongWalk, F(0.5f * q), q);
  const Mask<F> on = lanes & (n.z < q);
  s.throughput = select<F>(on, s.throughput * F(F(1.f) / select(on, q, F(1.f))), s.throughput);
  s.hero = select(Mask<U>(on), hero_of<F>(n.w, s.throughput), s.hero);

  const F g = select(abs(medium.anisotropy) < F(kLeastMeanCosine), F(0.f), medium.anisotropy);
  const F c = sample_henyey_greenstein<F>(g, n.x);
  const F across = safe_sqrt(F(1.f - c * c));
  const SinCos<F> angle = sincos_2pi(n.y);
  const Vec3<F> local(F(across * angle.cos), F(across * angle.sin), c);
  s.d = select<F>(on, normalize(make_frame<F>(s.d).to_world(local)), s.d);
  const F* const from[6] = {&s.o.x, &s.o.y, &s.o.z, &s.d.x, &s.d.y, &s.d.z};
  for (size_t k = 0; k < 3; ++k) {
    scatter<F>(all.o[k], *from[k], r.who, on);
    scatter<F>(all.d[k], *from[3 + k], r.who, on);
  }
  return lanes & not_(on);
}

template <typename F>
inline size_t Interiors::advance(const InteriorRays& all, const HitSpan& hits,
                                 const InteriorEvents& events, Rays<F>& r, size_t left) const {
  using U = UInt<F>;
  detail::InteriorState<F>& s = r.s;
  detail::InteriorLoad<F>& l = r.l;
  Inside<F> inside(l);
  const Bound<F> now = inside.top(scene_.interiors, r.active);
  const InteriorMedium<F> medium = medium_of<F>(r, now, r.active);
  const Mask<F> open = Mask<F>(r.hit.inst == U(kNoHit));
  F far = select(open, F(kFar), min(r.hit.t, F(kFar)));
  LampWay<F> lamp;
  Mask<F> lit(false);
  if (by_lamps_) [[unlikely]] {
    lit = r.active & is_lit<F>(medium) & (s.rest > kFar);
    if (any(lit)) lamp = draw_by_lamps<F>(r, medium, far, lit);
  }
  const Limit<F> limit = limit_of<F>(events, r);
  const Mask<F> stopped = r.active & (limit.length < far) & not_(s.rest < limit.length);
  far = select(stopped, limit.length, far);
  const Mask<F> collides = r.active & not_(stopped) & (s.rest < far);
  const F length = select(collides, s.rest, far);

  // Ratios relative to the channel with the least scattering, so that none overflows.
  const Color<F>&a = medium.absorption, &b = medium.scattering;
  const F least = min(b.x, min(b.y, b.z)), most = max(max_component(b), F(1e-30f));
  const auto chance = [&](const F& scattering) {
    const F through = exp(F(F(least - scattering) * length));
    return select(collides, F(through * F(scattering / most)), through);
  };
  Color<F> ratio(chance(b.x), chance(b.y), chance(b.z));
  if (any(lit)) [[unlikely]] {
    const auto by_lamp = [&](const F& scattering) {
      return even_chance<F>(lamp, scattering, length, length, collides);
    };
    const EvenChance<F> x = by_lamp(b.x), y = by_lamp(b.y), z = by_lamp(b.z);
    const F greatest = max(max(x.drawn, max(y.drawn, z.drawn)), F(1e-30f));
    const auto share = [](const EvenChance<F>& c) {
      return F(c.truth / select(c.drawn > 0.f, c.drawn, F(1.f)));
    };
    ratio = select<F>(lit, Color<F>(x.drawn, y.drawn, z.drawn) * F(F(1.f) / greatest), ratio);
    const Color<F> weight(share(x), share(y), share(z));
    l.absorbed = select<F>(lit, l.absorbed * weight, l.absorbed);
  }
  l.ratio = l.ratio * ratio;
  l.absorbed =
      l.absorbed * Color<F>(exp(F(-a.x * length)), exp(F(-a.y * length)), exp(F(-a.z * length)));
  s.start = s.start + length;
  const Mask<F> is_clear = Mask<F>(medium.kind == U(static_cast<uint32_t>(InteriorKind::kClear)));
  const Mask<F> event = collides & is_clear, walks = collides & not_(is_clear);
  Mask<F> died(false);
  if (any(walks)) died = turn<F>(all, r, medium, length, walks);
  const Met<F> met = meet<F>(r, inside, now, r.active & not_(collides) & not_(stopped));
  const Mask<F> goes_on = met.passes | (walks & not_(died));
  if (any(goes_on)) {
    s.number = select(Mask<U>(goes_on), s.number + 1u, s.number);
    const F first = F(s.rest * (1.f / kFar)) - 1.f, other = walk_numbers<F>(s.seed, s.number).x;
    draw<F>(r, inside, select(s.rest > kFar, first, other), goes_on);
  }
  inside.store_in(l);
  const Mask<F> done = r.active & not_(goes_on);
  if (any(done)) {
    InsideRow<F> row;
    inside.store_in(row);
    row.place = select(Mask<U>(event), now.place, met.object);
    row.crossed = U(0u);
    row.outer = met.outer;
    row.medium = now.material;
    // Rays that leave the scene from an unclosed mesh.
    s.start = select(open & not_(collides) & not_(stopped), F(kInfinity), s.start);
    const U by_event =
        select(Mask<U>(event), U(scene_.interiors.event_material), U(uint32_t{Flights::kNoEvent}));
    const U material = select(Mask<U>(stopped), limit.material, by_event);
    finish<F>(all, hits, events, r, {.inside = row, .material = material, .terminated = died},
              done);
  }
  return put<F>(all, r, goes_on, left);
}

template <typename F>
inline void Interiors::finish(const InteriorRays& all, const HitSpan& hits,
                              const InteriorEvents& events, const Rays<F>& r,
                              const SegmentEnd<F>& end, const Mask<F>& done) const {
  using U = UInt<F>;
  const U slot = gather<U>(all.slot, r.who, Mask<U>(done));
  store_row<InsideRow, F>(all.inside, slot, end.inside, done);
  const Mask<F> walked = done & Mask<F>((r.s.flags & U(kWalked)) != U(0u));
  if (any(walked)) {
    const auto column = [&](const float* x) { return gather<F>(x, r.who, walked); };
    PathRow<F> path = load_row<PathRow, F>(all.paths, slot, walked);
    path.o = {column(all.o[0]), column(all.o[1]), column(all.o[2])};
    path.d = r.s.d;
    path.throughput = select<F>(end.terminated, Color<F>(F(0.f)), r.s.throughput);
    path.pdf = F(0.f);
    path.receiver = U(0u);
    store_row<PathRow, F>(all.paths, slot, path, walked);
  }
  const auto real = [&](float* to, const F& x) { scatter<F>(to, x, r.who, done); };
  const auto number = [&](uint32_t* to, const U& x) { scatter<U>(to, x, r.who, Mask<U>(done)); };
  real(events.t, r.s.start);
  number(events.material, end.material);
  number(events.hero, select(Mask<U>(walked), U(uint32_t{Flights::kNoHero}), r.s.hero));
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
inline size_t Interiors::put(const InteriorRays& all, const Rays<F>& r, const Mask<F>& goes_on,
                             size_t left) const {
  using U = UInt<F>;
  if (none(goes_on)) return 0;
  store_row<detail::InteriorState, F>(states(), r.who, r.s, goes_on);
  store_row<detail::InteriorLoad, F>(loads(all.size), r.who, r.l, goes_on);
  const SoaBlock& c = b_.columns;
  const auto real = [&](size_t k, const F& x) {
    compress_store<F>(c.floats(k) + left, x, goes_on);
  };
  const F* const from[6] = {&r.s.o.x, &r.s.o.y, &r.s.o.z, &r.s.d.x, &r.s.d.y, &r.s.d.z};
  for (size_t k = 0; k < 6; ++k) real(kO + k, *from[k]);
  real(kTfar, r.s.rest);
  real(kTime, r.l.time);
  const Mask<U> on(goes_on);
  compress_store<U>(c.uints(kSlot) + left, gather<U>(all.slot, r.who, on), on);
  return compress_store<U>(c.uints(kWho) + left, r.who, on);
}

template <typename F>
inline size_t Interiors::advance_shadow(const InteriorRays& all, float* const (&product)[3],
                                        Rays<F>& r, size_t left) const {
  using U = UInt<F>;
  Inside<F> inside(r.l);
  const Bound<F> now = inside.top(scene_.interiors, r.active);
  const InteriorMedium<F> medium = medium_of<F>(r, now, r.active);
  const Mask<F> open = r.active & Mask<F>(r.hit.inst == U(kNoHit));
  const F length = select(open, r.s.rest, min(r.hit.t, r.s.rest));
  const Color<F> e = medium.absorption + medium.scattering;
  r.l.absorbed =
      r.l.absorbed * Color<F>(exp(F(-e.x * length)), exp(F(-e.y * length)), exp(F(-e.z * length)));
  const Vec3<F> o = r.s.o;
  const Met<F> met = meet<F>(r, inside, now, r.active & not_(open));
  // A hit that bounds no medium does not block this ray, which was found to be unoccluded.
  const Mask<F> by = r.active & not_(open) & not_(met.bound);
  const F past = past_hit<F>(r.hit.t);
  r.s.o = select<F>(by, fma(r.s.d, past, o), r.s.o);
  r.s.rest = r.s.rest - select(by, past, length);
  inside.store_in(r.l);
  const Mask<F> goes_on = (by | met.passes) & (r.s.rest > 0.f);
  const Mask<F> blocked = met.bound & not_(met.passes);
  const Mask<F> done = r.active & not_(goes_on);
  const F* const from[3] = {&r.l.absorbed.x, &r.l.absorbed.y, &r.l.absorbed.z};
  for (size_t k = 0; k < 3; ++k) {
    const F before = gather<F>(product[k], r.who, done);
    scatter<F>(product[k], select(blocked, F(0.f), F(before * *from[k])), r.who, done);
  }
  return put<F>(all, r, goes_on, left);
}

}  // namespace wavecomb
