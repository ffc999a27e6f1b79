// SPDX-License-Identifier: Apache-2.0
/// Wave stage 3c for one program: shades a batch of records in packets.
#pragma once

#include "wavecomb/path/vertex.h"
#include "wavecomb/wave/stages/record_packet.h"
#include "wavecomb/wave/wave.h"

namespace wavecomb {

/// Shades a packet of path vertices. Packet kernels inline the shading steps; scalar kernels call
/// shade_vertex(), the function of the reference integrator.
template <typename Bsdf, typename Joint, typename F, uint32_t kFeatures>
WAVECOMB_INLINE VertexResult<F> shade_one(const Vertex<F, kFeatures>& v,
                                          typename Joint::template Coupling<F>& joint) {
  if constexpr (kIsScalar<F>)
    return shade_vertex<Bsdf, F, kFeatures, Joint>(v, joint);
  else
    return vertex_steps<Bsdf, F>(v, joint);
}

/// Loads the state of the paths of a packet.
template <typename F, uint32_t kFeatures>
WAVECOMB_INLINE PathState<F> load_state(const PathPool& pool, const WaveContext& context,
                                        const PathRow<F>& path, const ShadingRecord<F>& record,
                                        uint32_t depth, const Mask<F>& active) {
  using V = Vertex<F, kFeatures>;
  const UInt<F> slot = record.slot;
  PathState<F> state = path_state<F>(path, record.t);
  if (V::has(kLinks) && context.links() && context.scene.mesh_lights && depth > 0) [[unlikely]]
    state.link = gather_field<F>(pool.cold, &PathColdRow<float>::link, slot, active);
  if (V::has(kMeshLights) && context.scene.mesh_lights && pool.diffuse && depth > 0) [[unlikely]]
    state.diffuse = load_row<RadianceRow, F>(pool.diffuse, slot, active).sum;
  if (context.uses_pixel_importance()) [[unlikely]]
    state.importance = gather_field<F>(pool.cold, &PathColdRow<float>::importance, slot, active);
  if (V::has(kNestedMedia) && pool.medium_stacks) [[unlikely]] {
    state.outer = gather_field<F>(pool.medium_stacks, &MediumStackRow<float>::outer, slot, active);
    state.medium =
        gather_field<F>(pool.medium_stacks, &MediumStackRow<float>::medium, slot, active);
  }
  return state;
}

/// Stores the shadow rays and the next path segments of a packet. `group` is the light group of the
/// light samples.
template <typename Bsdf, typename F, uint32_t kFeatures>
WAVECOMB_INLINE void store_rays(const PathPool& pool, const VertexResult<F>& v,
                                const SampleKey<F>& key, const UInt<F>& slot,
                                const UInt<F>& group) {
  using V = Vertex<F, kFeatures>;
  if (any(v.has_shadow))
    store_row<ShadowRow, F>(pool.shadows, slot,
                            {v.shadow_o, v.shadow_d, v.shadow_tfar, v.direct, group, v.shadow_set},
                            v.has_shadow);
  if constexpr (V::has(kMeshLights)) {
    if (pool.shadow_tints) [[unlikely]]
      store_row<RadianceRow, F>(pool.shadow_tints, slot, {v.shadow_tint}, v.has_shadow);
    if (pool.diffuse) [[unlikely]]
      store_row<RadianceRow, F>(pool.diffuse, slot, {v.next.diffuse}, v.alive);
  }
  constexpr bool kMayEnter = V::has(kSubsurface) && Bsdf::kHasSubsurface;
  if (any(v.alive))
    store_row<PathRow, F>(pool.paths, slot, path_row<kMayEnter, F>(v.next, key), v.alive);
}

/// Shades the records [begin, end) of the shading order, one packet at a time. All of these records
/// use the variant `Bsdf`. In the path pool, the next ray of a path overwrites its previous ray.
/// Outcomes are stored in arrival order. `Joint` is the joint transport that may be combined with
/// camera paths (path/joint_transport.h).
template <typename Bsdf, typename F, uint32_t kFeatures, typename Joint>
void shade_batch(Wave& wave, const WaveContext& context, const ShadeSettings& settings,
                 uint32_t depth, size_t begin, size_t end) {
  using U = UInt<F>;
  const ShadingQueue& queue = wave.shading;
  const PathPool& pool = wave.pool;
  VertexAovs<F> aovs = wave.aovs.template wanted<F>(depth);
  using V = Vertex<F, kFeatures>;
  const bool wants_aovs = V::has(kRecordsAovs) && wave.aovs.wants_vertex(depth);
  const PathEvents events = wave.events(context);
  const bool links = V::has(kLinks) && context.links();
  for (size_t i = begin; i < end; i += kWidth<F>) {
    const RecordPacket<F> packet(queue, i, end);
    const Mask<F>& active = packet.active;
    const auto& r = packet.record;
    const U slot = r.slot, material = packet.material;
    MeshHit<F> hit{r.inst, r.mesh, r.prim, r.u, r.v};
    if (V::has(kMotion) && context.scene.has_motion) [[unlikely]]
      hit.time = gather_field<F>(pool.cold, &PathColdRow<float>::time, slot, active);
    const auto path = load_row<PathRow, F>(pool.paths, slot, active);
    const F t = r.t;
    PathState<F> state = load_state<F, kFeatures>(pool, context, path, r, depth, active);
    typename Joint::template Coupling<F> joint(context.joint, wave.joint);
    joint.load(slot, depth, settings.max_depth, active, state);
    const V vertex{context.scene,
                   settings,
                   path.key,
                   depth,
                   hit,
                   r.geom,
                   t,
                   material,
                   state,
                   wants_aovs ? &aovs : nullptr,
                   active,
                   context.guide};
    const VertexResult<F> v = shade_one<Bsdf, Joint>(vertex, joint);
    joint.store(slot, v.next, v.alive, wave.aovs, active);

    const ShadedVertex<F> shaded{.path = state, .t = t, .material = material, .result = v};
    const U group =
        events.vertex<V::has(kRecordsAovs), F>({depth, slot, path.key, shaded, aovs}, active);
    packet.store(queue, v.alive, v.next.dir, v.has_shadow, v.shadow_d);
    store_rays<Bsdf, F, kFeatures>(pool, v, path.key, slot, group);
    if (V::has(kNestedMedia) && pool.medium_stacks) [[unlikely]]
      scatter_field<F>(pool.medium_stacks, &MediumStackRow<float>::crossed, slot, v.crossed,
                       active);
    if (links) scatter_field<F>(pool.cold, &PathColdRow<float>::link, slot, v.next.link, v.alive);
    ++wave.counts.packets;
    wave.counts.packet_lanes += kWidth<F>;
  }
}

}  // namespace wavecomb
