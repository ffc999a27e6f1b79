// SPDX-License-Identifier: Apache-2.0
/// Evaluates material parameters at hits, from constants in records, textures or value graphs.
#pragma once

#include "wavecomb/core/math.h"
#include "wavecomb/material/bsdf.h"
#include "wavecomb/material/graph_parameters.h"
#include "wavecomb/material/inputs/emission_opacity.h"
#include "wavecomb/material/inputs/inputs.h"

namespace wavecomb {

/// Upper limit of the index of refraction; the lower limit is its inverse.
inline constexpr float kMaxIor = 10.f;

/// Returns the lanes whose materials may transmit light straight.
template <typename F>
inline Mask<F> transmits_straight(const UInt<F>& flags) {
  return Mask<F>((flags & UInt<F>(uint32_t{kTransmitsStraight})) != UInt<F>(0u));
}

/// Upper limit of the probability with which rays pass an emissive surface, whose emission is
/// divided by the probability of hitting it.
inline constexpr float kMaxEmissivePassing = 0.75f;

/// Returns the upper limit of the probability with which rays pass surfaces with these flags.
template <typename F>
inline F most_passing(const UInt<F>& flags) {
  const Mask<F> emits((flags & UInt<F>(uint32_t{kEmits})) != UInt<F>(0u));
  return select(emits, F(kMaxEmissivePassing), F(1.f));
}

/// Returns the probability with which ray traversal lets rays pass surfaces that transmit the
/// fraction `straight`: its smallest component, at most `most`. The BSDF transmits the rest.
template <typename F>
inline F passing_probability(const Color<F>& straight, const F& most) {
  return clamp(min(straight.x, min(straight.y, straight.z)), F(0.f), most);
}

namespace detail {

template <uint32_t kInputs, typename F>
WAVECOMB_INLINE ShadingParams<F> evaluate_params(const MaterialView& view, const UInt<F>& material,
                                                 const Vec2<F>& uv, const Footprint<F>& footprint,
                                                 const Mask<F>& active) {
  using R = MaterialRecord;
  const InputReader<F> inputs(view, material, uv, footprint, active);
  const auto& r = inputs.record;
  const auto color = [&](Input s, float (R::*member)[3]) {
    const Vec3<F> constant = r[member];
    return (kInputs & input_bit(s)) ? inputs.value(s, constant) : constant;
  };
  const auto real = [&](Input s, float R::* member) {
    const F constant = r[member];
    return saturate((kInputs & input_bit(s)) ? inputs.value(s, constant) : constant);
  };
  ShadingParams<F> p;
  p.base_color = saturate(color(Input::kBaseColor, &R::base_color));
  p.specular_color = saturate(color(Input::kSpecularColor, &R::specular_color));
  p.emission = valid_emission(color(Input::kEmission, &R::emission));
  p.roughness = real(Input::kRoughness, &R::roughness);
  p.metallic = real(Input::kMetallic, &R::metallic);
  p.clearcoat = real(Input::kClearcoat, &R::clearcoat);
  p.clearcoat_roughness = real(Input::kClearcoatRoughness, &R::clearcoat_roughness);
  p.opacity = real(Input::kOpacity, &R::opacity);
  const F threshold = r[&R::opacity_threshold];
  p.opacity = select(opacity_is_presence(inputs, threshold), F(1.f), p.opacity);
  p.normal = valid_normal(color(Input::kNormal, &R::normal));
  p.ior = clamp(r[&R::ior], F(1.f / kMaxIor), F(kMaxIor));
  p.conductor_eta = max(r[&R::conductor_eta], Color<F>(F(0.f)));
  p.conductor_k = max(r[&R::conductor_k], Color<F>(F(0.f)));
  p.flags = r[&R::flags];
  return p;
}

}  // namespace detail

/// Replaces parameters in `p`, as returned by evaluate_params(), by the outputs of the material's
/// graph. `make_point(active)` returns the GraphPoint and is called only if a lane has a graph.
template <typename F, typename Params, typename MakePoint>
WAVECOMB_INLINE void complete_params(const MaterialView& view, const UInt<F>& material,
                                     const MakePoint& make_point, const Mask<F>& active,
                                     Params& p) {
  const UInt<F> graph = p.flags & UInt<F>(uint32_t{kHasGraph});
  const Mask<F> driven = active & Mask<F>(graph != UInt<F>(0u));
  if (any(driven)) [[unlikely]] {
    // Copy values that graphs read, so that the compiler keeps the originals in registers for
    // materials without graphs.
    const MaterialView v = view;
    const UInt<F> m = material;
    const Mask<F> on = driven;
    const GraphPoint<F> at = make_point(on);
    Params copy = p;
    detail::drive_parameters<F>(v, m, at, on, copy);
    p = copy;
  }
}

/// Evaluates the parameters of `material` at `uv` and clamps them to valid ranges. `kInputs` is a
/// mask of the inputs that may read textures. All other inputs are constants. `footprint` is the
/// ray's footprint in uv. If `kGraphs` is false, value graphs are skipped. Otherwise
/// `make_point(active)` returns the inputs of the graphs. For cut-out materials, the returned
/// `opacity` is 1, because fetch_opacity() computes the presence of the surface. Values of inactive
/// lanes are unspecified but finite.
template <uint32_t kInputs, typename F, bool kGraphs = true, typename MakePoint>
WAVECOMB_INLINE ShadingParams<F> fetch_params(const MaterialView& view, const UInt<F>& material,
                                              const Vec2<F>& uv, const Footprint<F>& footprint,
                                              const MakePoint& make_point, const Mask<F>& active) {
  auto p = detail::evaluate_params<kInputs, F>(view, material, uv, footprint, active);
  if constexpr (kGraphs) complete_params<F>(view, material, make_point, active, p);
  return p;
}
/// Overload for graphs that read only uv.
template <uint32_t kInputs, typename F>
WAVECOMB_INLINE ShadingParams<F> fetch_params(const MaterialView& view, const UInt<F>& material,
                                              const Vec2<F>& uv, const Footprint<F>& footprint,
                                              const Mask<F>& active) {
  return fetch_params<kInputs, F>(view, material, uv, footprint, detail::UvOnly<F>{uv, footprint},
                                  active);
}

namespace detail {
/// Reads the first `kOwn` program-specific parameters. Parameters from `kOwn` on are set to 0.
template <size_t kOwn, typename F>
WAVECOMB_INLINE std::array<F, kMaxProgramParameters> specific_values(const MaterialView& view,
                                                                     const UInt<F>& material,
                                                                     const Mask<F>& active) {
  using R = ProgramParameterRecord;
  const auto r = make_reader<R, F>(view.own, material, active);
  std::array<F, kMaxProgramParameters> own;
  for (size_t i = 0; i < own.size(); ++i) own[i] = i < kOwn ? r.at(&R::value, i) : F(0.f);
  return own;
}

template <typename Bsdf, typename F>
struct ParamsOf {
  using Type = std::conditional_t<(info_of(Bsdf::kProgram).specific_count() > 0),
                                  SpecificShadingParams<F>, ShadingParams<F>>;
};
template <typename Bsdf, typename F>
  requires requires { typename Bsdf::Params; }
struct ParamsOf<Bsdf, F> {
  using Type = typename Bsdf::Params;
};
}  // namespace detail

/// Parameter type of program `Bsdf`.
template <typename Bsdf, typename F>
using ParamsOf = typename detail::ParamsOf<Bsdf, F>::Type;

/// Evaluates the parameters of the program with class `Bsdf`, with the same arguments as
/// fetch_params().
template <typename Bsdf, uint32_t kInputs, typename F, typename MakePoint>
WAVECOMB_INLINE ParamsOf<Bsdf, F> fetch_for(const MaterialView& materials, const UInt<F>& material,
                                            const Vec2<F>& uv, const Footprint<F>& footprint,
                                            const MakePoint& make_point, const Mask<F>& active) {
  constexpr size_t kOwn = info_of(Bsdf::kProgram).specific_count();
  if constexpr (requires { typename Bsdf::Params; }) {
    static_assert(kOwn == 0, "Params::fetch must read the program-specific parameters");
    return Bsdf::Params::template fetch<kInputs, Bsdf::kTextured>(materials, material, uv,
                                                                  footprint, make_point, active);
  } else if constexpr (kOwn == 0) {
    return fetch_params<kInputs, F, Bsdf::kTextured>(materials, material, uv, footprint, make_point,
                                                     active);
  } else {
    SpecificShadingParams<F> p;
    static_cast<ShadingParams<F>&>(p) = fetch_params<kInputs, F, Bsdf::kTextured>(
        materials, material, uv, footprint, make_point, active);
    p.own = detail::specific_values<kOwn, F>(materials, material, active);
    return p;
  }
}

}  // namespace wavecomb
