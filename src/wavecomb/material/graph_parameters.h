// SPDX-License-Identifier: Apache-2.0
/// Overrides material parameters with the outputs of value graphs.
#pragma once

#include <array>

#include "wavecomb/core/rows/fields.h"
#include "wavecomb/graph/parameters/value.h"
#include "wavecomb/material/bsdf.h"

namespace wavecomb {

/// Returns pointers to the components of `p` in the order of kGraphParameters.
template <typename F>
inline std::array<F*, kFirstOpenPbrOutput> parameter_pointers(ShadingParams<F>& p) {
  return {&p.base_color.x,
          &p.base_color.y,
          &p.base_color.z,
          &p.specular_color.x,
          &p.specular_color.y,
          &p.specular_color.z,
          &p.emission.x,
          &p.emission.y,
          &p.emission.z,
          &p.roughness,
          &p.metallic,
          &p.clearcoat,
          &p.clearcoat_roughness,
          &p.opacity,
          &p.normal.x,
          &p.normal.y,
          &p.normal.z,
          &p.ior};
}

namespace detail {

/// Returns `n` as a unit normal in the upper hemisphere, or (0, 0, 1) if it is degenerate.
template <typename F>
inline Vec3<F> valid_normal(const Vec3<F>& n) {
  const Vec3<F> up(n.x, n.y, max(n.z, F(0.01f)));
  const F len2 = length_squared(up);
  const Mask<F> valid = is_finite(len2) & (max(max(abs(n.x), abs(n.y)), n.z) > 1e-6f);
  const F inv = 1.f / sqrt(select(valid, len2, F(1.f)));
  return select<F>(valid, up * inv, Vec3<F>(F(0.f), F(0.f), F(1.f)));
}

/// Runs the graphs of the active lanes, whose materials must all have a graph, and writes the
/// outputs to `p`. Outputs that only "openpbr" reads are skipped. This function is never inlined,
/// so that its registers cost nothing for materials without graphs.
template <typename F, typename Params>
[[gnu::noinline]] void drive_parameters(const MaterialView& view, const UInt<F>& material,
                                        const GraphPoint<F>& at, const Mask<F>& active, Params& p) {
  using U = UInt<F>;
  const U graph = gather_member<F>(view.materials, &MaterialRecord::graph, material, active);
  const auto pointers = parameter_pointers(p);
  const F opacity = p.opacity;
  F registers[kMaxGraphRegisters];
  for_each_graph<F>(graph, active, [&](uint32_t id, const Mask<F>& same) {
    const GraphProgram& program = view.graphs.programs[id];
    run_graph<F>(view.graphs, program, view.textures, at, same, registers);
    bool tilts = false;
    for (uint32_t i = 0; i < program.output_count; ++i) {
      const GraphOutput& output = view.graphs.outputs[program.first_output + i];
      if (output.parameter >= pointers.size()) continue;
      tilts = tilts || output.parameter == kNormalOutput;
      F& to = *pointers[output.parameter];
      const F value = graph_output<F>(view.graphs, program, output, registers);
      to = select(same, valid_output<F>(output.parameter, value), to);
    }
    if (tilts) p.normal = select<F>(same, valid_normal(p.normal), p.normal);
  });
  // Ray traversal has already applied presence, so a surface that was hit is fully opaque.
  const Mask<F> presence = Mask<F>((p.flags & U(uint32_t{kPresence})) != U(0u));
  p.opacity = select(presence, opacity, p.opacity);
}

}  // namespace detail

}  // namespace wavecomb
