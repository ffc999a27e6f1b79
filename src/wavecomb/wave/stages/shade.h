// SPDX-License-Identifier: Apache-2.0
/// Wave stage 3c: shades the queue batch by batch, in packets.
#pragma once

#include "wavecomb/path/media.h"
#include "wavecomb/wave/kernels/program_dispatch.h"
#include "wavecomb/wave/wave.h"

namespace wavecomb {

/// Maximum number of records in a batch. With this size, the columns of a batch fit into the L1
/// cache. Time is measured once per batch.
inline constexpr size_t kMaxBatch = 256;

/// Returns the end of the batch that starts at `begin`. All records of a batch have the same
/// program.
template <typename F>
size_t batch_end(const ShadingQueue& queue, size_t begin) {
  using U = UInt<F>;
  const uint32_t* program = queue.uints(ShadingQueue::kProgram);
  const size_t limit = std::min(queue.size, begin + kMaxBatch);
  const U first(program[queue.ordered ? queue.sorted_indices[begin] : begin]);
  for (size_t i = begin; i < limit; i += kWidth<F>) {
    const Mask<U> active(first_lanes<F>(limit - i));
    const U here = queue.ordered ? gather<U>(program, load<U>(queue.sorted_indices + i), active)
                                 : load<U>(program + i);
    const uint32_t other = lane_bits<F>(Mask<F>(here != first) & Mask<F>(active));
    if (other != 0) return i + static_cast<size_t>(std::countr_zero(other));
  }
  return limit;
}

/// Returns the column index of the record at position `i` of the shading order.
inline size_t record_index(const ShadingQueue& queue, size_t i) {
  return queue.ordered ? queue.sorted_indices[i] : i;
}

/// Adds the time of a batch to the measured costs of the materials of its records.
inline void charge_batch(Wave& wave, size_t begin, size_t end,
                         PhaseClock::Clock::time_point start) {
  const double ns =
      std::chrono::duration<double, std::nano>(PhaseClock::Clock::now() - start).count();
  const ShadingQueue& queue = wave.shading;
  const uint32_t* material = queue.uints(ShadingQueue::kMaterial);
  std::array<uint32_t, kMaxBatch> materials;
  for (size_t i = begin; i < end; ++i) materials[i - begin] = material[record_index(queue, i)];
  wave.costs.charge({materials.data(), end - begin}, ns);
}

/// Adds costs to the paths of a batch for the cost AOV: either the measured time of the batch or
/// the modelled costs of its materials.
inline void spread_batch(Wave& wave, const WaveContext& context, size_t begin, size_t end,
                         PhaseClock::Clock::time_point start) {
  const ShadingQueue& queue = wave.shading;
  const auto slot = [&](size_t i) {
    return queue.slot[queue.ordered || queue.moved ? queue.sorted_indices[begin + i] : begin + i];
  };
  wave.aovs.spread_time(end - begin, start, slot);
  const uint32_t* material = queue.uints(ShadingQueue::kMaterial);
  for (size_t i = 0; wave.aovs.models_cost() && i < end - begin; ++i)
    wave.aovs.add_cost(slot(i),
                       context.roulette_costs->material(material[record_index(queue, begin + i)]));
}

/// Returns whether the plain kernels support all features that the scene and the settings use.
inline bool is_plain(const WaveContext& context, const ShadeSettings& settings) {
  const SceneView& scene = context.scene;
  return !context.joint.is_active() && !scene.has_motion && !scene.has_curves && !context.links() &&
         !scene.mesh_lights && !scene.lights.has_effects && !settings.cosine_sampling &&
         !settings.schlick_fresnel;
}

/// Returns the shading kernels, indexed by variant.
template <typename F, typename Media>
const detail::BatchKernels<F>& kernels_for(const WaveContext& context,
                                           const ShadeSettings& settings) {
  if constexpr (kHasPlain<F> && !Media::kAny)
    if (is_plain(context, settings)) return kShadePlain<F>;
  return kShadeBatch<F, typename Media::template Programs<F>>;
}

/// Shades the whole queue with `kernels`, batch by batch.
template <typename F>
void shade(Wave& wave, const WaveContext& context, const ShadeSettings& settings, uint32_t depth,
           const detail::BatchKernels<F>& kernels) {
  const ShadingQueue& queue = wave.shading;
  wave.costs.count({queue.uints(ShadingQueue::kMaterial), queue.size});
  for (size_t begin = 0; begin < queue.size;) {
    const size_t end = batch_end<F>(queue, begin);
    const uint32_t program = queue.uints(ShadingQueue::kProgram)[record_index(queue, begin)];
    const bool timed = context.measures_costs && wave.costs.wants(end - begin);
    PhaseClock::Clock::time_point start;
    if (timed || wave.aovs.wants_time()) start = PhaseClock::Clock::now();
    kernels[program](wave, context, settings, depth, begin, end);
    if (timed) charge_batch(wave, begin, end, start);
    if (wave.aovs.wants_cost()) spread_batch(wave, context, begin, end, start);
    begin = end;
  }
}

/// From the packet of records that starts at index `i`, appends the rays of the records with
/// outcome `what` to `list`. `n` is the number of rays in `list`.
template <typename F, typename List>
WAVECOMB_INLINE void list_rays(const ShadingQueue& queue, size_t i, List& list, size_t& n,
                               ShadingQueue::Outcome what, uint32_t shift) {
  using U = UInt<F>;
  const Mask<U> active(first_lanes<F>(queue.size - i));
  const U outcome = load<U>(queue.outcome + i), slot = load<U>(queue.slot + i);
  const Mask<U> wanted = active & Mask<U>((outcome & uint32_t{what}) != U(0u));
  compress_store<U>(list.direction + n, (outcome >> shift) & (kDirectionKeys - 1), wanted);
  n += compress_store<U>(list.slot + n, slot, wanted);
}

/// Lists the shadow rays only, in arrival order.
template <typename F>
void compact_shadows(Wave& wave) {
  size_t shadows = 0;
  for (size_t i = 0; i < wave.shading.size; i += kWidth<F>)
    list_rays<F>(wave.shading, i, wave.shadows, shadows, ShadingQueue::kShadowRay,
                 ShadingQueue::kShadowKeyShift);
  wave.shadows.size = shadows;
}

/// Lists the rays of continuing paths and the shadow rays, both in arrival order.
template <typename F>
void compact(Wave& wave) {
  const ShadingQueue& queue = wave.shading;
  size_t rays = 0, shadows = 0;
  for (size_t i = 0; i < queue.size; i += kWidth<F>) {
    list_rays<F>(queue, i, wave.rays, rays, ShadingQueue::kAlive, ShadingQueue::kRayKeyShift);
    list_rays<F>(queue, i, wave.shadows, shadows, ShadingQueue::kShadowRay,
                 ShadingQueue::kShadowKeyShift);
  }
  wave.rays.size = rays;
  wave.shadows.size = shadows;
}

}  // namespace wavecomb
