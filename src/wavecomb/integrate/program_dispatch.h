// SPDX-License-Identifier: Apache-2.0
/// The kernels of all programs by the program's id. Each is compiled in a unit of its own
/// (program.lanes.cpp.in); here they are known by name alone.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "wavecomb/integrate/path_state.h"
#include "wavecomb/integrate/wave.h"
#include "wavecomb/material/program_list.h"

namespace wavecomb {

// In stages/shade_batch.h and vertex.h.
template <typename Bsdf, typename F>
void shade_batch(Wave& wave, const WaveContext& context, const ShadeSettings& settings,
                 uint32_t depth, size_t begin, size_t end);
template <typename Bsdf, typename F>
VertexResult<F> shade_vertex(const Vertex<F>& v);

namespace detail {
template <typename F, typename... Bsdf>
constexpr auto batch_kernels(ProgramList<Bsdf...>) {
  std::array<decltype(&shade_batch<DiffuseBsdf<F>, F>), kProgramCount> kernels{};
  ((kernels[id_of<Bsdf, F>()] = &shade_batch<Bsdf, F>), ...);
  return kernels;
}
template <typename F, typename... Bsdf>
constexpr auto vertex_kernels(ProgramList<Bsdf...>) {
  std::array<decltype(&shade_vertex<DiffuseBsdf<F>, F>), kProgramCount> kernels{};
  ((kernels[id_of<Bsdf, F>()] = &shade_vertex<Bsdf, F>), ...);
  return kernels;
}
}  // namespace detail

/// By ProgramId, the kernels of the programs of a list: shade_batch, for the wave, and
/// shade_vertex, for the reference.
template <typename F, typename List>
inline constexpr auto kShadeBatch = detail::batch_kernels<F>(List{});
template <typename F, typename List>
inline constexpr auto kShadeVertex = detail::vertex_kernels<F>(List{});

}  // namespace wavecomb
