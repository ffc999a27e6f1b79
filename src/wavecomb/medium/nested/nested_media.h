// SPDX-License-Identifier: Apache-2.0
/// Rays through media inside meshes, from one medium boundary to the next.
///
/// A ray through media k with absorption a_k and scattering s_k, over lengths t_k, has throughput
///   *= exp(-sum a_k t_k) and collides after an exponentially distributed optical depth of
///   scattering, which a hero channel samples (medium/volume/tracking.h). Since each
///   medium is homogeneous, a new distance is sampled wherever a ray enters a medium. With
///   equiangular sampling, the distance is sampled after the next boundary or surface is found.
///
/// Scattering behind a refractive boundary skips light sampling, since no shadow ray can reach a
/// light, and continues as a random walk. Where the random walk hits a surface, the path continues
/// as usual, and emission of this surface has MIS weight 1. Scattering inside a clear boundary,
/// which does not refract, is an event with light sample, bounce and MIS, as in volumes.
#pragma once

#include "wavecomb/geometry/hit/surface.h"
#include "wavecomb/medium/nested/ray_columns.h"
#include "wavecomb/medium/subsurface/random_walk.h"
#include "wavecomb/medium/volume/equiangular.h"
#include "wavecomb/medium/volume/tracking.h"
#include "wavecomb/path/path_pool.h"
#include "wavecomb/path/statistics.h"

namespace wavecomb {

/// Traces the rays of a wave through the media inside meshes.
///
/// Contract: the random numbers of a ray depend only on that ray, so that neither the order of rays
/// nor the lane width affects the result.
class NestedMedia {
 public:
  /// `counts` receives the number of traced rays, counted as steps of random walks. `equiangular`
  /// selects equiangular sampling of distances in fog (equiangular.h).
  NestedMedia(const SceneView& scene, const EmbreeAccelerator& accel, uint32_t width,
              const NestedMediaBuffers& buffers, Counts& counts, bool equiangular)
      : scene_(scene),
        accel_(accel),
        width_(width),
        equiangular_(equiangular),
        b_(buffers),
        counts_(counts) {}

  /// Returns the medium stack at a point. `keys` may be the presence keys of any path.
  MediumStack<float> stack_at(Vec3<float> p, float time, PresenceKeys keys) const;

  /// Traces all rays to the event or surface that stops them. On entry, `hits` holds the first hits
  /// of the rays, and on return the hits at which the rays end. `around` is the medium stack at the
  /// camera for new paths, or null for paths that continue. start(i, path) returns the
  /// NestedRayStart of the packet at i.
  template <typename F, typename Start>
  void sample_flight(const NestedRays& rays, const HitSpan& hits, const NestedEvents& events,
                     const MediumStack<float>* around, PresenceKeys keys, const Start& start) const;
  /// Multiplies `product` by the transmittance of shadow rays of length `most`. A ray of length 0
  /// is skipped. If the scene has light linking, `keys` include the shadow sets.
  template <typename F>
  void attenuate(const NestedRays& rays, const float* most, float* const (&product)[3],
                 PresenceKeys keys) const;

 private:
  enum Column : size_t {
    kO,
    kD = kO + 3,
    kTfar = kD + 3,
    kSlot,
    kTime,
    kHit,
    kRayIndex = kHit + 6
  };
  static_assert(kRayIndex < NestedMediaBuffers::kColumns);
  static constexpr float kFar = 1e30f;
  static constexpr uint32_t kHasScattered = 1;

  template <typename F>
  using Rays = detail::NestedRayPacket<F>;
  template <typename F>
  using BoundaryHits = detail::BoundaryHits<F>;
  template <typename F>
  using Hit = detail::NestedRayHit<F>;

  float* states() const { return b_.rows.floats(0); }
  float* loads(size_t capacity) const {
    return states() + capacity * kRowWords<detail::NestedRayState>;
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

  /// Returns the lanes of a packet in which the ray can see an object (instance_geometry()). The
  /// object must be visible to rays of this kind and, for a shadow ray, included in the light's
  /// shadow linking. An object that is invisible to a ray neither stops nor attenuates the ray, but
  /// the ray still enters and leaves the object's medium.
  template <typename F>
  Mask<F> is_visible(const Rays<F>& r, const UInt<F>& object, const Mask<F>& lanes) const;
  /// Returns the medium inside a boundary. The medium is empty in lanes whose ray cannot see the
  /// boundary.
  template <typename F>
  MeshMedium<F> medium_of(const Rays<F>& r, const MediumBoundary<F>& bound,
                          const Mask<F>& active) const {
    const Mask<F> occupied = active & Mask<F>(bound.material != UInt<F>(kNoMaterial));
    return load_row<MeshMedium, F>(reinterpret_cast<const float*>(scene_.nested_media.media),
                                   bound.material, is_visible<F>(r, bound.object, occupied));
  }
  /// Volume event that stops a ray: the distance and the material of the event.
  template <typename F>
  struct Limit {
    F length;
    UInt<F> material;
  };
  template <typename F>
  Limit<F> limit_of(const NestedEvents& events, const Rays<F>& r) const {
    using U = UInt<F>;
    if (!events.limited) return {F(kInfinity), U(uint32_t{Flights::kNoEvent})};
    const Mask<F> may = r.active & Mask<F>((r.s.flags & U(kHasScattered)) == U(0u));
    const F at = gather<F>(events.t, r.ray_index, may);
    return {select(may, max(F(at - r.s.start), F(0.f)), F(kInfinity)),
            gather<U>(events.material, r.ray_index, Mask<U>(may))};
  }
  /// Returns the distance at which a ray continues after a hit at t that neither stops the ray nor
  /// bounds a medium. The step is just above rounding error, since a medium boundary may follow
  /// closely. If the ray then hits the same surface again, this costs time but does not change the
  /// result.
  template <typename F>
  F past_hit(const F& t) const {
    return fma(t, F(1.f + 0x1p-20f), F(scene_.scale * 0x1p-21f));
  }
  /// Returns the hits of the rays in the packet. In lanes whose ray passes through a boundary,
  /// `r.s` and `stack` are updated to the other side.
  template <typename F>
  BoundaryHits<F> intersect_boundary(Rays<F>& r, MediumStack<F>& stack,
                                     const MediumBoundary<F>& current, const Mask<F>& lanes) const;
  /// Returns the lanes in which distances are sampled by equiangular sampling.
  template <typename F>
  static Mask<F> is_lit(const MeshMedium<F>& m) {
    return Mask<F>(m.kind == UInt<F>(static_cast<uint32_t>(BoundaryKind::kClear))) &
           (max_component(m.scattering) > 0.f);
  }
  /// Samples the distance to the next collision with the random number `u`. In a medium without
  /// scattering, no distance is sampled, and the next medium uses the random number of the first
  /// distance. With equiangular sampling, `u` is stored until the length of the segment is known.
  template <typename F>
  void sample_distance(Rays<F>& r, const MediumStack<F>& stack, const F& u,
                       const Mask<F>& lanes) const;
  /// Samples the distance by equiangular sampling of a light, with the stored random number, in a
  /// medium that ends at distance `far`.
  template <typename F>
  EquiangularDistribution<F> sample_equiangular(Rays<F>& r, const MeshMedium<F>& medium,
                                                const F& far, const Mask<F>& lanes) const;
  /// Scatters at a collision. Returns the lanes whose path is terminated.
  template <typename F>
  Mask<F> scatter_ray(const NestedRays& all, Rays<F>& r, const MeshMedium<F>& medium,
                      const F& length, const Mask<F>& lanes) const;
  /// Advances rays to their next medium boundary or collision, finishes the rays that end, and
  /// appends the remaining rays to the list at index `left`. Returns the number of appended rays.
  template <typename F>
  size_t advance(const NestedRays& all, const HitSpan& hits, const NestedEvents& events, Rays<F>& r,
                 size_t left) const;
  /// State of rays that end, at a surface, at a collision or outside the scene.
  template <typename F>
  struct SegmentEnd {
    MediumStackRow<F> stack;
    UInt<F> material;    ///< material of the event, or Flights::kNoEvent
    Mask<F> terminated;  ///< lanes whose path ends here
  };
  /// Stores hit, event and path of the rays in the lanes `done`.
  template <typename F>
  void finish(const NestedRays& all, const HitSpan& hits, const NestedEvents& events,
              const Rays<F>& r, const SegmentEnd<F>& end, const Mask<F>& done) const;
  /// Advances shadow rays.
  template <typename F>
  size_t advance_shadow(const NestedRays& all, float* const (&product)[3], Rays<F>& r,
                        size_t left) const;
  template <typename F>
  size_t store_active(const NestedRays& all, const Rays<F>& r, const Mask<F>& continues,
                      size_t left) const;
  /// Advances the listed rays until none is left.
  template <typename F, typename Advance>
  void run(const NestedRays& all, size_t left, PresenceKeys keys, const Advance& advance) const;

  const SceneView& scene_;
  const EmbreeAccelerator& accel_;
  uint32_t width_;
  bool equiangular_;
  const NestedMediaBuffers& b_;
  Counts& counts_;
};

template <typename F, typename Advance>
inline void NestedMedia::run(const NestedRays& all, size_t left, PresenceKeys keys,
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
      const U ray_index = load<U>(b_.columns.uints(kRayIndex) + j);
      Rays<F> r{ray_index, active, load_row<detail::NestedRayState, F>(states(), ray_index, active),
                load_row<detail::NestedRayMedia, F>(loads(all.size), ray_index, active),
                hit_at<F>(traced(), j)};
      left += advance(r, left);
    }
  }
}

template <typename F, typename Start>
inline void NestedMedia::sample_flight(const NestedRays& rays, const HitSpan& hits,
                                       const NestedEvents& events, const MediumStack<float>* around,
                                       PresenceKeys keys, const Start& start) const {
  using U = UInt<F>;
  const uint32_t kind = keys.ray_kind;
  size_t left = 0;
  for (size_t i = 0; i < rays.size; i += kWidth<F>) {
    const Mask<F> active = first_lanes<F>(rays.size - i);
    const U slot = load<U>(rays.slot + i);
    const PathRow<F> path = load_row<PathRow, F>(rays.paths, slot, active);
    const MediumStackRow<F> row = load_row<MediumStackRow, F>(rays.stacks, slot, active);
    MediumStack<F> stack = around ? around->template broadcast<F>() : MediumStack<F>(row);
    if (!around) stack.cross(scene_.nested_media, row.object, row.crossed, kBounceCrosses, active);
    const NestedRayStart<F> ray_start = start(i, path);
    const auto three = [&](float* const(&k)[3]) {
      return Vec3<F>(load<F>(k[0] + i), load<F>(k[1] + i), load<F>(k[2] + i));
    };
    const Color<F>& sum = path.throughput;
    Rays<F> r;
    r.ray_index = lane_index<F>() + static_cast<uint32_t>(i);
    r.active = active;
    r.s = {three(rays.o),
           three(rays.d),
           path.throughput,
           F(0.f),
           F(sum.x + sum.y + sum.z),
           F(kFar * F(1.f + ray_start.first)),
           ray_start.seed,
           U(0u),
           ray_start.hero,
           U(0u)};
    stack.store_in(r.l);
    r.l.absorbed = r.l.ratio = Color<F>(F(1.f));
    r.l.time = rays.times ? load<F>(rays.times + i) : F(0.f);
    r.hit = hit_at<F>(hits, i);
    r.kind = kind;
    sample_distance<F>(r, stack, ray_start.first, active);
    left += scene_.visibility ? store_active<F>(rays, r, active, left)
                              : advance<F>(rays, hits, events, r, left);
  }
  // Closest-hit queries skip medium boundaries that are invisible to the rays, but the rays must
  // still enter and leave these boundaries.
  if (scene_.visibility) keys.ray_kind = kVisibleToAll;
  run<F>(rays, left, keys, [&](Rays<F>& r, size_t at) {
    r.kind = kind;
    return advance<F>(rays, hits, events, r, at);
  });
}

template <typename F>
inline void NestedMedia::attenuate(const NestedRays& rays, const float* most,
                                   float* const (&product)[3], PresenceKeys keys) const {
  using U = UInt<F>;
  // Rays also enter and leave boundaries of media without attenuation.
  const PresenceKeys requested = keys;
  keys.ray_kind = kVisibleToAll;
  keys.bounce_pdf = nullptr;
  keys.shadow_set = nullptr;
  keys.optical_depth = nullptr;
  size_t left = 0;
  for (size_t i = 0; i < rays.size; i += kWidth<F>) {
    const F length = load<F>(most + i);
    const Mask<F> active = first_lanes<F>(rays.size - i) & (length > 0.f);
    const U slot = load<U>(rays.slot + i);
    const MediumStackRow<F> row = load_row<MediumStackRow, F>(rays.stacks, slot, active);
    MediumStack<F> stack(row);
    stack.cross(scene_.nested_media, row.object, row.crossed, kShadowCrosses, active);
    const auto three = [&](float* const(&k)[3]) {
      return Vec3<F>(load<F>(k[0] + i), load<F>(k[1] + i), load<F>(k[2] + i));
    };
    Rays<F> r;
    r.ray_index = lane_index<F>() + static_cast<uint32_t>(i);
    r.active = active;
    r.s = {three(rays.o), three(rays.d), Color<F>(F(0.f)), F(0.f), F(0.f), length, U(0u), U(0u),
           U(0u),         U(0u)};
    stack.store_in(r.l);
    r.l.absorbed = r.l.ratio = Color<F>(F(1.f));
    r.l.time = rays.times ? load<F>(rays.times + i) : F(0.f);
    left += store_active<F>(rays, r, active, left);
  }
  run<F>(rays, left, keys, [&](Rays<F>& r, size_t at) {
    r.kind = kVisibleToShadowRays;
    if (requested.shadow_set) {
      const U slot = gather<U>(rays.slot, r.ray_index, Mask<U>(r.active));
      r.shadow_set =
          gather<U>(requested.shadow_set, slot * requested.shadow_stride, Mask<U>(r.active));
    }
    return advance_shadow<F>(rays, product, r, at);
  });
}

/// Traces a ray in an arbitrary direction to find the media around the point: the meshes that the
/// ray leaves without having entered, innermost first.
inline MediumStack<float> NestedMedia::stack_at(Vec3<float> p, float time,
                                                PresenceKeys keys) const {
  keys.ray_kind = kVisibleToAll;
  keys.bounce_pdf = nullptr;
  MediumBoundary<float> left[kMaxMediumStack];
  size_t count = 0;
  MediumStack<float> entered;
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
    const HitObject<float> hit = hit_object<float>(scene_, h.inst, h.geom, h.prim, true);
    if (!scene_.nested_media.is_bound(hit.material) ||
        detail::is_curved<float>(scene_, hit.mesh, true))
      continue;
    const Surface<float> at = setup_surface<float>(
        scene_, {h.inst, hit.mesh, h.prim, h.u, h.v, time}, d, false, false, true);
    p = spawn_origin<float>(at, d);
    const MediumBoundary<float> bound{hit.object, hit.material};
    if (dot(d, at.ng) < 0)
      entered.enter(bound, true);
    else if (entered.contains(bound.object))
      entered.leave(bound.object, true);
    else if (count < kMaxMediumStack)
      left[count++] = bound;
  }
  MediumStack<float> stack;
  while (count > 0) stack.enter(left[--count], true);
  return stack;
}

}  // namespace wavecomb

#include "wavecomb/medium/nested/ray_steps.h"
