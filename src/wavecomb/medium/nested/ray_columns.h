// SPDX-License-Identifier: Apache-2.0
/// Data of rays through media inside meshes (nested_media.h).
#pragma once

#include "wavecomb/accel/embree_accelerator.h"
#include "wavecomb/geometry/hit/hit_material.h"
#include "wavecomb/medium/nested/buffers.h"
#include "wavecomb/medium/nested/medium_stack.h"

namespace wavecomb {

/// Rays of a wave in columns, and the rows of their paths.
struct NestedRays {
  float *o[3], *d[3];    ///< updated if the path scatters
  const uint32_t* slot;  ///< row of each path
  size_t size;
  const float* times;  ///< shutter times; null without motion
  float* paths;        ///< PathRow
  float* stacks;       ///< MediumStackRow
};

/// Volume events and collisions that stop the rays, with the weights of Flights, and the
/// transmittance due to absorption. If `limited` is set, `t` and `material` initially hold the
/// volume event that stops each ray. Once a ray has scattered in a mesh medium, its event is
/// dropped and its hero channel becomes kNoHero.
struct NestedEvents {
  bool limited;
  float* t;
  uint32_t* material;
  float *ratio[3], *absorbed[3];
  uint32_t* hero;
};

/// Start of a ray through media: the hero channel, the random number of the first distance, and the
/// seed for all other random numbers.
template <typename F>
struct NestedRayStart {
  UInt<F> hero, seed;
  F first;
};

/// Mesh and material of a hit, and the hit object as instance_geometry().
template <typename F>
struct HitObject {
  UInt<F> mesh, material, object;
};
template <typename F>
inline HitObject<F> hit_object(const SceneView& scene, const UInt<F>& inst, const UInt<F>& geom,
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

/// State of a ray in progress.
template <typename F>
struct NestedRayState {
  Vec3<F> o, d;
  Color<F> throughput;
  F start;  ///< length covered since the last collision
  F first;  ///< SubsurfaceWalk::first
  /// Distance to the next collision, or kFar if the distance was not sampled. Before the first
  /// scattering, kFar (1 + u) stores the random number u of the first distance, which is stratified
  /// over a pixel's samples. For shadow rays, the value is the remaining length.
  F rest;
  UInt<F> seed, number, hero, flags;
  WAVECOMB_FIELDS(o, d, throughput, start, first, rest, seed, number, hero, flags)
};
/// Medium stack and attenuation of a ray since the last collision.
template <typename F>
struct NestedRayMedia {
  UInt<F> object_0, object_1, object_2, object_3, material_0, material_1, material_2, material_3;
  Color<F> absorbed, ratio;
  F time;
  WAVECOMB_FIELDS(object_0, object_1, object_2, object_3, material_0, material_1, material_2,
                  material_3, absorbed, ratio, time)
};
static_assert(kRowWords<NestedRayState> + kRowWords<NestedRayMedia> == NestedMediaBuffers::kWords);
template <typename F>
struct NestedRayHit {
  F t, u, v;
  UInt<F> prim, geom, inst;
};
/// Packet of rays.
template <typename F>
struct NestedRayPacket {
  UInt<F> ray_index;  ///< index of each ray in the wave
  Mask<F> active;
  NestedRayState<F> s;
  NestedRayMedia<F> l;
  NestedRayHit<F> hit;
  uint32_t kind = kVisibleToAll;  ///< RayVisibility of the rays
  UInt<F> shadow_set{0u};  ///< ShadowRow::set of shadow rays; 0 if all objects block shadow rays
};
/// Hits of a packet of rays: lanes that hit a surface, lanes whose surface bounds a medium, and
/// lanes whose ray passes through.
template <typename F>
struct BoundaryHits {
  Mask<F> surface, passes, bound;
  F outer{1.f};
  UInt<F> object{0u};
};

}  // namespace detail

}  // namespace wavecomb
