// SPDX-License-Identifier: Apache-2.0
/// Rays through what fills meshes, as data (interiors.h).
#pragma once

#include "wavecomb/accel/embree_accelerator.h"
#include "wavecomb/integrate/interior_buffers.h"
#include "wavecomb/medium/inside.h"
#include "wavecomb/surface/hit.h"

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
  /// To the next collision, or kFar; kFar (1 + u) where nothing has scattered yet, with the number
  /// u of the first length, which is spread over a pixel's samples. Of a shadow ray, to its end.
  F rest;
  UInt<F> seed, number, hero, flags;
  WAVECOMB_FIELDS(o, d, throughput, start, first, rest, seed, number, hero, flags)
};
/// What it is inside of, and what has become of its light since the last collision.
template <typename F>
struct InteriorLoad {
  UInt<F> place_0, place_1, place_2, place_3, material_0, material_1, material_2, material_3;
  Color<F> absorbed, ratio;
  F time;
  WAVECOMB_FIELDS(place_0, place_1, place_2, place_3, material_0, material_1, material_2,
                  material_3, absorbed, ratio, time)
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
  uint32_t kind = kSeenByAll;  ///< RayVisibility of the rays
  UInt<F> shadow_set{0u};  ///< of shadow rays: ShadowRow::set, 0 where every object is in the way
};
/// A bound that rays of a packet have met.
template <typename F>
struct InteriorMet {
  Mask<F> surface, passes, bound;
  F outer{1.f};
  UInt<F> object{0u};
};

}  // namespace detail

}  // namespace wavecomb
