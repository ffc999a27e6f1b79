// SPDX-License-Identifier: Apache-2.0
/// Runs value graphs at hits. Bodies are in run.inl.
#pragma once

#include "wavecomb/graph/graph.h"
#include "wavecomb/texture/attribute.h"
#include "wavecomb/texture/lookup.h"

namespace wavecomb {

/// What graphs may ask of a hit; fields are those of GraphInput. Only uv and its width are needed
/// where no graph reads more.
template <typename F>
struct GraphPoint {
  Vec2<F> uv{F(0.f), F(0.f)};
  Footprint<F> footprint = F(0.f);  ///< the ray's in uv
  Vec3<F> position = Vec3<F>(F(0.f)), local_position = Vec3<F>(F(0.f));
  Vec3<F> normal{F(0.f), F(0.f), F(1.f)}, local_normal{F(0.f), F(0.f), F(1.f)};
  Vec3<F> tangent{F(1.f), F(0.f), F(0.f)};
  F handedness{1.f};  ///< as in Surface
  Vec3<F> view{F(0.f), F(0.f), F(1.f)};
  Vec3<F> normal_x{F(1.f), F(0.f), F(0.f)}, normal_y{F(0.f), F(1.f), F(0.f)},
      normal_z{F(0.f), F(0.f), F(1.f)};
  MeshPlace<F> place;  ///< where attributes are read
};

/// Runs program `program` at `at`, the same in all active lanes; `registers` holds
/// kMaxGraphRegisters. A lane's results depend on nothing but its own point. Images are read as
/// `textures` have them.
template <typename F>
[[gnu::noinline]] void run_graph(const GraphView& view, const GraphProgram& program,
                                 const TextureView* textures, const GraphPoint<F>& at,
                                 const Mask<F>& active, F* registers);

/// What a program's output is after run_graph.
template <typename F>
inline F graph_output(const GraphView& view, const GraphProgram& program, const GraphOutput& output,
                      const F* registers) {
  const uint32_t from = output.from;
  return (from & kGraphConstant) != 0
             ? F(view.constants[program.first_constant + (from & (kGraphConstant - 1u))])
             : registers[from];
}

}  // namespace wavecomb
