// SPDX-License-Identifier: Apache-2.0
/// Evaluation of value graphs at hits. The functions are defined in run.inl.
#pragma once

#include "wavecomb/graph/graph.h"
#include "wavecomb/texture/attribute.h"
#include "wavecomb/texture/lookup.h"

namespace wavecomb {

/// Inputs of value graphs at a hit; see GraphInput for the members. Inputs other than uv and
/// footprint need to be set only if a graph reads them.
template <typename F>
struct GraphPoint {
  Vec2<F> uv{F(0.f), F(0.f)};
  Footprint<F> footprint = F(0.f);  ///< ray footprint in texture coordinates
  Vec3<F> position = Vec3<F>(F(0.f)), local_position = Vec3<F>(F(0.f));
  Vec3<F> normal{F(0.f), F(0.f), F(1.f)}, local_normal{F(0.f), F(0.f), F(1.f)};
  Vec3<F> tangent{F(1.f), F(0.f), F(0.f)};
  F handedness{1.f};  ///< as in Surface
  Vec3<F> view{F(0.f), F(0.f), F(1.f)};
  Vec3<F> normal_x{F(1.f), F(0.f), F(0.f)}, normal_y{F(0.f), F(1.f), F(0.f)},
      normal_z{F(0.f), F(0.f), F(1.f)};
  MeshPosition<F> mesh_position;  ///< position on the mesh where attributes are interpolated
};

/// Runs `program` for all active lanes with the inputs `at`. `registers` has room for
/// kMaxGraphRegisters values and receives the results. The result of a lane does not depend on the
/// inputs of other lanes. `textures` holds the textures of the scene.
template <typename F>
[[gnu::noinline]] void run_graph(const GraphView& view, const GraphProgram& program,
                                 const TextureView* textures, const GraphPoint<F>& at,
                                 const Mask<F>& active, F* registers);

/// Returns the value of an output after a call of run_graph().
template <typename F>
inline F graph_output(const GraphView& view, const GraphProgram& program, const GraphOutput& output,
                      const F* registers) {
  const uint32_t from = output.from;
  return (from & kGraphConstant) != 0
             ? F(view.constants[program.first_constant + (from & (kGraphConstant - 1u))])
             : registers[from];
}

}  // namespace wavecomb
