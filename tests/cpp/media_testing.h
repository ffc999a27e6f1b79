// SPDX-License-Identifier: Apache-2.0
/// A test medium: homogeneous fog that fills all space. The test medium implements every function
/// of the medium interface.
#pragma once

#include "wavecomb/core/encoding/hash.h"
#include "wavecomb/core/frame.h"
#include "wavecomb/core/math.h"
#include "wavecomb/core/warp.h"
#include "wavecomb/material/bsdf.h"
#include "wavecomb/path/media.h"
#include "wavecomb/path/path_state.h"

namespace wavecomb::media_testing {

/// Isotropic phase function. The medium's phase function replaces the program "principled", whose
/// base colour becomes the albedo.
template <typename F>
class FogPhase : public BsdfTraits {
 public:
  static constexpr ProgramId kProgram = ProgramId::kPrincipled;
  static constexpr bool kOnSurface = false;
  static constexpr bool kTransmits = true;
  static constexpr float kDensity = 0.25f * kInvPi;

  explicit FogPhase(const Color<F>& albedo) : albedo_(albedo) {}

  Color<F> albedo() const { return albedo_; }
  Mask<F> has_non_delta() const { return Mask<F>(true); }
  F delta_probability(const Vec3<F>& /*wo*/) const { return F(0.f); }
  BsdfEval<F> eval(const Vec3<F>& /*wo*/, const Vec3<F>& /*wi*/) const {
    return {albedo_ * F(kDensity), F(kDensity)};
  }
  Color<F> diffuse_f_cos(const Vec3<F>& wo, const Vec3<F>& wi) const { return eval(wo, wi).f_cos; }
  BsdfSample<F> sample(const Vec3<F>& /*wo*/, const F& /*u_lobe*/, const F& u, const F& v) const {
    return {square_to_sphere(u, v), albedo_, F(kDensity), Mask<F>(false), F(1.f), F(1.f)};
  }

  /// Interaction with the fog, used instead of a surface interaction (path/steps/interact.h).
  struct Interaction {
    FogPhase bsdf;
    Color<F> throughput;
    Vec3<F> p;

    Frame<F> frame(const Vertex<F>& v) const { return make_frame<F>(-v.path.dir); }
    void record_aovs(const Vertex<F>& v, const Frame<F>& /*frame*/) const {
      if (!v.aovs) return;
      v.aovs->albedo = bsdf.albedo();
      v.aovs->normal = -v.path.dir;
      v.aovs->is_clear = Mask<F>(false);
    }
    UInt<F> link_class(const Vertex<F>& /*v*/) const { return UInt<F>(0u); }
    Vec3<F> origin(const Vec3<F>& /*dir*/) const { return p; }
    Mask<F> is_consistent(const Vec3<F>& /*world*/, const Vec3<F>& /*local*/) const {
      return Mask<F>(true);
    }
  };
  static Interaction interact(const Vertex<F>& v) {
    const Color<F> albedo = gather_member<F>(v.scene.materials.materials,
                                             &MaterialRecord::base_color, v.material, v.active);
    return {FogPhase(albedo), v.path.throughput, fma(v.path.dir, v.t, v.path.o)};
  }

 private:
  Color<F> albedo_;
};

/// Medium interface as path/media.h requires it.
struct Fog {
  static constexpr bool kAny = true, kHasEmission = false, kStreams = false;
  template <typename F>
  using Programs = ProgramList<DiffuseBsdf<F>, EmissiveBsdf<F>, FogPhase<F>>;

  Vec3<float> extinction;
  uint32_t material;          ///< id of a material of program "principled"
  bool tracks_ratio = false;  ///< Whether shadow rays estimate transmittance by ratio tracking
                              ///< instead of exp.

  /// Samples a distance with the extinction of a random colour channel, chosen with probability
  /// 1/3, and divides the weight by the mean density of all three channels:
  ///    stopped at x:  sigma exp(-sigma x) / mean_c(sigma_c exp(-sigma_c x))
  ///    not before t:  exp(-sigma t) / mean_c(exp(-sigma_c t))
  template <typename F>
  Flight<F> sample_flight(const MediumQuery<F>& p, const Color<F>& /*throughput*/,
                          const Mask<F>& /*active*/) const {
    const Sample4<F> r = sample_4d<F>(p.sampler, p.key, vertex_set(VertexSet::kFlight, p.depth));
    const F sigma = select(r.x < 1.f / 3, F(extinction.x),
                           select(r.x < 2.f / 3, F(extinction.y), F(extinction.z)));
    Flight<F> f;
    f.t = -log(F(1.f - r.y)) / sigma;
    f.stopped = f.t < p.t;
    const Color<F> through = exp_of<F>(min(f.t, p.t));
    const Color<F> density = select<F>(f.stopped, through * Color<F>(extinction), through);
    f.weight = density * F(3.f / (density.x + density.y + density.z));
    f.material = UInt<F>(material);
    return f;
  }

  template <typename F>
  Color<F> transmittance(const MediumQuery<F>& p, const Mask<F>& active) const {
    if (!tracks_ratio) return exp_of<F>(p.t);
    // Ratio tracking (Novak et al., "Residual Ratio Tracking", 2014, eq. 9) with a majorant of 2
    // max sigma.
    const float majorant = 2 * std::max({extinction.x, extinction.y, extinction.z});
    const Color<F> kept{F(1.f - extinction.x / majorant), F(1.f - extinction.y / majorant),
                        F(1.f - extinction.z / majorant)};
    const UInt<F> seed =
        float_bits<F>(sample_4d<F>(p.sampler, p.key, vertex_set(VertexSet::kShadow, p.depth)).x);
    Color<F> product(F(1.f));
    F x(0.f);
    Mask<F> on = active;
    for (uint32_t step = 0; any(on); ++step) {
      const F u = unit_float<F>(hash_u32<UInt<F>>(seed, UInt<F>(step)));
      x = select(on, F(x - log(F(1.f - u)) * (1.f / majorant)), x);
      on = on & (x < p.t) & (max_component(product) > 1e-20f);
      product = select<F>(on, product * kept, product);
    }
    return product;
  }

 private:
  template <typename F>
  Color<F> exp_of(const F& x) const {
    return {exp(F(x * -extinction.x)), exp(F(x * -extinction.y)), exp(F(x * -extinction.z))};
  }
};

}  // namespace wavecomb::media_testing
