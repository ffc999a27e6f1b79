// SPDX-License-Identifier: Apache-2.0
/// Subsurface random walks of a wave. In each iteration, all walks take one step. The remaining
/// walks are then stored contiguously, so that SIMD lanes stay full.
#pragma once

#include "wavecomb/accel/embree_accelerator.h"
#include "wavecomb/core/rows/soa.h"
#include "wavecomb/medium/subsurface/random_walk.h"
#include "wavecomb/scene/scene_view.h"

namespace wavecomb {

/// Surface point where a walk ends.
template <typename F>
struct WalkEnd {
  Vec3<F> p, d;  ///< hit point, and direction in which the walk arrived
  Color<F> throughput;
  F u, v;
  UInt<F> prim, geom, inst;
  UInt<F> material, collisions;
};

/// Queue of subsurface random walks, stored in columns of a memory block that the caller owns.
///
/// Contract: the random numbers of a walk depend only on that walk, so that neither the order of
/// walks nor the lane width affects the result.
class WalkQueue {
 public:
  static constexpr size_t kColumns = 36;
  explicit WalkQueue(const SoaBlock& block) : c_(block) {}

  size_t size() const { return size_; }

  static constexpr uint32_t kNoMedium = 0xffffffffu;

  /// Adds the walks in the active lanes. `slot` is the slot of the path. run() passes `ray_index`
  /// on to its callback `finish`.
  template <typename F>
  void add(const SubsurfaceWalk<F>& w, const UInt<F>& ray_index, const UInt<F>& slot, const F& time,
           const Mask<F>& active) {
    size_ += put<F>(size_, {w, ray_index, slot, UInt<F>(kNoMedium), time}, active);
  }

  /// Starts the added walks. medium_of(inst, geom, prim, met) returns the material at the point
  /// where a walk's first ray hits the walk's object, or kNoMedium. `keys` specify the objects.
  /// Calls leave(lanes, slot) for paths that do not start a walk.
  template <typename F, typename MediumOf, typename Leave>
  void enter(const SceneView& scene, const EmbreeAccelerator& accel, uint32_t width,
             const PresenceKeys& keys, const MediumOf& medium_of, const Leave& leave) {
    using U = UInt<F>;
    trace(scene, accel, width, keys, nullptr);
    size_t left = 0;
    for (size_t i = 0; i < size_; i += kWidth<F>) {
      const Mask<F> active = first_lanes<F>(size_ - i);
      const U inst = load<U>(c_.uints(kHitInst) + i);
      Row<F> row = get<F>(i);
      row.material =
          medium_of(inst, load<U>(c_.uints(kHitGeom) + i), load<U>(c_.uints(kHitPrim) + i),
                    Mask<F>(active & Mask<F>(inst != U(kNoHit))));
      const Mask<F> walks = active & Mask<F>(row.material != U(kNoMedium));
      choose_technique<F>(subsurface_medium<F>(scene.subsurface, row.material, walks),
                          load<F>(c_.floats(kHitT) + i), row.walk);
      if (any(Mask<F>(active & not_(walks)))) leave(Mask<F>(active & not_(walks)), row.slot);
      left += put<F>(left, row, walks);
    }
    size_ = left;
  }

  /// Runs all walks to their end. `keys` are indexed by path slot and specify the object in which
  /// each walk moves. `keys.salt` is the salt of the ray that entered the object. Calls
  /// finish(lanes, ray_index, end, reached_surface) for the lanes whose walks have ended. The mask
  /// `reached_surface` excludes walks that were terminated inside the object.
  template <typename F, typename Finish>
  void run(const SceneView& scene, const EmbreeAccelerator& accel, uint32_t width,
           PresenceKeys keys, uint64_t& steps, uint64_t& lanes, const Finish& finish) {
    using U = UInt<F>;
    const uint32_t salt = keys.salt;
    for (uint32_t step = 0; size_ > 0; ++step) {
      for (size_t i = 0; i < size_; i += kWidth<F>) {
        Row<F> row = get<F>(i);
        const Mask<F> active = first_lanes<F>(size_ - i);
        begin_flight<F>(subsurface_medium<F>(scene.subsurface, row.material, active), row.walk);
        store(c_.floats(kRest) + i, row.walk.rest);
      }
      keys.salt = salt + 0x10000u * (step + 1);
      trace(scene, accel, width, keys, c_.floats(kRest));
      steps += size_;
      size_t left = 0;
      for (size_t i = 0; i < size_; i += kWidth<F>) {
        lanes += kWidth<F>;
        const Mask<F> active = first_lanes<F>(size_ - i);
        Row<F> row = get<F>(i);
        SubsurfaceWalk<F>& w = row.walk;
        const U inst = load<U>(c_.uints(kHitInst) + i);
        const F hit_t = load<F>(c_.floats(kHitT) + i);
        const Mask<F> collides = active & Mask<F>(inst == U(kNoHit));
        const Mask<F> own = active & not_(collides);
        SubsurfaceWalk<F> after = w;
        const F t = select(own, hit_t, w.rest);
        const Mask<F> continues = end_flight<F>(
            subsurface_medium<F>(scene.subsurface, row.material, active), t, collides, after);
        const Mask<F> ended = active & not_(continues);
        if (any(ended)) {
          const WalkEnd<F> end{after.o,
                               after.d,
                               after.throughput,
                               load<F>(c_.floats(kHitU) + i),
                               load<F>(c_.floats(kHitV) + i),
                               load<U>(c_.uints(kHitPrim) + i),
                               load<U>(c_.uints(kHitGeom) + i),
                               inst,
                               row.material,
                               w.number};
          finish(ended, row.ray_index, end, Mask<F>(ended & own));
        }
        row.walk = after;
        left += put<F>(left, row, active & not_(ended));
      }
      size_ = left;
    }
  }

 private:
  enum Column : size_t {
    kO,
    kD = kO + 3,
    kThroughput = kD + 3,
    kFree = kThroughput + 3,
    kGuided = kFree + 3,
    kFirst = kGuided + 3,
    kRest,
    kSeed,
    kNumber,
    kNormal,
    kChoice,
    kFlight,
    kTechnique,
    kRayIndex,
    kSlot,
    kMaterial,
    kTime,
    kHitT,
    kHitU,
    kHitV,
    kHitPrim,
    kHitGeom,
    kHitInst,
    kEnd
  };
  static_assert(kEnd <= kColumns);

  void trace(const SceneView& scene, const EmbreeAccelerator& accel, uint32_t width,
             const PresenceKeys& keys, const float* tfar) const {
    accel.intersect({c_.floats(kO), c_.floats(kO + 1), c_.floats(kO + 2), c_.floats(kD),
                     c_.floats(kD + 1), c_.floats(kD + 2), tfar, c_.uints(kSlot), size_,
                     scene.has_motion ? c_.floats(kTime) : nullptr},
                    {c_.floats(kHitT), c_.floats(kHitU), c_.floats(kHitV), c_.uints(kHitPrim),
                     c_.uints(kHitGeom), c_.uints(kHitInst)},
                    width, false, keys);
  }

  template <typename F>
  struct Row {
    SubsurfaceWalk<F> walk;
    UInt<F> ray_index, slot, material;
    F time;
  };

  template <typename F>
  Row<F> get(size_t i) const {
    using U = UInt<F>;
    const auto real = [&](size_t column) { return load<F>(c_.floats(column) + i); };
    const auto number = [&](size_t column) { return load<U>(c_.uints(column) + i); };
    const auto three = [&](size_t column) {
      return Vec3<F>(real(column), real(column + 1), real(column + 2));
    };
    return {{three(kO), three(kD), three(kThroughput), real(kFirst), real(kRest), number(kSeed),
             number(kNumber), number(kNormal), real(kChoice), real(kFlight), number(kTechnique),
             three(kFree), three(kGuided)},
            number(kRayIndex),
            number(kSlot),
            number(kMaterial),
            real(kTime)};
  }
  /// Stores the active lanes contiguously, starting at `i`, and returns their number. The function
  /// writes whole packets, so up to one packet of entries after the stored walks may be
  /// overwritten.
  template <typename F>
  size_t put(size_t i, const Row<F>& row, const Mask<F>& active) {
    using U = UInt<F>;
    size_t n = 0;
    const auto real = [&](size_t column, const F& x) {
      n = compress_store<F>(c_.floats(column) + i, x, active);
    };
    const auto number = [&](size_t column, const U& x) {
      compress_store<U>(c_.uints(column) + i, x, Mask<U>(active));
    };
    const auto three = [&](size_t column, const Vec3<F>& x) {
      real(column, x.x);
      real(column + 1, x.y);
      real(column + 2, x.z);
    };
    const SubsurfaceWalk<F>& w = row.walk;
    three(kO, w.o);
    three(kD, w.d);
    three(kThroughput, w.throughput);
    three(kFree, w.free);
    three(kGuided, w.guided);
    real(kFirst, w.first);
    real(kRest, w.rest);
    real(kChoice, w.choice);
    real(kFlight, w.flight);
    real(kTime, row.time);
    number(kSeed, w.seed);
    number(kNumber, w.number);
    number(kNormal, w.normal);
    number(kTechnique, w.technique);
    number(kRayIndex, row.ray_index);
    number(kSlot, row.slot);
    number(kMaterial, row.material);
    return n;
  }

  const SoaBlock& c_;
  size_t size_ = 0;
};

}  // namespace wavecomb
