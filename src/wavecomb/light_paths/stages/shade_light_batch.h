// SPDX-License-Identifier: Apache-2.0
/// Shades a batch of light path vertices of one program, in packets.
#pragma once

#include "wavecomb/light_paths/light_vertex.h"
#include "wavecomb/wave/stages/record_packet.h"

namespace wavecomb {

/// Runs the shading steps of a packet of light path vertices. The function is inlined into the loop
/// of shade_light_batch().
template <typename Bsdf, typename F, uint32_t kFeatures>
WAVECOMB_INLINE LightVertexResult<F> shade_one_of_light(const Vertex<F, kFeatures>& v,
                                                        const LightPathState<F>& from,
                                                        const LightPathSetup& setup,
                                                        const ConnectionTarget<F>* target) {
  if constexpr (kIsScalar<F>)
    return shade_light_vertex<Bsdf, F>(v, from, setup, target);
  else
    return light_path_steps<Bsdf, F>(v, from, setup, target);
}

/// Shades the queued hits [begin, end) of light paths, in the order of the shading queue.
/// LightPathBuffers::use is the purpose of the light paths. For connections to the camera, the
/// fields `group` and `set` of ShadowRow hold the film position (x, y) of the contribution.
template <typename Bsdf, typename F, uint32_t kFeatures>
void shade_light_batch(Wave& wave, const WaveContext& context, const ShadeSettings& settings,
                       uint32_t depth, size_t begin, size_t end) {
  const ShadingQueue& queue = wave.shading;
  using U = UInt<F>;
  const PathPool& pool = wave.pool;
  const CameraSetup& camera = *context.camera;
  LightPathBuffers& light = wave.joint;
  const LightVertices& vertices = light.vertices;
  const bool connects = light.use == LightVertexUse::kConnect;
  const Merger merger{context.joint.grid, &light.splats, context.film};
  const bool merges = context.joint.merges() && !context.joint.aim_samples;
  const LightPathSetup setup{context.joint, camera, merges ? &merger : nullptr};
  VertexAovs<F> aovs;
  aovs.wants_events = light.aovs.wants_events();
  for (size_t i = begin; i < end; i += kWidth<F>) {
    const RecordPacket<F> packet(queue, i, end);
    const Mask<F>& active = packet.active;
    const auto& r = packet.record;
    MeshHit<F> hit{r.inst, r.mesh, r.prim, r.u, r.v};
    if (context.moves()) [[unlikely]]
      hit.time = gather_field<F>(pool.cold, &PathColdRow<float>::time, r.slot, active);
    const auto path =
        load_row<LightPathRow, F>(connects ? vertices.paths : pool.paths, r.slot, active);
    const PathState<F> state = light_path_state<F>(camera, path, r.t, hit.time, active);
    ConnectionTarget<F> target;
    if (connects)
      target = {
          load_row<ConnectionRow, F>(vertices.connections, r.slot, active),
          Mask<F>(load_row<LightVertexRow, F>(vertices.chosen, r.slot, active).depth == U(0u))};
    const Vertex<F, kFeatures> vertex{
        context.scene, settings,     path.key,        depth, hit,
        r.geom,        r.t,          packet.material, state, aovs.wants_events ? &aovs : nullptr,
        active,        context.guide};
    const LightVertexResult<F> out = shade_one_of_light<Bsdf, F>(vertex, path.light_state(), setup,
                                                                 connects ? &target : nullptr);
    const VertexResult<F>& v = out.v;
    if (aovs.wants_events) [[unlikely]] {
      if (connects)
        light.aovs.record_connection<F>(r.slot, aovs.light_scattering, active);
      else
        light.aovs.shade<F>(depth, r.slot, path.key, aovs, active);
    }
    if (light.use == LightVertexUse::kStore) {
      const Mask<F> stored =
          store_light_vertex<F>(vertices, depth, path, r, packet.material, out.p, out.is_candidate);
      if (aovs.wants_events && any(stored)) [[unlikely]]
        light.aovs.mark_stored<F>(r.slot, stored);
    }
    packet.store(queue, v.alive, v.next.dir, v.has_shadow, v.shadow_d);
    if (any(v.has_shadow))
      store_row<ShadowRow, F>(
          pool.shadows, r.slot,
          {v.shadow_o, v.shadow_d, v.shadow_tfar, v.direct, connects ? U(0u) : float_bits<F>(out.x),
           connects ? U(0u) : float_bits<F>(out.y)},
          v.has_shadow);
    if (any(v.alive))
      store_row<LightPathRow, F>(pool.paths, r.slot, light_path_row<F>(v.next, out.next, path.key),
                                 v.alive);
    ++wave.counts.packets;
    wave.counts.packet_lanes += kWidth<F>;
  }
}

}  // namespace wavecomb
