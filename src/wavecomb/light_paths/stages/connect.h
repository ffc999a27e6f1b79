// SPDX-License-Identifier: Apache-2.0
/// Wave stage 4b, which connects camera paths to light paths in the same slots. The stage shades
/// the stored vertices of the light paths and adds the contributions of unoccluded connections to
/// the camera paths.
#pragma once

#include "wavecomb/light_paths/light_path.h"
#include "wavecomb/light_paths/stages/light_kernels.h"
#include "wavecomb/wave/stages/order.h"
#include "wavecomb/wave/stages/shade.h"
#include "wavecomb/wave/stages/trace.h"

namespace wavecomb {

/// Fills the shading queue with the light path vertices to which the last shaded camera path
/// vertices connect, grouped by shading program.
template <typename F>
void collect_connections(Wave& wave, const WaveContext& context, uint32_t depth) {
  using U = UInt<F>;
  using Q = ShadingQueue;
  const LightVertices& vertices = wave.joint.vertices;
  ShadingQueue& queue = wave.shading;
  const size_t shaded = queue.size;
  queue.clear();
  size_t n = 0;
  // Overwrite the queue in place, which is safe because each entry is read before it is written.
  for (size_t i = 0; i < shaded; i += kWidth<F>) {
    Mask<F> active = first_lanes<F>(shaded - i);
    const U slot = load<U>(queue.slot + i);
    const auto offer = load_row<ConnectionRow, F>(vertices.connections, slot, active);
    active = active & (max_component(offer.light) > 0.f);
    if (none(active)) continue;
    const auto chosen = load_row<LightVertexRow, F>(vertices.chosen, slot, active);
    const Mask<U> on(active);
    const U program = gather<U>(context.scene.material_variant, chosen.material, on);
    compress_store<U>(queue.slot + n, slot, on);
    compress_store<U>(queue.uints(Q::kMaterial) + n, chosen.material, on);
    compress_store<U>(queue.uints(Q::kProgram) + n, program, on);
    n += compress_row<ShadingRecord, F>(
        queue.row(n), load_row<ShadingRecord, F>(vertices.records, slot, active), active);
  }
  queue.size = n;
  for (size_t i = 0; i < n; ++i) wave.sorter.keys()[i] = queue.uints(Q::kProgram)[i];
  queue.ordered = n > 1 && wave.sorter.sort(n, queue.sorted_indices);
  wave.counts.add_records(depth, n);
}

/// Connects the shaded vertices of camera paths at `depth`. The list of the camera paths' next rays
/// does not change.
template <typename F>
void connect(Wave& wave, const WaveContext& context, uint32_t depth) {
  using U = UInt<F>;
  wave.clock.enter(Phase::kShade);
  collect_connections<F>(wave, context, depth);
  if (wave.shading.size == 0) return;
  wave.joint.use = LightVertexUse::kConnect;
  shade<F>(wave, context, light_shade_settings(*context.settings), depth, kShadeLightBatch);
  wave.joint.use = LightVertexUse::kToCamera;
  compact_shadows<F>(wave);
  const ShadowQueue& q = wave.shadows;
  if (q.size == 0) return;
  wave.clock.enter(Phase::kShadow);
  fetch_shadows<F>(wave);
  occlude<F>(wave, context, depth, context.scene.lights.links.members != nullptr);
  const PathEvents events = wave.events(context);
  for (size_t i = 0; i < q.size; i += kWidth<F>) {
    const Mask<F> active = first_lanes<F>(q.size - i) & Mask<F>(load<U>(q.occluded + i) == U(0u));
    const U slot = load<U>(q.slot + i);
    const Color<F> c{load<F>(q.r + i), load<F>(q.g + i), load<F>(q.b + i)};
    const auto light = [&] {
      return gather_field<F>(wave.joint.vertices.paths, &LightPathRow<float>::light, slot, active);
    };
    events.light<Technique::kConnection, F>({depth, slot, c}, light, active);
    wave.joint.aovs.connect<F>(wave.aovs.expressions(), slot, c, active);
  }
}

}  // namespace wavecomb
