// SPDX-License-Identifier: Apache-2.0
/// Emission and opacity of materials at hits. Traversal and light sampling call these functions.
/// Shading evaluates emission in material/params.h instead, from the same inputs and graphs.
///
/// Graphs override textures, and textures override constants, for each component.
#pragma once

#include "wavecomb/graph/parameters/value.h"
#include "wavecomb/material/inputs/inputs.h"

namespace wavecomb {

namespace detail {

/// Makes the inputs of a value graph at a point where only the texture coordinates are known.
template <typename F>
struct UvOnly {
  const Vec2<F>& uv;
  const Footprint<F>& footprint;
  GraphPoint<F> operator()(const Mask<F>& /*active*/) const {
    GraphPoint<F> at;
    at.uv = uv;
    at.footprint = footprint;
    return at;
  }
};

}  // namespace detail

/// Returns the radiance that the surface emits at `uv`, regardless of its presence. `footprint` is
/// the ray's footprint in uv space. `make_point(active)` returns the inputs of the graph, and is
/// called only if there is a graph.
template <typename F, typename MakePoint>
inline Color<F> fetch_emission(const MaterialView& view, const UInt<F>& material, const Vec2<F>& uv,
                               const Footprint<F>& footprint, const MakePoint& make_point,
                               const Mask<F>& active) {
  const detail::InputReader<F> inputs(view, material, uv, footprint, active);
  const Vec3<F> constant = inputs.record[&MaterialRecord::emission];
  const Color<F> plain = detail::valid_emission(inputs.value(Input::kEmission, constant));
  const UInt<F> graph = inputs.record[&MaterialRecord::emission_graph];
  const Mask<F> driven = active & Mask<F>(graph != UInt<F>(kNoGraph));
  if (none(driven)) return plain;
  return graph_value<F>(view, graph, kEmissionOutput, make_point(driven), driven, plain);
}
/// Overload for graphs that read only texture coordinates.
template <typename F>
inline Color<F> fetch_emission(const MaterialView& view, const UInt<F>& material, const Vec2<F>& uv,
                               const Footprint<F>& footprint, const Mask<F>& active) {
  return fetch_emission<F>(view, material, uv, footprint, detail::UvOnly<F>{uv, footprint}, active);
}

namespace detail {

/// Returns the opacity that `inputs` and the material's graph give.
template <typename F, typename MakePoint>
inline F read_opacity(const InputReader<F>& inputs, const MakePoint& make_point) {
  const F opacity =
      saturate(inputs.value(Input::kOpacity, inputs.record[&MaterialRecord::opacity]));
  const UInt<F> graph = inputs.record[&MaterialRecord::opacity_graph];
  const Mask<F> driven = inputs.active & Mask<F>(graph != UInt<F>(kNoGraph));
  if (none(driven)) return opacity;
  const Vec3<F> plain(opacity);
  return graph_value<F>(inputs.view, graph, kOpacityOutput, make_point(driven), driven, plain).x;
}

}  // namespace detail

/// Returns the opacity of the material at `uv`, from 0 to 1, regardless of its meaning.
/// `make_point(active)` returns the inputs of the graph, and is called only if there is a graph.
template <typename F, typename MakePoint>
inline F material_opacity(const MaterialView& view, const UInt<F>& material, const Vec2<F>& uv,
                          const Footprint<F>& footprint, const MakePoint& make_point,
                          const Mask<F>& active) {
  const detail::InputReader<F> inputs(view, material, uv, footprint, active);
  return detail::read_opacity<F>(inputs, make_point);
}

/// Returns the presence of the surface at `uv`, the probability that a ray hits it. With an opacity
/// threshold, presence is 0 or 1. If opacity means transparency, presence is 1 and the shading
/// program handles the transparency. `make_point(active)` returns the inputs of the graph, and is
/// called only if there is a graph.
template <typename F, typename MakePoint>
inline F fetch_opacity(const MaterialView& view, const UInt<F>& material, const Vec2<F>& uv,
                       const Footprint<F>& footprint, const MakePoint& make_point,
                       const Mask<F>& active) {
  const detail::InputReader<F> inputs(view, material, uv, footprint, active);
  const F opacity = detail::read_opacity<F>(inputs, make_point);
  const F threshold = inputs.record[&MaterialRecord::opacity_threshold];
  const F cut = select(opacity < threshold, F(0.f), F(1.f));
  const F present = select(threshold > 0.f, cut, opacity);
  return select(detail::opacity_is_presence(inputs, threshold), present, F(1.f));
}
/// Overload for graphs that read only texture coordinates.
template <typename F>
inline F fetch_opacity(const MaterialView& view, const UInt<F>& material, const Vec2<F>& uv,
                       const Footprint<F>& footprint, const Mask<F>& active) {
  return fetch_opacity<F>(view, material, uv, footprint, detail::UvOnly<F>{uv, footprint}, active);
}

}  // namespace wavecomb
