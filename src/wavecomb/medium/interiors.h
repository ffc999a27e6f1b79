// SPDX-License-Identifier: Apache-2.0
/// Rays through what fills meshes, bound by bound.
///
/// On a way through media k with absorption a_k and scattering s_k, over lengths t_k,
///   throughput *= exp(-sum a_k t_k)
/// and a collision comes after an optical depth of scattering that is exponential, by a hero
/// channel (medium/tracking.h). Each medium is even, so that the length is drawn anew where one
/// begins. Where lamps draw lengths, too, that is once the bound or surface ahead is known.
///
/// What collides behind a bound that refracts walks on: no light sample could reach it. Where it
/// meets a surface it is a path again, whose bounce no light sample has competed with. What
/// collides in a clear bound is an event, with a light sample, a bounce and MIS as in volumes.
#pragma once

#include "wavecomb/integrate/path_pool.h"
#include "wavecomb/integrate/statistics.h"
#include "wavecomb/medium/equiangular.h"
#include "wavecomb/medium/interior_rays.h"
#include "wavecomb/medium/tracking.h"
#include "wavecomb/medium/walk.h"
#include "wavecomb/surface/surface.h"

namespace wavecomb {

/// Contract: a ray draws its own random numbers and no other's, so that neither order nor number of
/// lanes shows.
class Interiors {
 public:
  /// `counts` gets the rays that are traced here, as those of walks. `by_lamps`: lamps draw
  /// distances in fog, too (equiangular.h).
  Interiors(const SceneView& scene, const EmbreeAccelerator& accel, uint32_t width,
            const InteriorBuffers& buffers, Counts& counts, bool by_lamps)
      : scene_(scene),
        accel_(accel),
        width_(width),
        by_lamps_(by_lamps),
        b_(buffers),
        counts_(counts) {}

  /// What is around a point. `keys`: of any path.
  Inside<float> surround(Vec3<float> p, float time, PresenceKeys keys) const;

  /// Takes all rays to what stops them. `hits`: theirs, afterwards those of what is seen. Where a
  /// path begins it is in `around`; null: it goes on. start(i, path) gives the InteriorStart of the
  /// rays from i on.
  template <typename F, typename Start>
  void fly(const InteriorRays& rays, const HitSpan& hits, const InteriorEvents& events,
           const Inside<float>* around, PresenceKeys keys, const Start& start) const;
  /// Multiplies by what shadow rays pass, whose lengths are `most`; 0: nobody asks. `keys`: with
  /// the shadow sets where lights are linked.
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

  /// Lanes of a packet whose rays see an object (placed_geometry): it is visible to their kind, and
  /// linked to the light of a shadow ray. An object that a ray does not see neither stops nor dims
  /// it, but the ray enters and leaves it.
  template <typename F>
  Mask<F> sees(const Rays<F>& r, const UInt<F>& object, const Mask<F>& lanes) const;
  /// The medium between a bound and the next one ahead; nothing where the ray does not see the
  /// bound.
  template <typename F>
  InteriorMedium<F> medium_of(const Rays<F>& r, const Bound<F>& bound,
                              const Mask<F>& active) const {
    const Mask<F> there = active & Mask<F>(bound.material != UInt<F>(kNothing));
    return load_row<InteriorMedium, F>(reinterpret_cast<const float*>(scene_.interiors.media),
                                       bound.material, sees<F>(r, bound.place, there));
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
  /// Distance at which a ray continues past a hit at t that does not stop it and bounds nothing.
  /// The step is just above rounding errors, since a bound may lie close behind; to meet the same
  /// surface again costs time only.
  template <typename F>
  F past_hit(const F& t) const {
    return fma(t, F(1.f + 0x1p-20f), F(scene_.scale * 0x1p-21f));
  }
  /// What a ray of the packet has met, and where it goes on that passes: `s` and `inside` are then
  /// on the other side.
  template <typename F>
  Met<F> meet(Rays<F>& r, Inside<F>& inside, const Bound<F>& now, const Mask<F>& lanes) const;
  /// Whether lamps draw distances in a medium.
  template <typename F>
  static Mask<F> is_lit(const InteriorMedium<F>& m) {
    return Mask<F>(m.kind == UInt<F>(static_cast<uint32_t>(InteriorKind::kClear))) &
           (max_component(m.scattering) > 0.f);
  }
  /// Draws how far it is to the next collision, with number `u`. Where nothing scatters there is
  /// none, and a first number that waits stays. Where lamps draw, the number waits for the length.
  template <typename F>
  void draw(Rays<F>& r, const Inside<F>& inside, const F& u, const Mask<F>& lanes) const;
  /// Does so by lamps, with the number that waits, in a medium that ends at `far`.
  template <typename F>
  LampWay<F> draw_by_lamps(Rays<F>& r, const InteriorMedium<F>& medium, const F& far,
                           const Mask<F>& lanes) const;
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
  bool by_lamps_;
  const InteriorBuffers& b_;
  Counts& counts_;
};

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
  const uint32_t kind = keys.ray_kind;
  size_t left = 0;
  for (size_t i = 0; i < rays.size; i += kWidth<F>) {
    const Mask<F> active = first_lanes<F>(rays.size - i);
    const U slot = load<U>(rays.slot + i);
    const PathRow<F> path = load_row<PathRow, F>(rays.paths, slot, active);
    const InsideRow<F> row = load_row<InsideRow, F>(rays.inside, slot, active);
    Inside<F> inside = around ? around->template everywhere<F>() : Inside<F>(row);
    if (!around) inside.cross(scene_.interiors, row.place, row.crossed, kBounceCrosses, active);
    const InteriorStart<F> begins = start(i, path);
    const auto three = [&](float* const(&k)[3]) {
      return Vec3<F>(load<F>(k[0] + i), load<F>(k[1] + i), load<F>(k[2] + i));
    };
    const Color<F>& sum = path.throughput;
    Rays<F> r;
    r.who = lane_index<F>() + static_cast<uint32_t>(i);
    r.active = active;
    r.s = {three(rays.o),
           three(rays.d),
           path.throughput,
           F(0.f),
           F(sum.x + sum.y + sum.z),
           F(kFar * F(1.f + begins.first)),
           begins.seed,
           U(0u),
           begins.hero,
           U(0u)};
    inside.store_in(r.l);
    r.l.absorbed = r.l.ratio = Color<F>(F(1.f));
    r.l.time = rays.times ? load<F>(rays.times + i) : F(0.f);
    r.hit = hit_at<F>(hits, i);
    r.kind = kind;
    draw<F>(r, inside, begins.first, active);
    left +=
        scene_.visibility ? put<F>(rays, r, active, left) : advance<F>(rays, hits, events, r, left);
  }
  // The hits leave out bounds that are hidden from these rays, which they enter and leave all the
  // same.
  if (scene_.visibility) keys.ray_kind = kSeenByAll;
  run<F>(rays, left, keys, [&](Rays<F>& r, size_t at) {
    r.kind = kind;
    return advance<F>(rays, hits, events, r, at);
  });
}

template <typename F>
inline void Interiors::pass(const InteriorRays& rays, const float* most, float* const (&product)[3],
                            PresenceKeys keys) const {
  using U = UInt<F>;
  // A ray enters and leaves also the bounds that do not dim it.
  const PresenceKeys asked = keys;
  keys.ray_kind = kSeenByAll;
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
  run<F>(rays, left, keys, [&](Rays<F>& r, size_t at) {
    r.kind = kSeenByShadowRays;
    if (asked.shadow_set) {
      const U slot = gather<U>(rays.slot, r.who, Mask<U>(r.active));
      r.shadow_set = gather<U>(asked.shadow_set, slot * asked.shadow_stride, Mask<U>(r.active));
    }
    return advance_shadow<F>(rays, product, r, at);
  });
}

/// A ray that goes any way leaves what it has not entered. What it leaves first is the innermost.
inline Inside<float> Interiors::surround(Vec3<float> p, float time, PresenceKeys keys) const {
  keys.ray_kind = kSeenByAll;
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
    const float past = past_hit<float>(h.t);
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

#include "wavecomb/medium/interior_steps.h"
