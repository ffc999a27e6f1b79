// SPDX-License-Identifier: Apache-2.0
/// What every program's BSDF offers. Directions are local: z is the shading normal, wo and wi point
/// away from the surface, |w| = 1.
///
/// A program is a class template `Bsdf<F>` with
///
///   static constexpr ProgramId kProgram;
///   static constexpr uint32_t kInputs;      what it reads
///   BsdfTraits, or what differs from them
///   using Params;                          where it takes what no row can say (params.h)
///   Bsdf(const Params&, bool schlick);     ShadingParams, or else ParamsOf
///   Color<F> albedo() const;               for the AOV: diffuse and specular colour
///   Mask<F> has_non_delta() const;         lanes where light sampling makes sense
///   View view(wo) const;                   what depends on wo alone; wo itself in the simple ones
///   F delta_probability(wo) const;         with which sample() chooses a delta lobe
///   BsdfEval<F> eval(wo, wi) const;
///   Color<F> diffuse_f_cos(wo, wi) const;  the part of eval's that counts as diffuse
///   BsdfSample<F> sample(wo, u_lobe, u, v) const;    numbers in [0, 1)
/// The four of them take a view in place of wo, too.
///   Mask<F> is_layered() const;    optional: lanes where what a delta lobe lets through is not
///   alike
///                                  in both directions
///
/// A program that shades what is no surface (kOnSurface false: an event in a medium) is the same
/// with a phase function in place of the BSDF, without a cosine, and has
///
///   static auto interact(const Vertex<F>&);    what it meets: integrate/steps/interact.h says how
#pragma once

#include <array>

#include "wavecomb/core/vec.h"
#include "wavecomb/scene/material_data.h"

namespace wavecomb {

/// What the integrator knows of a program. Programs are derived from this and say what differs.
struct BsdfTraits {
  static constexpr bool kEmits = false;         ///< its materials may emit
  static constexpr bool kAbsorbs = false;       ///< rays inside lose light: Params::transmittance
  static constexpr bool kHasNonDelta = true;    ///< has lobes that light sampling makes sense for
  static constexpr bool kTransmits = false;     ///< those may lead to the other side
  static constexpr bool kWalks = false;         ///< light may walk below: has `enters(wo, wi)`
  static constexpr bool kHasTerminator = true;  ///< rays start beyond the terminator of its normals
  static constexpr bool kTextured = true;       ///< its materials may read textures or graphs
  static constexpr bool kReadsIor = false;      ///< the index of refraction says something
  static constexpr bool kOnSurface = true;      ///< shades hits; or else it has an `interact`
  static constexpr bool kOnSplats = false;      ///< emits what splats do where it is on those
  /// Scatters as a whole fibre does, about an axis: its frame has x along it (curve/fibre.h), both
  /// sides are one, and paths from lights do not go there, since it is not reciprocal.
  static constexpr bool kOnFibre = false;

  /// What depends on wo alone, as the functions below take it: wo, unless a program says more.
  template <typename Wo>
  static const Wo& view(const Wo& wo) {
    return wo;
  }
  /// Lanes whose light samples may lie on the other side of the surface. For programs that
  /// transmit; a variant gives the same lanes as the whole program.
  static bool passes_light() { return true; }
};

/// f(wo, wi) |cos theta_i| and the solid-angle density with which sample() would have chosen wi.
/// Delta lobes do not count in either.
template <typename F>
struct BsdfEval {
  Color<F> f_cos;
  F pdf;
};

/// A sampled direction. weight = f |cos theta_i| / pdf. A lane without a valid sample has weight 0
/// and pdf 0. For a delta lobe pdf is the probability of having chosen it.
template <typename F>
struct BsdfSample {
  Vec3<F> wi;
  Color<F> weight;
  F pdf;
  Mask<F> is_delta;
  /// Relative index of refraction across the surface crossed (eta_t / eta_i); 1 for reflection and
  /// for straight transmission. Throughput carries radiance scaling; roulette undoes it with this.
  F eta;
  /// Perceptual roughness of the lobe chosen (diffuse: 1), for the ray cone.
  F roughness;
};

/// Base of a program whose view is more than wo: its functions of a view, given wo. Programs make
/// them visible by a using-declaration.
template <typename Bsdf, typename F>
struct ViewedBsdf : BsdfTraits {
  F delta_probability(const Vec3<F>& wo) const { return self().delta_probability(self().view(wo)); }
  BsdfEval<F> eval(const Vec3<F>& wo, const Vec3<F>& wi) const {
    return self().eval(self().view(wo), wi);
  }
  Color<F> diffuse_f_cos(const Vec3<F>& wo, const Vec3<F>& wi) const {
    return self().diffuse_f_cos(self().view(wo), wi);
  }
  BsdfSample<F> sample(const Vec3<F>& wo, const F& u_lobe, const F& u, const F& v) const {
    return self().sample(self().view(wo), u_lobe, u, v);
  }

 private:
  const Bsdf& self() const { return static_cast<const Bsdf&>(*this); }
};

/// No sample: weight 0 and pdf 0.
template <typename F>
inline BsdfSample<F> empty_sample() {
  return {
      Vec3<F>(F(0.f), F(0.f), F(1.f)), Color<F>(F(0.f)), F(0.f), Mask<F>(false), F(1.f), F(1.f)};
}

/// `a` where `m`, else `b`.
template <typename F>
inline BsdfSample<F> select_sample(const Mask<F>& m, const BsdfSample<F>& a,
                                   const BsdfSample<F>& b) {
  return {select<F>(m, a.wi, b.wi), select<F>(m, a.weight, b.weight),
          select(m, a.pdf, b.pdf),  Mask<F>((m & a.is_delta) | (not_(m) & b.is_delta)),
          select(m, a.eta, b.eta),  select(m, a.roughness, b.roughness)};
}

/// Values of all inputs at one hit, as fetch_params gives them.
template <typename F>
struct ShadingParams {
  Color<F> base_color, specular_color, emission;
  F roughness, metallic, clearcoat, clearcoat_roughness, opacity;
  Vec3<F> normal;  ///< tangent space, unit
  F ior;
  Color<F> conductor_eta, conductor_k;
  UInt<F> flags;
};

/// What a program takes that has parameters to itself (scene/programs.h), in the order of its row.
template <typename F>
struct OwnShadingParams : ShadingParams<F> {
  std::array<F, kMaxProgramParameters> own;
};

}  // namespace wavecomb
