// SPDX-License-Identifier: Apache-2.0
/// Interface of the BSDF class of a shading program. Directions are unit vectors in local space: z
/// is the shading normal, and wo and wi point away from the surface.
///
/// Each shading program has a BSDF class template `Bsdf<F>` with these members:
///
///   static constexpr ProgramId kProgram;
///   static constexpr uint32_t kInputs;      inputs whose textures it reads
///   BsdfTraits as base class                members overridden where they differ
///   using Params;                           optional: parameters with a separate fetch (params.h)
///   Bsdf(const Params&, bool schlick);      ParamsOf, usually ShadingParams
///   Color<F> albedo() const;                for the AOV: diffuse and specular colour
///   Mask<F> has_non_delta() const;          lanes that benefit from light samples
///   View view(wo) const;                    values that depend on wo only; by default wo itself
///   F delta_probability(wo) const;          probability with which sample() chooses a delta lobe
///   BsdfEval<F> eval(wo, wi) const;
///   Color<F> diffuse_f_cos(wo, wi) const;   the diffuse part of eval
///   BsdfSample<F> sample(wo, u_lobe, u, v) const;    sample values in [0, 1)
///   Mask<F> is_layered() const;             optional: lanes whose delta transmission differs
///                                           between the two directions
///
/// delta_probability, eval, diffuse_f_cos and sample also accept the result of view(wo) in place of
/// wo.
///
/// If `kOnSurface` is false, the program shades collisions in media. Its class evaluates a phase
/// function without a cosine factor, and has one more member:
///
///   static auto interact(const Vertex<F>&);    the interaction, see path/steps/interact.h
#pragma once

#include <array>

#include "wavecomb/core/vec.h"
#include "wavecomb/material/description/material.h"

namespace wavecomb {

/// Compile-time properties of a shading program. The class of a program derives from BsdfTraits and
/// overrides the members whose values differ.
struct BsdfTraits {
  static constexpr bool kEmits = false;  ///< whether materials of this program may emit light
  /// Whether the program attenuates rays inside objects by `Params::transmittance`.
  static constexpr bool kAbsorbs = false;
  /// Whether the program has lobes other than delta lobes.
  static constexpr bool kHasNonDelta = true;
  /// Whether non-delta lobes may transmit to the other side of the surface.
  static constexpr bool kTransmits = false;
  /// Whether ray traversal may let light pass straight (lobes/straight_transmission.h).
  static constexpr bool kTransmitsStraight = false;
  /// Whether the program has subsurface random walks; if so, the class has `enters(wo, wi)`.
  static constexpr bool kHasSubsurface = false;
  /// Whether ray origins are offset to hide artefacts at the shadow terminator.
  static constexpr bool kHasTerminator = true;
  static constexpr bool kTextured = true;   ///< whether materials of the program may read
                                            ///< textures or graphs
  static constexpr bool kReadsIor = false;  ///< whether the program reads the index of
                                            ///< refraction
  /// Whether the program shades surface hits; programs of media have an interact() function
  /// instead.
  static constexpr bool kOnSurface = true;
  static constexpr bool kOnGaussianSplats = false;  ///< whether the program provides the emission
                                                    ///< of Gaussian splats
  /// Whether the BSDF describes scattering by a whole fibre. The x axis of the local frame then
  /// lies along the fibre (geometry/hit/fibre_frame.h), and the surface has no inner side. Such a
  /// BSDF is not reciprocal, so light paths do not support it.
  static constexpr bool kOnFibre = false;

  /// Returns the values that depend only on wo, which functions such as eval() take as input. By
  /// default, returns wo itself.
  template <typename Wo>
  static const Wo& view(const Wo& wo) {
    return wo;
  }
  /// Returns the lanes in which a light behind the surface can contribute, for programs that
  /// transmit light. A program variant returns the same lanes as the complete program.
  static bool passes_light() { return true; }
};

/// Result of eval(): f(wo, wi) |cos theta_i|, and the solid-angle density with which sample()
/// chooses `wi`. Delta lobes contribute to neither value.
template <typename F>
struct BsdfEval {
  Color<F> f_cos;
  F pdf;
};

/// A sampled direction `wi`, with `weight` = f |cos theta_i| / pdf. Lanes without a valid sample
/// have weight 0 and pdf 0. For a delta lobe, pdf is the probability of choosing the lobe.
template <typename F>
struct BsdfSample {
  Vec3<F> wi;
  Color<F> weight;
  F pdf;
  Mask<F> is_delta;
  /// Relative index of refraction across the surface (eta_t / eta_i); 1 for reflection and for
  /// straight transmission. Refraction scales the throughput by 1 / eta^2. Russian roulette
  /// multiplies by `eta`^2 to cancel this scaling.
  F eta;
  /// Perceptual roughness of the sampled lobe (1 for diffuse lobes), which widens the ray cone.
  F roughness;
};

/// Base class of BSDFs whose view() returns more values than `wo`. Adds overloads of
/// delta_probability(), eval(), diffuse_f_cos() and sample() that take `wo` and call view().
/// Derived classes import the overloads by using-declarations.
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

/// Returns an invalid sample: weight 0 and pdf 0.
template <typename F>
inline BsdfSample<F> empty_sample() {
  return {
      Vec3<F>(F(0.f), F(0.f), F(1.f)), Color<F>(F(0.f)), F(0.f), Mask<F>(false), F(1.f), F(1.f)};
}

/// Returns the sample `a` in the lanes of mask `m`, and `b` in all other lanes.
template <typename F>
inline BsdfSample<F> select_sample(const Mask<F>& m, const BsdfSample<F>& a,
                                   const BsdfSample<F>& b) {
  return {select<F>(m, a.wi, b.wi), select<F>(m, a.weight, b.weight),
          select(m, a.pdf, b.pdf),  Mask<F>((m & a.is_delta) | (not_(m) & b.is_delta)),
          select(m, a.eta, b.eta),  select(m, a.roughness, b.roughness)};
}

/// Values of all material inputs at a hit, returned by fetch_params().
template <typename F>
struct ShadingParams {
  Color<F> base_color, specular_color, emission;
  F roughness, metallic, clearcoat, clearcoat_roughness, opacity;
  Vec3<F> normal;  ///< tangent space, unit length
  F ior;
  Color<F> conductor_eta, conductor_k;
  UInt<F> flags;
};

/// Material inputs at a hit. `own` holds the program-specific parameters, in the order of the
/// program's row in material/description/programs.h.
template <typename F>
struct SpecificShadingParams : ShadingParams<F> {
  std::array<F, kMaxProgramParameters> own;
};

}  // namespace wavecomb
