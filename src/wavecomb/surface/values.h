// SPDX-License-Identifier: Apache-2.0
/// Emission and opacity of materials at hits, the same for all that ask: shading's own emission is
/// read by the same inputs and graphs (material/params.h).
///
/// What a graph drives takes the place of a texture, which takes the place of a constant, component
/// by component.
#pragma once

#include "wavecomb/graph/value.h"
#include "wavecomb/surface/inputs.h"

namespace wavecomb {

namespace detail {

/// What graphs are given where there is nothing but texture coordinates.
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

/// Radiance that the surface emits at `uv`, whether it is there or not. `footprint` is the
/// ray's in uv. Graphs are given what `make_point(active)` says, which is called only where there
/// is one.
template <typename F, typename MakePoint>
inline Color<F> fetch_emission(const MaterialView& view, const UInt<F>& material, const Vec2<F>& uv,
                               const Footprint<F>& footprint, const MakePoint& make_point,
                               const Mask<F>& active) {
  const detail::InputReader<F> inputs(view, material, uv, footprint, active);
  const Vec3<F> constant = inputs.record[&MaterialRecord::emission];
  const Color<F> plain = detail::sane_emission(inputs.value(Input::kEmission, constant));
  const UInt<F> graph = inputs.record[&MaterialRecord::emission_graph];
  const Mask<F> driven = active & Mask<F>(graph != UInt<F>(kNoGraph));
  if (none(driven)) return plain;
  return graph_value<F>(view, graph, kEmissionOutput, make_point(driven), driven, plain);
}
/// The same where graphs have nothing but uv.
template <typename F>
inline Color<F> fetch_emission(const MaterialView& view, const UInt<F>& material, const Vec2<F>& uv,
                               const Footprint<F>& footprint, const Mask<F>& active) {
  return fetch_emission<F>(view, material, uv, footprint, detail::UvOnly<F>{uv, footprint}, active);
}

/// How much of the surface is there at `uv`: the probability that a ray meets it. It is 0 or 1 with
/// an opacity threshold, and 1 for materials whose opacity is transparency (the program transmits
/// then). Graphs as in fetch_emission.
template <typename F, typename MakePoint>
inline F fetch_opacity(const MaterialView& view, const UInt<F>& material, const Vec2<F>& uv,
                       const Footprint<F>& footprint, const MakePoint& make_point,
                       const Mask<F>& active) {
  using R = MaterialRecord;
  const detail::InputReader<F> inputs(view, material, uv, footprint, active);
  F opacity = detail::saturate(inputs.value(Input::kOpacity, inputs.record[&R::opacity]));
  const UInt<F> graph = inputs.record[&R::opacity_graph];
  const Mask<F> driven = active & Mask<F>(graph != UInt<F>(kNoGraph));
  if (any(driven))
    opacity =
        graph_value<F>(view, graph, kOpacityOutput, make_point(driven), driven, Vec3<F>(opacity)).x;
  const F threshold = inputs.record[&R::opacity_threshold];
  const F cut = select(opacity < threshold, F(0.f), F(1.f));
  const F present = select(threshold > 0.f, cut, opacity);
  return select(detail::opacity_is_presence(inputs, threshold), present, F(1.f));
}
/// The same where graphs have nothing but uv.
template <typename F>
inline F fetch_opacity(const MaterialView& view, const UInt<F>& material, const Vec2<F>& uv,
                       const Footprint<F>& footprint, const Mask<F>& active) {
  return fetch_opacity<F>(view, material, uv, footprint, detail::UvOnly<F>{uv, footprint}, active);
}

}  // namespace wavecomb
