// SPDX-License-Identifier: Apache-2.0
/// Tables of the kernels for light paths, by program id. Each kernel is compiled in a separate
/// translation unit (wave/kernels/kernel_matrix.h); this header only declares the kernels.
#pragma once

#include "wavecomb/light_paths/light_path.h"
#include "wavecomb/wave/kernels/program_dispatch.h"

namespace wavecomb {

// The kernels are defined in shade_light_batch.h and light_vertex.h.
template <typename Bsdf, typename F, uint32_t kFeatures>
void shade_light_batch(Wave& wave, const WaveContext& context, const ShadeSettings& settings,
                       uint32_t depth, size_t begin, size_t end);
template <typename Bsdf, typename F, uint32_t kFeatures>
LightVertexResult<F> shade_light_vertex(const Vertex<F, kFeatures>& v,
                                        const LightPathState<F>& from, const LightPathSetup& setup,
                                        const ConnectionTarget<F>* target);

namespace detail {
template <typename F, typename... Bsdf>
constexpr auto light_batch_kernels(ProgramList<Bsdf...>) {
  BatchKernels<F> kernels{};
  ((kernels[id_of<Bsdf, F>()] = &shade_light_batch<Bsdf, F, kEverything>), ...);
  return for_variants(kernels);
}
template <typename F, typename... Bsdf>
constexpr auto light_vertex_kernels(ProgramList<Bsdf...>) {
  std::array<decltype(&shade_light_vertex<DiffuseBsdf<F>, F, kEverything>), kProgramCount>
      kernels{};
  ((kernels[id_of<Bsdf, F>()] = &shade_light_vertex<Bsdf, F, kEverything>), ...);
  return kernels;
}
}  // namespace detail

/// Light path kernels for waves of any lane width, by program variant.
inline constexpr auto kShadeLightBatch =
    detail::light_batch_kernels<LightLanes>(Programs<LightLanes>{});
/// Light path kernels for the reference integrator, by ProgramId.
template <typename F>
inline constexpr auto kShadeLightVertex = detail::light_vertex_kernels<F>(Programs<F>{});

}  // namespace wavecomb
