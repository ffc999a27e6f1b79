// SPDX-License-Identifier: Apache-2.0
/// Rays through what fills meshes, bound by bound.
///
/// On a way through media k with absorption a_k and scattering s_k, over lengths t_k,
///   throughput *= exp(-sum a_k t_k)
/// and a collision comes after an optical depth of scattering that is exponential, by a hero
/// channel (medium/tracking.h). Each medium is even, so that the length is drawn anew where one
/// begins.
///
/// What collides behind a bound that refracts walks on: no light sample could reach it. Where it
/// meets a surface it is a path again, whose bounce no light sample has competed with. What
/// collides in a clear bound is an event, with a light sample, a bounce and MIS as in volumes.
#pragma once

#include <algorithm>

#include "wavecomb/accel/embree_accelerator.h"
#include "wavecomb/integrate/interior_buffers.h"
#include "wavecomb/integrate/path_pool.h"
#include "wavecomb/integrate/statistics.h"
#include "wavecomb/medium/inside.h"
#include "wavecomb/medium/walk.h"
#include "wavecomb/surface/hit.h"
#include "wavecomb/surface/surface.h"

namespace wavecomb {

/// Rays side by side, and the paths that they are of.
struct InteriorRays {
  float *o[3], *d[3];    ///< anew where a path has walked
  const uint32_t* slot;  ///< of rows
  size_t size;
  const float* times;  ///< null where nothing moves
  float* paths;        ///< PathRow
  float* inside;       ///< InsideRow
};

/// What becomes of them: as medium/tracking.h has it of flights, and what absorption leaves.
/// Before, where something else may stop them (`limited`): where that is, and what. A ray that has
/// walked meets none of it any more, and its hero is kNoHero.
struct InteriorEvents {
  bool limited;
  float* t;
  uint32_t* material;
  float *ratio[3], *absorbed[3];
  uint32_t* hero;
};

/// Where a ray through media begins: number of the first length, and what all others are hashes of.
template <typename F>
struct InteriorStart {
  UInt<F> hero, seed;
  F first;
};

/// Mesh and material of a hit, and the object as placed_geometry counts them.
template <typename F>
struct HitPlace {
  UInt<F> mesh, material, object;
};
template <typename F>
inline HitPlace<F> hit_place(const SceneView& scene, const UInt<F>& inst, const UInt<F>& geom,
                             const UInt<F>& prim, const Mask<F>& active) {
  using U = UInt<F>;
  const auto of_instance = [&](auto member) {
    return gather_member<F>(scene.instances, member, inst, active);
  };
  const U mesh = gather<U>(scene.geometry_mesh, of_instance(&InstanceRecord::geometry) + geom,
                           Mask<U>(active));
  return {mesh, hit_material<F>(scene, of_instance(&InstanceRecord::material), mesh, prim, active),
          of_instance(&InstanceRecord::emissive) + geom};
}

namespace detail {

/// A ray on its way.
template <typename F>
struct InteriorState {
  Vec3<F> o, d;
  Color<F> throughput;
  F start;  ///< length behind it, since the last collision
  F first;  ///< Walk::first
  F rest;   ///< to the next collision, or kFar; of a shadow ray, to its end
  UInt<F> seed, number, hero, flags;
  WAVECOMB_FIELDS(o, d, throughput, start, first, rest, seed, number, hero, flags)
};
/// What it is inside of, and what has become of its light since the last collision.
template <typename F>
struct InteriorLoad {
  UInt<F> place_0, place_1, place_2, place_3, material_0, material_1, material_2, material_3;
  Color<F> absorbed, ratio;
  F time;
  WAVECOMB_FIELDS(place_0, place_1, place_2, place_3, material_0, material_1, material_2, material_3,
                  absorbed, ratio, time)
};
static_assert(kRowWords<InteriorState> + kRowWords<InteriorLoad> == InteriorBuffers::kWords);
template <typename F>
struct InteriorHit {
  F t, u, v;
  UInt<F> prim, geom, inst;
};
/// A packet of rays.
template <typename F>
struct InteriorPacket {
  UInt<F> who;  ///< among all
  Mask<F> active;
  InteriorState<F> s;
  InteriorLoad<F> l;
  InteriorHit<F> hit;
};
/// A bound that rays of a packet have met.
template <typename F>
struct InteriorMet {
  Mask<F> surface, passes, bound;
  F outer{1.f};
  UInt<F> object{0u};
};

}  // namespace detail

/// Contract: a ray draws its own random numbers and no other's, so that neither order nor number of
/// lanes shows.
class Interiors {
 public:
  /// `counts` gets the rays that are traced here, as those of walks.
  Interiors(const SceneView& scene, const EmbreeAccelerator& accel, uint32_t width,
            const InteriorBuffers& buffers, Counts& counts)
      : scene_(scene), accel_(accel), width_(width), b_(buffers), counts_(counts) {}

  /// What is around a point. `keys`: of any path.
  Inside<float> surround(Vec3<float> p, float time, const PresenceKeys& keys) const;

  /// Takes all rays to what stops them. `hits`: theirs, afterwards those of what is seen. Where a
  /// path begins it is in `around`; null: it goes on. start(i, path) gives the InteriorStart of the
  /// rays from i on.
  template <typename F, typename Start>
  void fly(const InteriorRays& rays, const HitSpan& hits, const InteriorEvents& events,
           const Inside<float>* around, PresenceKeys keys, const Start& start) const;
  /// Multiplies by what shadow rays pass, whose lengths are `most`; 0: nobody asks.
  template <typename F>
  void pass(const InteriorRays& rays, const float* most, float* const (&product)[3],
            PresenceKeys keys) const;

 private:
  enum Column : size_t { kO, kD = kO + 3, kTfar = kD + 3, kSlot, kTime, kHit, kWho = kHit + 6 };
  static_assert(kWho < InteriorBuffers::kColumns);
  static constexpr float kFar = 1e30f;
  static constexpr uint32_t kWalked = 1;

  template <typename F>
  using Rays = detail::InteriorPacket<F>;
  template <typename F>
  using Met = detail::InteriorMet<F>;
  template <typename F>
  using Hit = detail::InteriorHit<F>;

  float* states() const { return b_.rows.floats(0); }
  float* loads(size_t capacity) const {
    return states() + capacity * kRowWords<detail::InteriorState>;
  }

  template <typename F>
  static Hit<F> hit_at(const HitSpan& h, size_t i) {
    return {load<F>(h.t + i),          load<F>(h.u + i),          load<F>(h.v + i),
            load<UInt<F>>(h.prim + i), load<UInt<F>>(h.geom + i), load<UInt<F>>(h.inst + i)};
  }
  HitSpan traced() const {
    const SoaBlock& c = b_.columns;
    return {c.floats(kHit),    c.floats(kHit + 1), c.floats(kHit + 2),
            c.uints(kHit + 3), c.uints(kHit + 4),  c.uints(kHit + 5)};
  }
  void trace(size_t n, const PresenceKeys& keys) const {
    const SoaBlock& c = b_.columns;
    accel_.intersect({c.floats(kO), c.floats(kO + 1), c.floats(kO + 2), c.floats(kD),
                      c.floats(kD + 1), c.floats(kD + 2), c.floats(kTfar), c.uints(kSlot), n,
                      scene_.has_motion ? c.floats(kTime) : nullptr},
                     traced(), width_, false, keys);
    counts_.walk_steps += n;
  }

  template <typename F>
  InteriorMedium<F> medium_of(const UInt<F>& material, const Mask<F>& active) const {
    const Mask<F> there = active & Mask<F>(material != UInt<F>(kNothing));
    return load_row<InteriorMedium, F>(reinterpret_cast<const float*>(scene_.interiors.media),
                                       material, there);
  }
  /// What else stops a ray, and how far ahead.
  template <typename F>
  struct Limit {
    F length;
    UInt<F> material;
  };
  template <typename F>
  Limit<F> limit_of(const InteriorEvents& events, const Rays<F>& r) const {
    using U = UInt<F>;
    if (!events.limited) return {F(kInfinity), U(uint32_t{Flights::kNoEvent})};
    const Mask<F> may = r.active & Mask<F>((r.s.flags & U(kWalked)) == U(0u));
    const F at = gather<F>(events.t, r.who, may);
    return {select(may, max(F(at - r.s.start), F(0.f)), F(kInfinity)),
            gather<U>(events.material, r.who, Mask<U>(may))};
  }
  /// What a ray of the packet has met, and where it goes on that passes: `s` and `inside` are then
  /// on the other side.
  template <typename F>
  Met<F> meet(Rays<F>& r, Inside<F>& inside, const Bound<F>& now, const Mask<F>& lanes) const;
  /// Draws how far it is to the next collision, with number `u`.
  template <typename F>
  void draw(Rays<F>& r, const Inside<F>& inside, const F& u, const Mask<F>& lanes) const;
  /// Walks on from a collision; gives the lanes that do not.
  template <typename F>
  Mask<F> turn(const InteriorRays& all, Rays<F>& r, const InteriorMedium<F>& medium,
               const F& length, const Mask<F>& lanes) const;
  /// Takes rays to their next bound or collision; notes those that end, and lists the others from
  /// `left` on. Gives how many.
  template <typename F>
  size_t advance(const InteriorRays& all, const HitSpan& hits, const InteriorEvents& events,
                 Rays<F>& r, size_t left) const;
  template <typename F>
  void finish(const InteriorRays& all, const HitSpan& hits, const InteriorEvents& events,
              const Rays<F>& r, const InsideRow<F>& inside, const UInt<F>& material,
              const Mask<F>& died, const Mask<F>& done) const;
  /// Of shadow rays.
  template <typename F>
  size_t advance_shadow(const InteriorRays& all, float* const (&product)[3], Rays<F>& r,
                        size_t left) const;
  template <typename F>
  size_t put(const InteriorRays& all, const Rays<F>& r, const Mask<F>& goes_on, size_t left) const;
  /// Advances the rays that are listed until none is left.
  template <typename F, typename Advance>
  void run(const InteriorRays& all, size_t left, PresenceKeys keys, const Advance& advance) const;

  const SceneView& scene_;
  const EmbreeAccelerator& accel_;
  uint32_t width_;
  const InteriorBuffers& b_;
  Counts& counts_;
};

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
  if (none(met.bound)) return met;
  const Surface<F> at = setup_surface<F>(scene_, {h.inst, place.mesh, h.prim, h.u, h.v, r.l.time},
                                         r.s.d, false, false, met.bound);
  const BoundMet<F> b = meet_bound<F>(scene_.interiors, inside, now, {place.object, place.material},
                                      dot(r.s.d, at.ng) < 0.f, met.bound);
  met.passes = b.passes;
  met.outer = select(met.bound, b.outer, met.outer);
  inside.take(b.after, met.passes);
  r.s.o = select<F>(met.passes, spawn_origin<F>(at, r.s.d), r.s.o);
  return met;
}

template <typename F>
inline void Interiors::draw(Rays<F>& r, const Inside<F>& inside, const F& u,
                            const Mask<F>& lanes) const {
  using U = UInt<F>;
  const InteriorMedium<F> m = medium_of<F>(inside.top(scene_.interiors, lanes).material, lanes);
  const F of_hero = select(r.s.hero == U(0u), m.scattering.x,
                           select(r.s.hero == U(1u), m.scattering.y, m.scattering.z));
  const Mask<F> some = lanes & (of_hero > 0.f);
  const F length = max(F(-log(F(1.f - u)) / select(some, of_hero, F(1.f))), F(1e-30f));
  r.s.rest = select(lanes, select(some, min(length, F(kFar)), F(kFar)), r.s.rest);
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
  const InteriorMedium<F> medium = medium_of<F>(now.material, r.active);
  const Mask<F> open = Mask<F>(r.hit.inst == U(kNoHit));
  F far = select(open, F(kFar), min(r.hit.t, F(kFar)));
  const Limit<F> limit = limit_of<F>(events, r);
  const Mask<F> stopped = r.active & (limit.length < far) & not_(s.rest < limit.length);
  far = select(stopped, limit.length, far);
  const Mask<F> collides = r.active & not_(stopped) & (s.rest < far);
  const F length = select(collides, s.rest, far);

  // Ratios of probabilities, all over that of the least scattering: none of them overflows.
  const Color<F>&a = medium.absorption, &b = medium.scattering;
  const F least = min(b.x, min(b.y, b.z)), most = max(max_component(b), F(1e-30f));
  const auto chance = [&](const F& scattering) {
    const F through = exp(F(F(least - scattering) * length));
    return select(collides, F(through * F(scattering / most)), through);
  };
  l.ratio = l.ratio * Color<F>(chance(b.x), chance(b.y), chance(b.z));
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
    draw<F>(r, inside, walk_numbers<F>(s.seed, s.number).x, goes_on);
  }
  inside.store_in(l);
  const Mask<F> done = r.active & not_(goes_on);
  if (any(done)) {
    InsideRow<F> row;
    inside.store_in(row);
    row.place = met.object;
    row.crossed = U(0u);
    row.outer = met.outer;
    row.medium = now.material;
    // What is not closed, and looked through to where the scene ends.
    s.start = select(open & not_(collides) & not_(stopped), F(kInfinity), s.start);
    const U by_event =
        select(Mask<U>(event), U(scene_.interiors.event_material), U(uint32_t{Flights::kNoEvent}));
    const U material = select(Mask<U>(stopped), limit.material, by_event);
    finish<F>(all, hits, events, r, row, material, died, done);
  }
  return put<F>(all, r, goes_on, left);
}

template <typename F>
inline void Interiors::finish(const InteriorRays& all, const HitSpan& hits,
                              const InteriorEvents& events, const Rays<F>& r,
                              const InsideRow<F>& inside, const UInt<F>& material,
                              const Mask<F>& died, const Mask<F>& done) const {
  using U = UInt<F>;
  const U slot = gather<U>(all.slot, r.who, Mask<U>(done));
  store_row<InsideRow, F>(all.inside, slot, inside, done);
  const Mask<F> walked = done & Mask<F>((r.s.flags & U(kWalked)) != U(0u));
  if (any(walked)) {
    const auto column = [&](const float* x) { return gather<F>(x, r.who, walked); };
    PathRow<F> path = load_row<PathRow, F>(all.paths, slot, walked);
    path.o = {column(all.o[0]), column(all.o[1]), column(all.o[2])};
    path.d = r.s.d;
    path.throughput = select<F>(died, Color<F>(F(0.f)), r.s.throughput);
    path.pdf = F(0.f);
    path.receiver = U(0u);
    store_row<PathRow, F>(all.paths, slot, path, walked);
  }
  const auto real = [&](float* to, const F& x) { scatter<F>(to, x, r.who, done); };
  const auto number = [&](uint32_t* to, const U& x) { scatter<U>(to, x, r.who, Mask<U>(done)); };
  real(events.t, r.s.start);
  number(events.material, material);
  const bool marks = events.limited && any(walked);
  number(events.hero,
         marks ? select(Mask<U>(walked), U(uint32_t{Flights::kNoHero}), r.s.hero) : r.s.hero);
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
  number(hits.inst, select(Mask<U>(died), U(kNoHit), h.inst));
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

template <typename F, typename Advance>
inline void Interiors::run(const InteriorRays& all, size_t left, PresenceKeys keys,
                           const Advance& advance) const {
  using U = UInt<F>;
  const uint32_t salt = keys.salt;
  for (uint32_t step = 1; left > 0; ++step) {
    keys.salt = salt + 0x10000u * step;
    trace(left, keys);
    const size_t n = left;
    left = 0;
    for (size_t j = 0; j < n; j += kWidth<F>) {
      counts_.walk_lanes += kWidth<F>;
      const Mask<F> active = first_lanes<F>(n - j);
      const U who = load<U>(b_.columns.uints(kWho) + j);
      Rays<F> r{who, active, load_row<detail::InteriorState, F>(states(), who, active),
                load_row<detail::InteriorLoad, F>(loads(all.size), who, active),
                hit_at<F>(traced(), j)};
      left += advance(r, left);
    }
  }
}

template <typename F, typename Start>
inline void Interiors::fly(const InteriorRays& rays, const HitSpan& hits,
                           const InteriorEvents& events, const Inside<float>* around,
                           PresenceKeys keys, const Start& start) const {
  using U = UInt<F>;
  size_t left = 0;
  for (size_t i = 0; i < rays.size; i += kWidth<F>) {
    const Mask<F> active = first_lanes<F>(rays.size - i);
    const U slot = load<U>(rays.slot + i);
    const PathRow<F> path = load_row<PathRow, F>(rays.paths, slot, active);
    const InsideRow<F> row = load_row<InsideRow, F>(rays.inside, slot, active);
    Inside<F> inside = around ? around->template everywhere<F>() : Inside<F>(row);
    if (!around)
      inside.cross(scene_.interiors, row.place, row.crossed, kBounceCrosses, active);
    const InteriorStart<F> begins = start(i, path);
    const auto three = [&](float* const(&k)[3]) {
      return Vec3<F>(load<F>(k[0] + i), load<F>(k[1] + i), load<F>(k[2] + i));
    };
    const Color<F>& sum = path.throughput;
    Rays<F> r;
    r.who = lane_index<F>() + static_cast<uint32_t>(i);
    r.active = active;
    r.s = {three(rays.o), three(rays.d), path.throughput, F(0.f),      F(sum.x + sum.y + sum.z),
           F(kFar),       begins.seed,   U(0u),           begins.hero, U(0u)};
    inside.store_in(r.l);
    r.l.absorbed = r.l.ratio = Color<F>(F(1.f));
    r.l.time = rays.times ? load<F>(rays.times + i) : F(0.f);
    r.hit = hit_at<F>(hits, i);
    draw<F>(r, inside, begins.first, active);
    left += advance<F>(rays, hits, events, r, left);
  }
  run<F>(rays, left, keys,
         [&](Rays<F>& r, size_t at) { return advance<F>(rays, hits, events, r, at); });
}

template <typename F>
inline size_t Interiors::advance_shadow(const InteriorRays& all, float* const (&product)[3],
                                        Rays<F>& r, size_t left) const {
  using U = UInt<F>;
  Inside<F> inside(r.l);
  const Bound<F> now = inside.top(scene_.interiors, r.active);
  const InteriorMedium<F> medium = medium_of<F>(now.material, r.active);
  const Mask<F> open = r.active & Mask<F>(r.hit.inst == U(kNoHit));
  const F length = select(open, r.s.rest, min(r.hit.t, r.s.rest));
  const Color<F> e = medium.absorption + medium.scattering;
  r.l.absorbed =
      r.l.absorbed * Color<F>(exp(F(-e.x * length)), exp(F(-e.y * length)), exp(F(-e.z * length)));
  const Vec3<F> o = r.s.o;
  const Met<F> met = meet<F>(r, inside, now, r.active & not_(open));
  // What else there is lets this ray through: it was asked.
  const Mask<F> by = r.active & not_(open) & not_(met.bound);
  const F past = r.hit.t * 1.0001f + scene_.scale * 1e-6f;
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

template <typename F>
inline void Interiors::pass(const InteriorRays& rays, const float* most, float* const (&product)[3],
                            PresenceKeys keys) const {
  using U = UInt<F>;
  keys.ray_kind = kSeenByBounces;
  keys.shadow_set = nullptr;
  size_t left = 0;
  for (size_t i = 0; i < rays.size; i += kWidth<F>) {
    const F length = load<F>(most + i);
    const Mask<F> active = first_lanes<F>(rays.size - i) & (length > 0.f);
    const U slot = load<U>(rays.slot + i);
    const InsideRow<F> row = load_row<InsideRow, F>(rays.inside, slot, active);
    Inside<F> inside(row);
    inside.cross(scene_.interiors, row.place, row.crossed, kShadowCrosses, active);
    const auto three = [&](float* const(&k)[3]) {
      return Vec3<F>(load<F>(k[0] + i), load<F>(k[1] + i), load<F>(k[2] + i));
    };
    Rays<F> r;
    r.who = lane_index<F>() + static_cast<uint32_t>(i);
    r.active = active;
    r.s = {three(rays.o), three(rays.d), Color<F>(F(0.f)), F(0.f), F(0.f), length, U(0u), U(0u),
           U(0u),         U(0u)};
    inside.store_in(r.l);
    r.l.absorbed = r.l.ratio = Color<F>(F(1.f));
    r.l.time = rays.times ? load<F>(rays.times + i) : F(0.f);
    left += put<F>(rays, r, active, left);
  }
  run<F>(rays, left, keys,
         [&](Rays<F>& r, size_t at) { return advance_shadow<F>(rays, product, r, at); });
}

/// A ray that goes any way leaves what it has not entered. What it leaves first is the innermost.
inline Inside<float> Interiors::surround(Vec3<float> p, float time,
                                         const PresenceKeys& keys) const {
  Bound<float> left[kMostInside];
  size_t count = 0;
  Inside<float> entered;
  const SoaBlock& c = b_.columns;
  const Vec3<float> d = normalize(Vec3<float>(0.4834f, 0.6291f, 0.6087f));
  for (uint32_t i = 0; i < kLongWalk; ++i) {
    const float ray[7] = {p.x, p.y, p.z, d.x, d.y, d.z, kFar};
    for (size_t k = 0; k < 7; ++k) c.floats(kO + k)[0] = ray[k];
    c.uints(kSlot)[0] = 0;
    c.floats(kTime)[0] = time;
    trace(1, keys);
    const Hit<float> h = hit_at<float>(traced(), 0);
    if (h.inst == kNoHit) break;
    const float past = h.t * 1.0001f + scene_.scale * 1e-6f;
    p = fma(d, past, p);
    if (h.inst == kLightShape) continue;
    const HitPlace<float> place = hit_place<float>(scene_, h.inst, h.geom, h.prim, true);
    if (!scene_.interiors.is_bound(place.material) ||
        detail::is_curved<float>(scene_, place.mesh, true))
      continue;
    const Surface<float> at = setup_surface<float>(
        scene_, {h.inst, place.mesh, h.prim, h.u, h.v, time}, d, false, false, true);
    p = spawn_origin<float>(at, d);
    const Bound<float> bound{place.object, place.material};
    if (dot(d, at.ng) < 0)
      entered.enter(bound, true);
    else if (entered.holds(bound.place))
      entered.leave(bound.place, true);
    else if (count < kMostInside)
      left[count++] = bound;
  }
  Inside<float> inside;
  while (count > 0) inside.enter(left[--count], true);
  return inside;
}

}  // namespace wavecomb
