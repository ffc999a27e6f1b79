// SPDX-License-Identifier: Apache-2.0
/// Reads the parameters of materials at hits: constants from records, textures, or value graphs.
#pragma once

#include "wavecomb/core/math.h"
#include "wavecomb/graph/drive.h"
#include "wavecomb/material/bsdf.h"
#include "wavecomb/surface/slots.h"
#include "wavecomb/surface/values.h"

namespace wavecomb {

/// Index of refraction is kept within [1 / kMaxIor, kMaxIor].
inline constexpr float kMaxIor = 10.f;

namespace detail {

template <uint32_t kSlots, typename F>
WAVECOMB_INLINE ShadingParams<F> evaluate_params(const MaterialView& view, const UInt<F>& material,
                                                 const Vec2<F>& uv, const F& uv_width,
                                                 const Mask<F>& active) {
  using R = MaterialRecord;
  const SlotReader<F> slots(view, material, uv, uv_width, active);
  const auto& r = slots.record;
  const auto color = [&](Slot s, float (R::*member)[3]) {
    const Vec3<F> constant = r[member];
    return (kSlots & slot_bit(s)) ? slots.value(s, constant) : constant;
  };
  const auto real = [&](Slot s, float R::* member) {
    const F constant = r[member];
    return saturate((kSlots & slot_bit(s)) ? slots.value(s, constant) : constant);
  };
  ShadingParams<F> p;
  p.base_color = saturate(color(Slot::kBaseColor, &R::base_color));
  p.specular_color = saturate(color(Slot::kSpecularColor, &R::specular_color));
  p.emission = sane_emission(color(Slot::kEmission, &R::emission));
  p.roughness = real(Slot::kRoughness, &R::roughness);
  p.metallic = real(Slot::kMetallic, &R::metallic);
  p.clearcoat = real(Slot::kClearcoat, &R::clearcoat);
  p.clearcoat_roughness = real(Slot::kClearcoatRoughness, &R::clearcoat_roughness);
  p.opacity = real(Slot::kOpacity, &R::opacity);
  const F threshold = r[&R::opacity_threshold];
  p.opacity = select(opacity_is_presence(slots, threshold), F(1.f), p.opacity);
  p.normal = sane_normal(color(Slot::kNormal, &R::normal));
  p.ior = clamp(r[&R::ior], F(1.f / kMaxIor), F(kMaxIor));
  p.conductor_eta = max(r[&R::conductor_eta], Color<F>(F(0.f)));
  p.conductor_k = max(r[&R::conductor_k], Color<F>(F(0.f)));
  p.flags = r[&R::flags];
  return p;
}

}  // namespace detail

/// Puts what graphs drive in the place of the parameters `p` of material `material`: what
/// evaluate_params leaves to do. `make_point(active)` gives the GraphPoint and is called only where
/// there is a graph.
template <typename F, typename Params, typename MakePoint>
WAVECOMB_INLINE void complete_params(const MaterialView& view, const UInt<F>& material,
                                     const MakePoint& make_point, const Mask<F>& active,
                                     Params& p) {
  const UInt<F> graph = p.flags & UInt<F>(uint32_t{kHasGraph});
  const Mask<F> driven = active & Mask<F>(graph != UInt<F>(0u));
  if (any(driven)) [[unlikely]] {
    // Copies, so that what all other materials use may stay in registers.
    const MaterialView v = view;
    const UInt<F> m = material;
    const Mask<F> on = driven;
    const GraphPoint<F> at = make_point(on);
    Params copy = p;
    detail::drive_parameters<F>(v, m, at, on, copy);
    p = copy;
  }
}

/// The parameters of material `material` at `uv`, in sane ranges. Only slots in `kSlots` read
/// textures; the others give their constants. `uv_width` is the ray's footprint in uv units.
/// `opacity` is 1 where it is presence, which fetch_opacity gives. Inactive lanes hold anything
/// finite. Graphs are given what `make_point` says.
template <uint32_t kSlots, typename F, typename MakePoint>
WAVECOMB_INLINE ShadingParams<F> fetch_params(const MaterialView& view, const UInt<F>& material,
                                              const Vec2<F>& uv, const F& uv_width,
                                              const MakePoint& make_point, const Mask<F>& active) {
  auto p = detail::evaluate_params<kSlots, F>(view, material, uv, uv_width, active);
  complete_params<F>(view, material, make_point, active, p);
  return p;
}
/// The same where graphs have nothing but uv.
template <uint32_t kSlots, typename F>
WAVECOMB_INLINE ShadingParams<F> fetch_params(const MaterialView& view, const UInt<F>& material,
                                              const Vec2<F>& uv, const F& uv_width,
                                              const Mask<F>& active) {
  return fetch_params<kSlots, F>(view, material, uv, uv_width, detail::UvOnly<F>{uv, uv_width},
                                 active);
}

namespace detail {
template <typename Bsdf, typename F>
struct ParamsOf {
  using Type = ShadingParams<F>;
};
template <typename Bsdf, typename F>
  requires requires { typename Bsdf::Params; }
struct ParamsOf<Bsdf, F> {
  using Type = typename Bsdf::Params;
};
}  // namespace detail

/// The parameters that program `Bsdf` takes.
template <typename Bsdf, typename F>
using ParamsOf = typename detail::ParamsOf<Bsdf, F>::Type;

/// fetch_params for program `Bsdf`.
template <typename Bsdf, uint32_t kSlots, typename F, typename MakePoint>
WAVECOMB_INLINE ParamsOf<Bsdf, F> fetch_for(const MaterialView& materials, const UInt<F>& material,
                                            const Vec2<F>& uv, const F& uv_width,
                                            const MakePoint& make_point, const Mask<F>& active) {
  if constexpr (requires { typename Bsdf::Params; })
    return Bsdf::Params::template fetch<kSlots>(materials, material, uv, uv_width, make_point,
                                                active);
  else
    return fetch_params<kSlots, F>(materials, material, uv, uv_width, make_point, active);
}

}  // namespace wavecomb
