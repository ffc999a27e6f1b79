// SPDX-License-Identifier: Apache-2.0
/// Tables of shading kernels, indexed by program id. Each kernel is compiled in a separate unit
/// (kernel_matrix.h); this header only declares the kernels.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "wavecomb/material/program_list.h"
#include "wavecomb/path/path_state.h"
#include "wavecomb/wave/kernels/kernel_matrix.h"
#include "wavecomb/wave/wave.h"

namespace wavecomb {

// The kernels are defined in wave/stages/shade_batch.h and vertex.h.
template <typename Bsdf, typename F, uint32_t kFeatures, typename Joint>
void shade_batch(Wave& wave, const WaveContext& context, const ShadeSettings& settings,
                 uint32_t depth, size_t begin, size_t end);
template <typename Bsdf, typename F, uint32_t kFeatures, typename Joint>
VertexResult<F> shade_vertex(const Vertex<F, kFeatures>& v,
                             typename Joint::template Coupling<F>& joint);

namespace detail {
template <typename F>
using BatchKernels =
    std::array<decltype(&shade_batch<DiffuseBsdf<F>, F, kEverything, JointTransport>),
               kVariantCount>;

/// Copies the kernel of each program to all variants of the program.
template <typename Kernels>
constexpr Kernels for_variants(Kernels kernels) {
  for (uint32_t v = kProgramCount; v < kVariantCount; ++v)
    kernels[v] = kernels[static_cast<size_t>(program_of(v))];
  return kernels;
}
// Programs of volume events have no plain kernels.
template <size_t kVariant>
inline constexpr bool kIsOfSurface =
    static_cast<size_t>(program_of(kVariant)) < kSurfaceProgramCount;
template <size_t kVariant, typename F>
constexpr typename BatchKernels<F>::value_type plain_batch_kernel() {
  if constexpr (kIsOfSurface<kVariant>)
    return &shade_batch<VariantBsdf<kVariant, F>, F, kPlain, NoJointTransport>;
  else
    return nullptr;
}
template <typename Bsdf, typename F>
constexpr typename BatchKernels<F>::value_type general_batch_kernel() {
  constexpr size_t kProgram = id_of<Bsdf, F>();
  if constexpr (kProgram < kSurfaceProgramCount && !has_program_kernels(kProgram, kWidth<F>))
    return &shade_batch<Program<static_cast<ProgramId>(kProgram), float>, float, kEverything,
                        JointTransport>;
  else
    return &shade_batch<Bsdf, F, kEverything, JointTransport>;
}
template <typename F, typename... Bsdf>
constexpr auto batch_kernels(ProgramList<Bsdf...>) {
  BatchKernels<F> kernels{};
  ((kernels[id_of<Bsdf, F>()] = general_batch_kernel<Bsdf, F>()), ...);
  return for_variants(kernels);
}
template <typename F, size_t... kVariant>
constexpr auto plain_batch_kernels(std::index_sequence<kVariant...>) {
  return BatchKernels<F>{plain_batch_kernel<kVariant, F>()...};
}
template <typename F, typename... Bsdf>
constexpr auto vertex_kernels(ProgramList<Bsdf...>) {
  std::array<decltype(&shade_vertex<DiffuseBsdf<F>, F, kEverything, JointTransport>), kProgramCount>
      kernels{};
  ((kernels[id_of<Bsdf, F>()] = &shade_vertex<Bsdf, F, kEverything, JointTransport>), ...);
  return kernels;
}
}  // namespace detail

/// Shading kernels of a list of programs. Waves use `kShadeBatch`, which is indexed by variant and
/// has the same kernel for all variants of a program. The reference integrator uses `kShadeVertex`,
/// which is indexed by ProgramId.
template <typename F, typename List>
inline constexpr auto kShadeBatch = detail::batch_kernels<F>(List{});
template <typename F, typename List>
inline constexpr auto kShadeVertex = detail::vertex_kernels<F>(List{});
/// Plain kernels, indexed by variant. These kernels exist only if kHasPlain is true.
template <typename F>
inline constexpr auto kShadePlain =
    detail::plain_batch_kernels<F>(std::make_index_sequence<kVariantCount>());

}  // namespace wavecomb
