// SPDX-License-Identifier: Apache-2.0
/// Evaluation of material parameters that a value graph drives.
#pragma once

#include "wavecomb/graph/parameters/parameters.h"
#include "wavecomb/graph/run.h"
#include "wavecomb/material/description/material.h"

namespace wavecomb {

/// Calls f(program, lanes) once for each distinct program among the active lanes. `graph` holds a
/// program index or kNoGraph in each lane.
template <typename F, typename Function>
inline void for_each_graph(const UInt<F>& graph, const Mask<F>& active, const Function& f) {
  Mask<F> pending = active & Mask<F>(graph != UInt<F>(kNoGraph));
  while (any(pending)) {
    const uint32_t one = detail::first_of<F>(graph, pending);
    const Mask<F> same = pending & Mask<F>(graph == UInt<F>(one));
    f(one, same);
    pending = pending & not_(same);
  }
}

/// Clamps a graph value to the range of parameter component `i`.
template <typename F>
inline F valid_output(uint32_t i, const F& value) {
  return clamp(value, F(kGraphRanges.low[i]), F(kGraphRanges.high[i]));
}

/// Returns the three parameter components that start at index `first`. Components that the lane's
/// graph does not drive keep their value in `plain`.
template <typename F>
[[gnu::noinline]] Vec3<F> graph_value(const MaterialView& view, const UInt<F>& graph,
                                      uint32_t first, const GraphPoint<F>& at,
                                      const Mask<F>& active, const Vec3<F>& plain) {
  F registers[kMaxGraphRegisters], value[3] = {plain.x, plain.y, plain.z};
  for_each_graph<F>(graph, active, [&](uint32_t id, const Mask<F>& same) {
    const GraphProgram& program = view.graphs.programs[id];
    run_graph<F>(view.graphs, program, view.textures, at, same, registers);
    for (uint32_t i = 0; i < program.output_count; ++i) {
      const GraphOutput& output = view.graphs.outputs[program.first_output + i];
      const uint32_t k = output.parameter - first;
      if (k >= 3) continue;
      const F result = graph_output<F>(view.graphs, program, output, registers);
      value[k] = select(same, valid_output<F>(output.parameter, result), value[k]);
    }
  });
  return {value[0], value[1], value[2]};
}

}  // namespace wavecomb
