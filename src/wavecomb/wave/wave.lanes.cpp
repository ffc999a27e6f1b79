// SPDX-License-Identifier: Apache-2.0
// This file is compiled once for each lane width, with WAVECOMB_LANES set to the width.
#include <bit>
#include <cstring>

#include "wavecomb/light_paths/stages/run_light_paths.h"
#include "wavecomb/wave/kernels/shared_kernels.h"
#include "wavecomb/wave/run_wave.h"

namespace wavecomb {

WAVECOMB_SHARED_KERNELS(extern, Lanes<WAVECOMB_LANES>);

template <size_t W>
void run_wave(Wave& wave, const WaveContext& context, const WaveTask& task) {
  if (task.joint) return run_light_paths<Lanes<W>>(wave, context, task);
  run_wave_through<Lanes<W>, LightPathJointStages<Lanes<W>>>(wave, context, task, NoMedia());
}

/// Shades the synthetic hits of one material to measure its cost before the first pass. Returns the
/// time in nanoseconds. The film and the statistics do not change.
template <size_t W>
double time_material(Wave& wave, const WaveContext& context, const CalibrationHits& hits) {
  using F = Lanes<W>;
  using Q = ShadingQueue;
  const ShadeSettings settings(*context.settings);
  ShadingQueue& queue = wave.shading;
  queue.clear();
  queue.size = hits.count;
  for (uint32_t i = 0; i < hits.count; ++i) {
    // Directions and positions of the hits come from a low-discrepancy sequence. The path state is
    // typical of paths after one bounce.
    const float a = 0.61803399f * static_cast<float>(i), b = 0.75487767f * static_cast<float>(i);
    const float u = a - std::floor(a), v = b - std::floor(b);
    const Vec3<float> d = square_to_sphere(u, v);
    const CalibrationHit& hit = hits.hits[i % hits.distinct];
    store_row<ShadingRecord, float>(
        queue.row(0), i,
        {0.1f * context.scene.scale, 0.5f * u, 0.5f * v, hit.prim, hit.inst, hit.mesh, hit.geom, i},
        true);
    queue.uints(Q::kMaterial)[i] = hits.material;
    queue.uints(Q::kProgram)[i] = context.traits[hits.material].program;
    queue.slot[i] = i;
    const SampleKey<float> key{i * 0x9e3779b9u, i};
    store_row<PathRow, float>(wave.pool.paths, i,
                              {.o = Vec3<float>(0.f),
                               .d = d,
                               .throughput = Color<float>(0.5f),
                               .pdf = 0.3f,
                               .eta_scale = 1.f,
                               .cone_width = 0.01f * context.scene.scale,
                               .cone_spread = 0.f,
                               .key = key,
                               .receiver = 0u},
                              true);
    store_row<RadianceRow, float>(wave.pool.radiance, i, {}, true);
    if (wave.pool.cold) store_row<PathColdRow, float>(wave.pool.cold, i, {u, 0u, 0.f}, true);
  }
  const auto& kernels = kernels_for<F, NoMedia>(context, settings);
  const auto start = PhaseClock::Clock::now();
  for (size_t begin = 0, batch = 1; begin < queue.size; ++batch) {
    // To simulate partly filled packets, make each batch a single packet.
    const size_t end =
        hits.fill < 1.f
            ? std::min(queue.size,
                       static_cast<size_t>(hits.fill * static_cast<float>(W * batch) + 0.5f))
            : batch_end<F>(queue, begin);
    kernels[context.traits[hits.material].program](wave, context, settings, 1, begin, end);
    begin = end;
  }
  const auto stop = PhaseClock::Clock::now();
  wave.counts = {};
  return std::chrono::duration<double, std::nano>(stop - start).count();
}

template void run_wave<WAVECOMB_LANES>(Wave&, const WaveContext&, const WaveTask&);
template double time_material<WAVECOMB_LANES>(Wave&, const WaveContext&, const CalibrationHits&);

}  // namespace wavecomb
