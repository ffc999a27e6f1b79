// SPDX-License-Identifier: Apache-2.0
/// Medium stack of a path: the medium boundaries (meshes) that the path has entered and not left
/// (Schmidt and Budge, "Simple Nested Dielectrics in Ray Traced Images", 2002). Where several
/// meshes overlap, the medium of the mesh with the highest priority applies, and if priorities are
/// equal, the medium of the mesh that was entered last.
#pragma once

#include "wavecomb/core/math.h"
#include "wavecomb/path/path_pool.h"
#include "wavecomb/scene/scene_view.h"

namespace wavecomb {

/// Maximum number of entries in a medium stack. If the stack is full, a new entry replaces the
/// boundary that was entered first.
inline constexpr size_t kMaxMediumStack = 4;
/// Material id of an empty entry of the stack.
inline constexpr uint32_t kNoMaterial = 0xffffffffu;

/// Boundary of a medium: a mesh and its material.
template <typename F>
struct MediumBoundary {
  UInt<F> object;    ///< instance_geometry() of the mesh
  UInt<F> material;  ///< kNoMaterial if there is no boundary
};

template <typename F>
class MediumStack {
  using U = UInt<F>;

 public:
  /// Creates an empty stack.
  MediumStack() {
    for (size_t k = 0; k < kMaxMediumStack; ++k) object_[k] = material_[k] = U(kNoMaterial);
  }
  template <typename Row>
  explicit MediumStack(const Row& r)
      : object_{r.object_0, r.object_1, r.object_2, r.object_3},
        material_{r.material_0, r.material_1, r.material_2, r.material_3} {}
  template <typename Row>
  void store_in(Row& r) const {
    r.object_0 = object_[0], r.object_1 = object_[1], r.object_2 = object_[2],
    r.object_3 = object_[3];
    r.material_0 = material_[0], r.material_1 = material_[1];
    r.material_2 = material_[2], r.material_3 = material_[3];
  }

  /// Enters or leaves a medium boundary that was hit at the last path vertex, if a ray from that
  /// vertex crosses the boundary. `bit` selects the ray: the bounce or the shadow ray.
  void cross(const MeshMediaView& view, const UInt<F>& object, const UInt<F>& crossed, Crossing bit,
             const Mask<F>& active) {
    const auto has = [&](Crossing b) { return Mask<F>((crossed & uint32_t{b}) != U(0u)); };
    Mask<F> crosses = active & has(bit);
    if (none(crosses)) return;
    const U material = crossed >> kCrossingBits;
    const U kind = gather_field<F>(view.media, &MeshMedium<float>::kind, material, crosses);
    crosses = crosses & Mask<F>(kind != U(static_cast<uint32_t>(BoundaryKind::kNone)));
    enter({object, material}, crosses & has(kEnters));
    leave(object, crosses & not_(has(kEnters)));
  }
  /// Returns a packet of stacks with a copy of this stack in each lane.
  template <typename G>
  MediumStack<G> broadcast() const {
    MediumStack<G> all;
    for (size_t k = 0; k < kMaxMediumStack; ++k) {
      all.object_[k] = UInt<G>(object_[k]);
      all.material_[k] = UInt<G>(material_[k]);
    }
    return all;
  }
  /// Replaces the stacks in `lanes` by the stacks of the same lanes in `other`.
  void assign(const MediumStack& other, const Mask<F>& lanes) {
    for (size_t k = 0; k < kMaxMediumStack; ++k) {
      object_[k] = select(Mask<U>(lanes), other.object_[k], object_[k]);
      material_[k] = select(Mask<U>(lanes), other.material_[k], material_[k]);
    }
  }

  /// Returns the entry with the highest priority. The path is in the medium of this entry.
  MediumBoundary<F> top(const MeshMediaView& view, const Mask<F>& active) const {
    MediumBoundary<F> best{U(kNoMaterial), U(kNoMaterial)};
    F most(-kInfinity);
    for (size_t k = 0; k < kMaxMediumStack; ++k) {
      const Mask<F> occupied = active & Mask<F>(material_[k] != U(kNoMaterial));
      const F priority =
          gather_field<F>(view.media, &MeshMedium<float>::priority, material_[k], occupied);
      const Mask<F> has_priority = occupied & (priority >= most);
      most = select(has_priority, priority, most);
      best.object = select(Mask<U>(has_priority), object_[k], best.object);
      best.material = select(Mask<U>(has_priority), material_[k], best.material);
    }
    return best;
  }

  /// Returns the lanes whose stack contains the geometry `object`.
  Mask<F> contains(const U& object) const {
    Mask<F> any_of(false);
    for (size_t k = 0; k < kMaxMediumStack; ++k)
      any_of = any_of | (Mask<F>(material_[k] != U(kNoMaterial)) & Mask<F>(object_[k] == object));
    return any_of;
  }
  /// Pushes `bound` onto the stacks of `lanes`.
  void enter(const MediumBoundary<F>& bound, const Mask<F>& lanes) {
    Mask<U> left(lanes & Mask<F>(material_[kMaxMediumStack - 1] != U(kNoMaterial)));
    remove(0, left);
    left = Mask<U>(lanes);
    for (size_t k = 0; k < kMaxMediumStack; ++k) {
      const Mask<U> here = left & Mask<U>(material_[k] == U(kNoMaterial));
      object_[k] = select(here, bound.object, object_[k]);
      material_[k] = select(here, bound.material, material_[k]);
      left = left & Mask<U>(not_(Mask<F>(here)));
    }
  }
  /// Removes the last entry of the geometry `object` in `lanes`, if there is one.
  void leave(const U& object, const Mask<F>& lanes) {
    Mask<F> left = lanes;
    for (size_t k = kMaxMediumStack; k-- > 0;) {
      const Mask<F> here =
          left & Mask<F>(material_[k] != U(kNoMaterial)) & Mask<F>(object_[k] == object);
      remove(k, Mask<U>(here));
      left = left & not_(here);
    }
  }

 private:
  template <typename G>
  friend class MediumStack;

  /// Removes entry k.
  void remove(size_t k, const Mask<U>& lanes) {
    for (; k < kMaxMediumStack; ++k) {
      const bool last = k + 1 == kMaxMediumStack;
      object_[k] = select(lanes, last ? U(kNoMaterial) : object_[k + 1], object_[k]);
      material_[k] = select(lanes, last ? U(kNoMaterial) : material_[k + 1], material_[k]);
    }
  }

  U object_[kMaxMediumStack], material_[kMaxMediumStack];
};

/// Medium boundary that a ray hits.
template <typename F>
struct BoundaryHit {
  MediumStack<F> after;  ///< medium stack on the other side of the boundary
  /// Whether the ray passes unchanged, because a medium of higher priority encloses the boundary or
  /// the boundary has no effect.
  Mask<F> passes;
  F outer;  ///< index of refraction on the outer side
};

/// Returns the effect of the boundary `bound` on the rays in `lanes` that hit it. Rays in the lanes
/// `enters` hit the boundary from outside. `current` is the top entry of the stack `before`.
template <typename F>
inline BoundaryHit<F> cross_boundary(const MeshMediaView& view, const MediumStack<F>& before,
                                     const MediumBoundary<F>& current,
                                     const MediumBoundary<F>& bound, const Mask<F>& enters,
                                     const Mask<F>& lanes) {
  using U = UInt<F>;
  BoundaryHit<F> hit{before, Mask<F>(false), F(1.f)};
  hit.after.enter(bound, lanes & enters);
  hit.after.leave(bound.object, lanes & not_(enters));
  const MediumBoundary<F> top_after = hit.after.top(view, lanes);
  const auto same = [](const MediumBoundary<F>& a, const MediumBoundary<F>& b) {
    return Mask<F>(a.object == b.object) & Mask<F>(a.material == b.material);
  };
  const U outer_material = select(Mask<U>(enters), current.material, top_after.material);
  const Mask<F> filled = lanes & Mask<F>(outer_material != U(kNoMaterial));
  hit.outer = select(
      filled, gather_field<F>(view.media, &MeshMedium<float>::ior, outer_material, filled), F(1.f));
  const U kind = gather_field<F>(view.media, &MeshMedium<float>::kind, bound.material, lanes);
  const Mask<F> clear =
      Mask<F>(kind == U(static_cast<uint32_t>(BoundaryKind::kClear))) & (hit.outer == 1.f);
  // Priorities do not hide the boundary of a mesh that a ray leaves without having entered it.
  hit.passes =
      lanes & (clear | (same(current, top_after) & (enters | before.contains(bound.object))));
  return hit;
}

}  // namespace wavecomb
