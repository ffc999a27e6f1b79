// SPDX-License-Identifier: Apache-2.0
/// Medium stack of a path: the bounds that it has entered and not left (Schmidt and Budge, "Simple
/// Nested Dielectrics in Ray Traced Images", 2002). Where several overlap, the one with the highest
/// priority counts, and among equal priorities the last one entered.
#pragma once

#include "wavecomb/core/math.h"
#include "wavecomb/path/path_pool.h"
#include "wavecomb/scene/scene.h"

namespace wavecomb {

/// Size of the stack. If it overflows, the first bound entered is forgotten.
inline constexpr size_t kMostInside = 4;
/// Material of an empty entry.
inline constexpr uint32_t kNothing = 0xffffffffu;

/// Bound of a medium.
template <typename F>
struct Bound {
  UInt<F> place;     ///< placed_geometry() of the mesh
  UInt<F> material;  ///< kNothing if there is no bound
};

template <typename F>
class Inside {
  using U = UInt<F>;

 public:
  /// Creates an empty stack.
  Inside() {
    for (size_t k = 0; k < kMostInside; ++k) place_[k] = material_[k] = U(kNothing);
  }
  template <typename Row>
  explicit Inside(const Row& r)
      : place_{r.place_0, r.place_1, r.place_2, r.place_3},
        material_{r.material_0, r.material_1, r.material_2, r.material_3} {}
  template <typename Row>
  void store_in(Row& r) const {
    r.place_0 = place_[0], r.place_1 = place_[1], r.place_2 = place_[2], r.place_3 = place_[3];
    r.material_0 = material_[0], r.material_1 = material_[1];
    r.material_2 = material_[2], r.material_3 = material_[3];
  }

  /// Updates the stack for the bound that the last vertex's ray, selected by `bit` (Crossing), has
  /// crossed.
  void cross(const InteriorView& view, const UInt<F>& place, const UInt<F>& crossed, Crossing bit,
             const Mask<F>& active) {
    const auto has = [&](Crossing b) { return Mask<F>((crossed & uint32_t{b}) != U(0u)); };
    Mask<F> crosses = active & has(bit);
    if (none(crosses)) return;
    const U material = crossed >> kCrossingBits;
    const U kind = gather_field<F>(view.media, &InteriorMedium<float>::kind, material, crosses);
    crosses = crosses & Mask<F>(kind != U(static_cast<uint32_t>(InteriorKind::kNone)));
    enter({place, material}, crosses & has(kEnters));
    leave(place, crosses & not_(has(kEnters)));
  }
  /// Returns a packet with this stack in all lanes.
  template <typename G>
  Inside<G> everywhere() const {
    Inside<G> all;
    for (size_t k = 0; k < kMostInside; ++k) {
      all.place_[k] = UInt<G>(place_[k]);
      all.material_[k] = UInt<G>(material_[k]);
    }
    return all;
  }
  /// Replaces the stacks of `lanes` by those of `other`.
  void take(const Inside& other, const Mask<F>& lanes) {
    for (size_t k = 0; k < kMostInside; ++k) {
      place_[k] = select(Mask<U>(lanes), other.place_[k], place_[k]);
      material_[k] = select(Mask<U>(lanes), other.material_[k], material_[k]);
    }
  }

  /// Returns the bound that counts, the one with the highest priority.
  Bound<F> top(const InteriorView& view, const Mask<F>& active) const {
    Bound<F> best{U(kNothing), U(kNothing)};
    F most(-kInfinity);
    for (size_t k = 0; k < kMostInside; ++k) {
      const Mask<F> there = active & Mask<F>(material_[k] != U(kNothing));
      const F priority =
          gather_field<F>(view.media, &InteriorMedium<float>::priority, material_[k], there);
      const Mask<F> wins = there & (priority >= most);
      most = select(wins, priority, most);
      best.place = select(Mask<U>(wins), place_[k], best.place);
      best.material = select(Mask<U>(wins), material_[k], best.material);
    }
    return best;
  }

  /// Returns the lanes that have entered a bound of the geometry `place`.
  Mask<F> holds(const U& place) const {
    Mask<F> any_of(false);
    for (size_t k = 0; k < kMostInside; ++k)
      any_of = any_of | (Mask<F>(material_[k] != U(kNothing)) & Mask<F>(place_[k] == place));
    return any_of;
  }
  /// Enters `bound` in `lanes`.
  void enter(const Bound<F>& bound, const Mask<F>& lanes) {
    Mask<U> left(lanes & Mask<F>(material_[kMostInside - 1] != U(kNothing)));
    drop(0, left);
    left = Mask<U>(lanes);
    for (size_t k = 0; k < kMostInside; ++k) {
      const Mask<U> here = left & Mask<U>(material_[k] == U(kNothing));
      place_[k] = select(here, bound.place, place_[k]);
      material_[k] = select(here, bound.material, material_[k]);
      left = left & Mask<U>(not_(Mask<F>(here)));
    }
  }
  /// Leaves the last entered bound of the geometry `place` in `lanes`, if there is one.
  void leave(const U& place, const Mask<F>& lanes) {
    Mask<F> left = lanes;
    for (size_t k = kMostInside; k-- > 0;) {
      const Mask<F> here =
          left & Mask<F>(material_[k] != U(kNothing)) & Mask<F>(place_[k] == place);
      drop(k, Mask<U>(here));
      left = left & not_(here);
    }
  }

 private:
  template <typename G>
  friend class Inside;

  /// Removes entry k.
  void drop(size_t k, const Mask<U>& lanes) {
    for (; k < kMostInside; ++k) {
      const bool last = k + 1 == kMostInside;
      place_[k] = select(lanes, last ? U(kNothing) : place_[k + 1], place_[k]);
      material_[k] = select(lanes, last ? U(kNothing) : material_[k + 1], material_[k]);
    }
  }

  U place_[kMostInside], material_[kMostInside];
};

/// Bound that a ray hits.
template <typename F>
struct BoundMet {
  Inside<F> after;  ///< medium stack on the other side
  /// Whether the ray passes unchanged, since another bound has priority or this one has no effect.
  Mask<F> passes;
  F outer;  ///< index of refraction on the outer side
};

/// Returns the effect of `bound` on `lanes`, which hit it from outside where `enters`. `now` is the
/// top of `before`.
template <typename F>
inline BoundMet<F> meet_bound(const InteriorView& view, const Inside<F>& before,
                              const Bound<F>& now, const Bound<F>& bound, const Mask<F>& enters,
                              const Mask<F>& lanes) {
  using U = UInt<F>;
  BoundMet<F> met{before, Mask<F>(false), F(1.f)};
  met.after.enter(bound, lanes & enters);
  met.after.leave(bound.place, lanes & not_(enters));
  const Bound<F> then = met.after.top(view, lanes);
  const auto same = [](const Bound<F>& a, const Bound<F>& b) {
    return Mask<F>(a.place == b.place) & Mask<F>(a.material == b.material);
  };
  const U beside = select(Mask<U>(enters), now.material, then.material);
  const Mask<F> filled = lanes & Mask<F>(beside != U(kNothing));
  met.outer = select(
      filled, gather_field<F>(view.media, &InteriorMedium<float>::ior, beside, filled), F(1.f));
  const U kind = gather_field<F>(view.media, &InteriorMedium<float>::kind, bound.material, lanes);
  const Mask<F> clear =
      Mask<F>(kind == U(static_cast<uint32_t>(InteriorKind::kClear))) & (met.outer == 1.f);
  // A bound that is left without having been entered stays visible.
  met.passes = lanes & (clear | (same(now, then) & (enters | before.holds(bound.place))));
  return met;
}

}  // namespace wavecomb
