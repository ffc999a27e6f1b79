// SPDX-License-Identifier: Apache-2.0
/// Program "openpbr": OpenPBR Surface 1.1 (Academy Software Foundation, 2024).
#pragma once

#include "wavecomb/material/energy_tables.h"
#include "wavecomb/material/lobes/eon.h"
#include "wavecomb/material/lobes/fuzz.h"
#include "wavecomb/material/lobes/lambert.h"
#include "wavecomb/material/lobes/lobe_choice.h"
#include "wavecomb/material/lobes/microfacet_reflection.h"
#include "wavecomb/material/lobes/openpbr_base.h"
#include "wavecomb/material/lobes/openpbr_coat.h"
#include "wavecomb/material/openpbr_params.h"
#include "wavecomb/material/program_list.h"

namespace wavecomb {

/// OpenPBR BSDF: fuzz on a coat on a base of metal, glossy diffuse and transmission. A layer with
/// directional albedo E towards the viewer scales the layers below by 1 - E (the specification's
/// albedo scaling), so energy is conserved, but the BSDF is not reciprocal. Lobes are sampled in
/// proportion to their estimated contribution; eval and pdf return values of the whole mixture.
///
/// Opaque and thin-walled surfaces are two-sided. Inside a transmissive solid there is no fuzz, and
/// the coat does not reflect. Subsurface scattering is diffuse reflection, or, with random walks,
/// enters through a diffuse lobe to the other side (medium/subsurface/random_walk.h). Ray traversal
/// transmits through smooth thin walls (lobes/straight_transmission.h). A program variant
/// (material/description/variants.h) supports only some features, and equals the complete program
/// bitwise for materials without other features.
template <typename F, uint32_t kParts>
class OpenPbrBsdf : public ViewedBsdf<OpenPbrBsdf<F, kParts>, F> {
  using Viewed = ViewedBsdf<OpenPbrBsdf<F, kParts>, F>;
  static constexpr bool kCoat = (kParts & kCoatPart) != 0, kFuzz = (kParts & kFuzzPart) != 0,
                        kBack = (kParts & kBackDiffusePart) != 0,
                        kTurned = (kParts & kAnisotropyPart) != 0;
  using Base = OpenPbrBase<F, kParts>;

 public:
  static constexpr ProgramId kProgram = ProgramId::kOpenPbr;
  static constexpr bool kReadsIor = true;
  static constexpr bool kEmits = (kParts & kEmissionPart) != 0;
  static constexpr bool kAbsorbs = (kParts & kTransmissionPart) != 0;
  // The same for all variants, because light selection in the light tree depends on this value.
  static constexpr bool kTransmits = true;
  static constexpr bool kTransmitsStraight = Base::kGlass;
  static constexpr bool kHasSubsurface = kBack;
  static constexpr bool kTextured = (kParts & (kTexturePart | kAnisotropyPart)) != 0;
  using Params = OpenPbrParams<F>;
  /// Inputs that may read textures: all or none, since any texture aligns the tangent frame.
  static constexpr uint32_t kInputs = kTextured ? kOpenPbrInputs : 0u;

  OpenPbrBsdf(const Params& p, bool /*schlick: the terms are always exact*/)
      : base_(p), eon_(p.diffuse_roughness), energy_(p.energy), most_(most_passing<F>(p.flags)) {
    if constexpr (kFuzz) {
      fuzz_ = p.fuzz_weight;
      fuzz_roughness_ = p.fuzz_roughness;
      fuzz_color_ = p.fuzz_color;
    }
    if constexpr (kCoat) coat_ = OpenPbrCoat<F>(p);
    // Fraction of subsurface light that leaves on the other side: half of the light for thin walls,
    // adjusted by anisotropy, or all of it if a random walk follows.
    const F sub = p.subsurface_weight;
    Color<F> under = p.subsurface_color;
    back_ = returned_back_ = Color<F>(F(0.f));
    if constexpr (kBack) {
      subsurface_ = p.subsurface > 0.f;
      const F through = select(subsurface_, F(1.f),
                               F(F(0.5f * F(1.f + p.subsurface_anisotropy)) * p.thin_walled));
      under = under * F(1.f - through);
      returned_back_ = p.subsurface_color * F(sub * through);
      const Mask<F> lambertian = p.subsurface == F(static_cast<float>(SubsurfaceKind::kWhole));
      back_ = select<F>(lambertian, Color<F>(sub), returned_back_);
    }
    diffuse_ = lerp(p.base_color, under, sub);
    if constexpr (kTransmitsStraight) clear_ = transmits_straight<F>(p.flags);
    if constexpr (kTurned) turn_ = Turn<F>(p.rotation);
  }

  Color<F> albedo() const {
    const Color<F> c = base_.metal_f0() * base_.metal + (diffuse_ + returned_back_) * base_.opaque +
                       base_.tint * base_.glass +
                       base_.specular_color * F(F(1.f - base_.metal) * base_.glass_f0);
    return min(c, Color<F>(F(1.f)));
  }
  Mask<F> has_non_delta() const {
    Mask<F> any_lobe = ((base_.opaque > 0.f) & not_(is_black(Color<F>(diffuse_ + back_)))) |
                       (not_(base_.smooth) & base_.present);
    if constexpr (kCoat) any_lobe = any_lobe | (not_(coat_.smooth) & (coat_.weight > 0.f));
    if constexpr (kFuzz) any_lobe = any_lobe | (fuzz_ > 0.f);
    return any_lobe;
  }

  /// Lanes whose light enters the surface and continues as a subsurface random walk.
  Mask<F> enters(const Vec3<F>& wo, const Vec3<F>& wi) const {
    if constexpr (!kBack) return Mask<F>(false);
    return subsurface_ & (wo.z > 0.f) & (wi.z < 0.f);
  }

  /// Lanes whose surfaces ray traversal lets rays pass. They absorb nothing along rays.
  Mask<F> is_clear() const { return clear_; }

  /// Lanes whose light samples may lie on the other side of the surface.
  Mask<F> passes_light() const {
    Mask<F> passes(false);
    if constexpr (kBack) passes = passes | not_(is_black(back_));
    if constexpr (Base::kGlass) passes = passes | (base_.glass > 0.f);
    return passes;
  }

  /// Lanes with a coat or fuzz, which exist only on the outside.
  Mask<F> is_layered() const {
    Mask<F> layered(false);
    if constexpr (kFuzz) layered = layered | (fuzz_ > 0.f);
    if constexpr (kCoat) layered = layered | (coat_.weight > 0.f);
    return layered;
  }

  /// Values that depend on wo only. `o` is wo mirrored to the upper side and rotated to the axis of
  /// anisotropy.
  struct View {
    F side;
    Vec3<F> o;
    typename Base::View base;
    typename EonDiffuse<F>::Sampler eon;
    FuzzLobe<F> fuzz;
    Color<F> glossy;      ///< transmission through the glossy interface to the diffuse base
    F fuzz_on, coat_on;   ///< weights of fuzz and coat on the viewer's side
    F under_fuzz;         ///< transmission through the fuzz
    F coat_compensation;  ///< factor of coat reflection due to multiple scattering
    /// Transmission of the layers above the base: bare + coated coat_color^(1 / (2 mu_i)).
    Color<F> bare, coated;
    F p_diffuse, p_back, p_fuzz, p_coat, p_base;
  };

  View view(const Vec3<F>& wo) const {
    View v;
    v.side = side_of(wo);
    v.o = turned(mirror_z(wo, v.side));
    const F z = v.o.z;
    v.base = base_.view(v.o, wo.z < 0.f, energy_);
    v.eon = eon_.sampler(z);
    v.glossy = (Color<F>(F(1.f)) - v.base.gloss) * base_.opaque;
    // Transmissive solids have layers only on the outside.
    const F outside = select(v.base.inside, F(0.f), F(1.f));
    if constexpr (kFuzz) v.fuzz_on = fuzz_ * outside;
    if constexpr (kCoat) v.coat_on = coat_.weight * outside;
    v.under_fuzz = F(1.f);
    v.fuzz.albedo = F(0.f);
    v.fuzz.inv_a = F(1.f);
    v.fuzz.inv_b = F(0.f);
    if (has_fuzz(v)) {
      v.fuzz = FuzzLobe<F>(z, fuzz_roughness_);
      v.under_fuzz = fnma(v.fuzz_on, v.fuzz.albedo, F(1.f));
    }
    v.bare = Color<F>(v.under_fuzz);
    v.coated = Color<F>(F(0.f));
    v.coat_compensation = F(1.f);
    F coat_albedo(0.f);
    if (has_coat()) {
      const auto layer = coat_.layer(energy_, z);
      v.coat_compensation = layer.compensation;
      coat_albedo = v.coat_on * layer.albedo;
      v.bare = Color<F>(F(v.under_fuzz * F(1.f - coat_.weight)));
      v.coated = darkened(v, z) * coat_.tint(z) * F(v.under_fuzz * F(coat_.weight - coat_albedo));
    }
    if (kTransmitsStraight && any(clear_)) [[unlikely]]
      base_.keep_rest(straight(v), most_, clear_, z, v.base);
    choose_shares(v, F(v.under_fuzz * coat_albedo));
    return v;
  }

  /// Returns the fraction of light that passes straight through a smooth thin wall towards the
  /// viewer, except for what ray traversal transmits (lobes/straight_transmission.h).
  Color<F> straight(const View& v) const {
    const Color<F> passed =
        base_.facet(v.base, v.o.z).transmit * below(v, Vec3<F>(-v.o.x, -v.o.y, F(-v.o.z)));
    return select<F>(base_.smooth & base_.thin, passed, Color<F>(F(0.f)));
  }

  using Viewed::delta_probability, Viewed::eval, Viewed::diffuse_f_cos, Viewed::sample;

  F delta_probability(const View& v) const {
    F mirrors = select(base_.smooth, v.p_base, F(0.f));
    if constexpr (kCoat) mirrors = mirrors + select(coat_.smooth, v.p_coat, F(0.f));
    return select(v.o.z > 0.f, mirrors, F(0.f));
  }

  BsdfEval<F> eval(const View& v, const Vec3<F>& wi) const { return eval_view(v, to_view(v, wi)); }

  Color<F> diffuse_f_cos(const View& v, const Vec3<F>& wi_) const {
    const Vec3<F> wi = to_view(v, wi_);
    return diffuse_part(v, wi) * v.glossy * below(v, wi);
  }

  BsdfSample<F> sample(const View& view, const F& u_lobe, const F& u, const F& v) const {
    LobeChoice<F> choice{u_lobe};
    const Mask<F> is_diffuse = choice.next(view.p_diffuse);
    Mask<F> is_back(false), is_fuzz(false), is_coat(false);
    if constexpr (kBack) is_back = choice.next(view.p_back);
    if constexpr (kFuzz) is_fuzz = choice.next(view.p_fuzz);
    if constexpr (kCoat) is_coat = choice.next(view.p_coat);
    const Mask<F> is_base = choice.next(view.p_base) | (choice.open & (view.p_base > 0.f));
    const F left = clamp(choice.left, F(0.f), F(kOneMinusEpsilon));

    const Vec3<F>& o = view.o;
    Vec3<F> wi(F(0.f), F(0.f), F(1.f));
    if (any(is_diffuse)) wi = select<F>(is_diffuse, eon_.sample(view.eon, o, left, u, v), wi);
    if (kBack && any(is_back)) {
      const Vec3<F> c = square_to_cosine_hemisphere(u, v);
      wi = select<F>(is_back, Vec3<F>(c.x, c.y, F(-c.z)), wi);
    }
    if (kFuzz && any(is_fuzz)) wi = select<F>(is_fuzz, view.fuzz.sample(o, u, v), wi);
    const Vec3<F> mirror(-o.x, -o.y, o.z);
    if (kCoat && any(is_coat)) {
      // A microfacet of the coat may reflect below the surface, where the coat has no density; such
      // samples are invalid.
      const Vec3<F> c = sample_microfacet(coat_.ggx, o, u, v);
      const Vec3<F> rough = select<F>(c.z > 0.f, c, Vec3<F>(F(1.f), F(0.f), F(0.f)));
      wi = select<F>(is_coat, select<F>(coat_.smooth, mirror, rough), wi);
    }
    Mask<F> refracted(false);
    if (any(is_base)) {
      const auto b = base_.sample(view.base, o, left, u, v);
      refracted = is_base & b.crosses;
      wi = select<F>(is_base, b.wi, wi);
    }

    const BsdfEval<F> e = eval_view(view, wi);
    const Mask<F> above = o.z > 0.f;
    const Mask<F> delta_base = is_base & base_.smooth & above;
    Mask<F> delta_coat(false);
    if constexpr (kCoat) delta_coat = is_coat & coat_.smooth & above;
    // eval excludes smooth lobes, but rough lobes may still have density in the mirror direction.
    const Mask<F> delta = delta_base | delta_coat;
    const Mask<F> valid = not_(delta) & (e.pdf > 0.f);
    BsdfSample<F> s = empty_sample<F>();
    s.weight = select<F>(valid, e.f_cos * F(1.f / select(valid, e.pdf, F(1.f))), s.weight);
    s.pdf = select(valid, e.pdf, F(0.f));
    if (any(delta)) weigh_deltas(view, wi, delta, delta_coat, refracted, s);
    const Mask<F> good = s.pdf > 0.f;
    s.wi = select<F>(good, from_view(view, wi), Vec3<F>(F(0.f), F(0.f), F(1.f)));
    if constexpr (Base::kGlass) {
      const Mask<F> bends = refracted & good & not_(base_.thin);
      s.eta = select(bends, view.base.eta, F(1.f));
    }
    F lobe = select(is_base, base_.roughness, F(1.f));
    if constexpr (kCoat) lobe = select(is_coat, coat_.roughness, lobe);
    s.roughness = select(s.is_delta, F(0.f), lobe);
    return s;
  }

 private:
  /// Sets weight and pdf in the lanes `delta`, whose samples along `wi` are in the smooth lobe of
  /// the coat (`delta_coat`) or of the base.
  WAVECOMB_INLINE void weigh_deltas(const View& view, const Vec3<F>& wi, const Mask<F>& delta,
                                    const Mask<F>& delta_coat, const Mask<F>& refracted,
                                    BsdfSample<F>& s) const {
    const F& z = view.o.z;
    const auto facet = base_.facet(view.base, z);
    const F p_up = facet.reflect_share();
    const F p_direction = select(refracted, F(1.f - p_up), p_up);
    const Color<F> base =
        select<F>(refracted, facet.transmit * base_.radiance_scale(view.base), facet.reflect) *
        below(view, wi);
    F p_lobe = view.p_base * p_direction;
    Color<F> f = base;
    if constexpr (kCoat) {
      p_lobe = select(delta_coat, view.p_coat, p_lobe);
      f = select<F>(delta_coat, Color<F>(F(view.under_fuzz * coat_reflectance(view, z))), base);
    }
    const F p = max(p_lobe, F(1e-20f));
    s.weight = select<F>(delta, f * F(1.f / p), s.weight);
    s.pdf = select(delta, p, s.pdf);
    s.is_delta = delta;
    // A sample without contribution is invalid, for example after almost complete absorption.
    const Mask<F> carries_no_light = delta & is_black(s.weight);
    s.pdf = select(carries_no_light, F(0.f), s.pdf);
    s.is_delta = s.is_delta & not_(carries_no_light);
  }

  bool has_coat() const {
    if constexpr (kCoat) return any(Mask<F>(coat_.weight > 0.f));
    return false;
  }
  static bool has_fuzz(const View& v) {
    if constexpr (kFuzz) return any(Mask<F>(v.fuzz_on > 0.f));
    return false;
  }

  Vec3<F> to_view(const View& v, const Vec3<F>& w) const { return turned(mirror_z(w, v.side)); }
  /// Rotates a direction into the frame of anisotropy; from_view() inverts this.
  Vec3<F> turned(const Vec3<F>& w) const { return kTurned ? turn_.to(w) : w; }
  Vec3<F> from_view(const View& v, const Vec3<F>& w) const {
    return mirror_z(kTurned ? turn_.back(w) : w, v.side);
  }

  F coat_reflectance(const View& v, const F& cos_h) const {
    return coat_.reflectance(v.coat_on, v.coat_compensation, cos_h);
  }
  /// Transmission of the layers above the base.
  Color<F> below(const View& v, const Vec3<F>& wi) const {
    if (!has_coat()) return v.bare;
    return fma_color(v.coated, coat_.tint(wi.z), v.bare);
  }
  static Color<F> fma_color(const Color<F>& a, const Color<F>& b, const Color<F>& c) {
    return {fma(a.x, b.x, c.x), fma(a.y, b.y, c.y), fma(a.z, b.z, c.z)};
  }

  /// Darkening of the base by interreflection with the coat.
  Color<F> darkened(const View& v, const F& z) const {
    const Color<F> albedo = base_.metal_f0() * base_.metal +
                            (diffuse_ + returned_back_) * base_.opaque + Color<F>(base_.glass);
    const F spread = fma(F(1.f - base_.opaque), base_.roughness, base_.opaque);
    return coat_.darkened(z, albedo, spread, v.base.inside);
  }

  void choose_shares(View& v, const F& coat) const {
    Color<F> through = v.bare;
    if constexpr (kCoat) through = fma_color(v.coated, coat_.color, v.bare);
    const F floor(0.04f);
    const auto share = [&floor](const Mask<F>& on, const F& estimate) {
      return select(on, max(estimate, floor), F(0.f));
    };
    const Mask<F> opaque = base_.opaque > 0.f;
    const Color<F> base_seen_through_layers = v.glossy * through;
    const F diffuse =
        share(opaque & not_(is_black(diffuse_)), importance(base_seen_through_layers * diffuse_));
    F back(0.f), fuzz(0.f), coated(0.f);
    if constexpr (kBack)
      back = share(opaque & not_(is_black(back_)), importance(base_seen_through_layers * back_));
    if constexpr (kFuzz)
      fuzz = share(v.fuzz_on > 0.f, F(v.fuzz_on * v.fuzz.albedo * importance(fuzz_color_)));
    if constexpr (kCoat) coated = share(v.coat_on > 0.f, coat);
    const F base = share(base_.present, importance(v.base.albedo * through));
    const F sum = F(diffuse + back) + F(fuzz + coated) + base;
    const F inv = select(sum > 0.f, F(1.f / max(sum, F(1e-20f))), F(0.f));
    v.p_diffuse = diffuse * inv;
    v.p_back = back * inv;
    v.p_fuzz = fuzz * inv;
    v.p_coat = coated * inv;
    v.p_base = base * inv;
  }

  /// Diffuse reflection and transmission below the interface.
  Color<F> diffuse_part(const View& v, const Vec3<F>& wi) const {
    Color<F> f = eon_.eval(diffuse_, v.o, wi);
    if (kBack && any(Mask<F>(v.p_back > 0.f))) f += back_ * back_cos(v.o, wi);
    return f;
  }
  static F back_cos(const Vec3<F>& o, const Vec3<F>& wi) {
    return select(o.z > 0.f, lambert_cos(Vec3<F>(wi.x, wi.y, F(-wi.z))), F(0.f));
  }

  BsdfEval<F> eval_view(const View& v, const Vec3<F>& wi) const {
    const Vec3<F>& o = v.o;
    Color<F> f(F(0.f));
    F pdf(0.f);
    if (any(Mask<F>(base_.opaque > 0.f))) {
      f = diffuse_part(v, wi) * v.glossy;
      pdf = v.p_diffuse * eon_.pdf(v.eon, o, wi);
      if (kBack && any(Mask<F>(v.p_back > 0.f))) pdf = fma(v.p_back, back_cos(o, wi), pdf);
    }
    if (!all(base_.smooth)) {
      const BsdfEval<F> e = base_.eval(v.base, o, wi);
      f += e.f_cos;
      pdf = fma(v.p_base, e.pdf, pdf);
    }
    f = f * below(v, wi);
    Mask<F> rough_coat(false);
    if constexpr (kCoat) rough_coat = not_(coat_.smooth) & (v.coat_on > 0.f);
    if (kCoat && any(rough_coat)) {
      const MicrofacetEval<F> m = eval_microfacet(coat_.ggx, o, wi);
      const F on = select(rough_coat, F(1.f), F(0.f));
      const F glossy = m.f_cos * on * coat_reflectance(v, m.cos_h) * v.under_fuzz;
      f += Color<F>(glossy);
      pdf = fma(F(v.p_coat * on), m.pdf, pdf);
    }
    if (has_fuzz(v)) {
      const F d = v.fuzz.density(o, wi);
      f += fuzz_color_ * F(v.fuzz_on * v.fuzz.albedo * d);
      pdf = fma(v.p_fuzz, d, pdf);
    }
    return {f, pdf};
  }

  Base base_;
  EonDiffuse<F> eon_;
  const float* energy_;
  OpenPbrCoat<F> coat_;
  F fuzz_, fuzz_roughness_;
  Turn<F> turn_;
  F most_;                ///< most_passing()
  Mask<F> clear_{false};  ///< thin walls that transmit straight
  Color<F> fuzz_color_, diffuse_, back_;
  Color<F> returned_back_;  ///< colour of light that enters through the lobe `back_` and returns
  Mask<F> subsurface_{false};
};

}  // namespace wavecomb
