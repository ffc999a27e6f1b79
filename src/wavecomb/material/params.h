// SPDX-License-Identifier: Apache-2.0
/// Reads the parameters of materials at hits: constants from records, textures, or value graphs.
#pragma once

#include <cstddef>
#include <cstring>

#include "wavecomb/core/math.h"
#include "wavecomb/material/bsdf.h"
#include "wavecomb/material/graph.h"
#include "wavecomb/texture/lookup.h"

namespace wavecomb {

/// Index of refraction is kept within [1 / kMaxIor, kMaxIor].
inline constexpr float kMaxIor = 10.f;
/// Radiance is kept below this, so that no product of a path overflows.
inline constexpr float kMaxEmission = 1e18f;

namespace detail {

/// Words of a record, by lane: one scalar load when all active lanes share the record, else
/// gathers.
template <typename F>
struct RecordReader {
  const void* base;
  UInt<F> first_word;
  const std::byte* shared;  ///< the record of all active lanes, or null
  Mask<F> active;

  F real(size_t offset_bytes) const { return word<F, float>(offset_bytes); }
  UInt<F> bits(size_t offset_bytes) const { return word<UInt<F>, uint32_t>(offset_bytes); }
  Vec3<F> vec3(size_t offset_bytes) const {
    return {real(offset_bytes), real(offset_bytes + 4), real(offset_bytes + 8)};
  }

 private:
  template <typename T, typename Scalar>
  T word(size_t offset_bytes) const {
    if (shared) {
      Scalar value;
      std::memcpy(&value, shared + offset_bytes, sizeof(value));
      return T(value);
    }
    if constexpr (kIsScalar<F>)
      return T(0);  // not active: a lane alone shares its record with itself
    else
      return gather<T>(base, first_word + static_cast<uint32_t>(offset_bytes / 4), Mask<T>(active));
  }
};

/// Reader of record `index` of the array at `base`, for lanes whose indices are all `uniform` or
/// not.
template <typename Record, typename F>
inline RecordReader<F> make_reader(const Record* base, const UInt<F>& index, bool uniform,
                                   const Mask<F>& active) {
  constexpr uint32_t kWords = sizeof(Record) / 4;
  const std::byte* shared = nullptr;
  if (uniform) shared = reinterpret_cast<const std::byte*>(base + first_active(index, active));
  return {base, index * kWords, shared, active};
}

/// What a slot's texture gives: texel * scale + bias of the chosen channels.
template <typename F>
inline Vec3<F> read_texture(const MaterialView& view, const RecordReader<F>& use, const Vec2<F>& uv,
                            const F& uv_width, const Mask<F>& active) {
  using R = TextureUseRecord;
  F m[6];
  for (size_t i = 0; i < 6; ++i) m[i] = use.real(offsetof(R, uv) + 4 * i);
  const F s = fma(m[0], uv.x, fma(m[1], uv.y, m[2]));
  const F t = fma(m[3], uv.x, fma(m[4], uv.y, m[5]));
  // The footprint grows as the longer image of the two axes.
  const F stretch = sqrt(max(fma(m[0], m[0], F(m[3] * m[3])), fma(m[1], m[1], F(m[4] * m[4]))));
  const F width = uv_width * stretch;
  const UInt<F> id = use.bits(offsetof(R, texture));
  const Texel<F> texel =
      use.shared ? lookup<F>(view.textures[first_active(id, active)], s, t, width, active)
                 : lookup<F>(view.textures, id, s, t, width, active);
  const auto channel = [&](const F& value, size_t i) {
    return fma(value, use.real(offsetof(R, scale) + 4 * i), use.real(offsetof(R, bias) + 4 * i));
  };
  const F c[4] = {channel(texel.r, 0), channel(texel.g, 1), channel(texel.b, 2),
                  channel(texel.a, 3)};
  const UInt<F> which = use.bits(offsetof(R, channel));
  F one = c[0];
  for (uint32_t i = 1; i < 4; ++i) one = select(Mask<F>(which == UInt<F>(i)), c[i], one);
  const Mask<F> rgb = Mask<F>(which >= UInt<F>(4u));
  return {select(rgb, c[0], one), select(rgb, c[1], one), select(rgb, c[2], one)};
}

/// Values of slots at a hit.
template <typename F>
struct SlotReader {
  const MaterialView& view;
  const UInt<F>& material;
  const Vec2<F>& uv;
  const F& uv_width;
  Mask<F> active;
  bool uniform;
  RecordReader<F> record;
  UInt<F> texture_slots;

  SlotReader(const MaterialView& view_, const UInt<F>& material_, const Vec2<F>& uv_,
             const F& uv_width_, const Mask<F>& active_)
      : view(view_),
        material(material_),
        uv(uv_),
        uv_width(uv_width_),
        active(active_),
        uniform(any(active_) && is_uniform<F>(material_, active_)),
        record(make_reader<MaterialRecord, F>(view_.materials, material_, uniform, active_)),
        texture_slots(record.bits(offsetof(MaterialRecord, texture_slots))) {}

  /// The value of slot `s`: `constant`, or the texture's in the lanes that have one.
  Vec3<F> value(Slot s, const Vec3<F>& constant) const {
    const uint32_t bit = slot_bit(s);
    const Mask<F> textured = Mask<F>((texture_slots & UInt<F>(bit)) != UInt<F>(0u)) & active;
    if (none(textured)) return constant;
    const UInt<F> index = material * kSlotCount + static_cast<uint32_t>(s);
    const auto use = make_reader<TextureUseRecord, F>(view.uses, index, uniform, textured);
    return select<F>(textured, read_texture<F>(view, use, uv, uv_width, textured), constant);
  }
  F value(Slot s, const F& constant) const { return value(s, Vec3<F>(constant)).x; }
};

template <typename F>
inline F saturate(const F& x) {
  return min(max(x, F(0.f)), F(1.f));  // NaN gives 0
}
template <typename F>
inline Color<F> saturate(const Color<F>& c) {
  return {saturate(c.x), saturate(c.y), saturate(c.z)};
}

template <typename F>
inline Color<F> sane_emission(const Color<F>& c) {
  return {min(max(c.x, F(0.f)), F(kMaxEmission)), min(max(c.y, F(0.f)), F(kMaxEmission)),
          min(max(c.z, F(0.f)), F(kMaxEmission))};
}

/// Lanes whose opacity is presence: it says how much of the surface is there, not how it transmits.
template <typename F>
inline Mask<F> opacity_is_presence(const SlotReader<F>& slots, const F& threshold) {
  const UInt<F> flags = slots.record.bits(offsetof(MaterialRecord, flags));
  return Mask<F>((flags & UInt<F>(uint32_t{kPresence})) != UInt<F>(0u)) | (threshold > 0.f);
}

template <uint32_t kSlots, typename F>
WAVECOMB_INLINE ShadingParams<F> evaluate_params(const MaterialView& view, const UInt<F>& material,
                                                 const Vec2<F>& uv, const F& uv_width,
                                                 const Mask<F>& active) {
  using R = MaterialRecord;
  const SlotReader<F> slots(view, material, uv, uv_width, active);
  const auto& r = slots.record;
  const auto color = [&](Slot s, size_t offset) {
    const Vec3<F> constant = r.vec3(offset);
    return (kSlots & slot_bit(s)) ? slots.value(s, constant) : constant;
  };
  const auto real = [&](Slot s, size_t offset) {
    const F constant = r.real(offset);
    return saturate((kSlots & slot_bit(s)) ? slots.value(s, constant) : constant);
  };
  ShadingParams<F> p;
  p.base_color = saturate(color(Slot::kBaseColor, offsetof(R, base_color)));
  p.specular_color = saturate(color(Slot::kSpecularColor, offsetof(R, specular_color)));
  p.emission = sane_emission(color(Slot::kEmission, offsetof(R, emission)));
  p.roughness = real(Slot::kRoughness, offsetof(R, roughness));
  p.metallic = real(Slot::kMetallic, offsetof(R, metallic));
  p.clearcoat = real(Slot::kClearcoat, offsetof(R, clearcoat));
  p.clearcoat_roughness = real(Slot::kClearcoatRoughness, offsetof(R, clearcoat_roughness));
  p.opacity = real(Slot::kOpacity, offsetof(R, opacity));
  const F threshold = r.real(offsetof(R, opacity_threshold));
  p.opacity = select(opacity_is_presence(slots, threshold), F(1.f), p.opacity);
  p.normal = sane_normal(color(Slot::kNormal, offsetof(R, normal)));
  p.ior = clamp(r.real(offsetof(R, ior)), F(1.f / kMaxIor), F(kMaxIor));
  p.conductor_eta = max(r.vec3(offsetof(R, conductor_eta)), Color<F>(F(0.f)));
  p.conductor_k = max(r.vec3(offsetof(R, conductor_k)), Color<F>(F(0.f)));
  p.flags = r.bits(offsetof(R, flags));
  return p;
}

/// What graphs are given where there is nothing but texture coordinates.
template <typename F>
struct UvOnly {
  const Vec2<F>& uv;
  const F& uv_width;
  GraphPoint<F> operator()(const Mask<F>& /*active*/) const {
    GraphPoint<F> at;
    at.uv = uv;
    at.uv_width = uv_width;
    return at;
  }
};

/// Puts what graphs drive in the place of the parameters in `p`, and evaluates dear materials as
/// often as they say: a packet as often as its dearest lane, with the values of one evaluation; the
/// compiler is kept from seeing that.
template <uint32_t kSlots, typename F, typename Params>
[[gnu::noinline]] void evaluate_more(const MaterialView& view, const UInt<F>& material,
                                     const GraphPoint<F>& point, const Mask<F>& active, Params& p) {
  const UInt<F> more = p.flags >> kEvaluationsShift;
  const Mask<F> driven = active & Mask<F>((p.flags & UInt<F>(uint32_t{kHasGraph})) != UInt<F>(0u));
  const Mask<UInt<F>> on(active);
  GraphPoint<F> at = point;
  for (uint32_t done = 0; any(Mask<F>(on & (more > UInt<F>(done)))); ++done) {
    asm volatile("" : : "r"(&at) : "memory");
    Params again = p;
    static_cast<ShadingParams<F>&>(again) =
        evaluate_params<kSlots, F>(view, material, at.uv, at.uv_width, active);
    if (any(driven)) drive_parameters<F>(view, material, at, driven, again);
    asm volatile("" : : "r"(&again) : "memory");
  }
  if (any(driven)) drive_parameters<F>(view, material, at, driven, p);
}

}  // namespace detail

/// Parameters `p` of material `material` with what graphs drive in its place: what
/// evaluate_params leaves to do. `make_point(active)` gives the GraphPoint and is called only where
/// there is a graph.
template <uint32_t kSlots, typename F, typename Params, typename MakePoint>
WAVECOMB_INLINE void complete_params(const MaterialView& view, const UInt<F>& material,
                                     const MakePoint& make_point, const Mask<F>& active,
                                     Params& p) {
  const UInt<F> more = p.flags & UInt<F>(kMoreToEvaluate);
  if (any(active & Mask<F>(more != UInt<F>(0u)))) [[unlikely]] {
    // Copies, so that what all other materials use may stay in registers.
    const MaterialView v = view;
    const UInt<F> m = material;
    const Mask<F> on = active;
    const GraphPoint<F> at = make_point(on);
    Params copy = p;
    detail::evaluate_more<kSlots, F>(v, m, at, on, copy);
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
  complete_params<kSlots, F>(view, material, make_point, active, p);
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

/// Radiance that the surface emits at `uv`.
template <typename F>
inline Color<F> fetch_emission(const MaterialView& view, const UInt<F>& material, const Vec2<F>& uv,
                               const F& uv_width, const Mask<F>& active) {
  const detail::SlotReader<F> slots(view, material, uv, uv_width, active);
  const Vec3<F> constant = slots.record.vec3(offsetof(MaterialRecord, emission));
  const Color<F> plain = detail::sane_emission(slots.value(Slot::kEmission, constant));
  const UInt<F> graph = slots.record.bits(offsetof(MaterialRecord, emission_graph));
  if (none(active & Mask<F>(graph != UInt<F>(kNoGraph)))) return plain;
  const GraphPoint<F> at = detail::UvOnly<F>{uv, uv_width}(active);
  return graph_value<F>(view, graph, kEmissionOutput, at, active, plain);
}

/// How much of the surface is there at `uv`: the probability that a ray meets it. It is 0 or 1 with
/// an opacity threshold, and 1 for materials whose opacity is transparency (the program transmits
/// then).
template <typename F>
inline F fetch_opacity(const MaterialView& view, const UInt<F>& material, const Vec2<F>& uv,
                       const F& uv_width, const Mask<F>& active) {
  using R = MaterialRecord;
  const detail::SlotReader<F> slots(view, material, uv, uv_width, active);
  F opacity =
      detail::saturate(slots.value(Slot::kOpacity, slots.record.real(offsetof(R, opacity))));
  const UInt<F> graph = slots.record.bits(offsetof(R, opacity_graph));
  if (any(active & Mask<F>(graph != UInt<F>(kNoGraph)))) {
    const GraphPoint<F> at = detail::UvOnly<F>{uv, uv_width}(active);
    opacity = graph_value<F>(view, graph, kOpacityOutput, at, active, Vec3<F>(opacity)).x;
  }
  const F threshold = slots.record.real(offsetof(R, opacity_threshold));
  const F cut = select(opacity < threshold, F(0.f), F(1.f));
  const F present = select(threshold > 0.f, cut, opacity);
  return select(detail::opacity_is_presence(slots, threshold), present, F(1.f));
}

}  // namespace wavecomb
