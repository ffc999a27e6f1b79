// SPDX-License-Identifier: Apache-2.0
/// Program "volume": scattering in a volume, or in fog inside a mesh.
#pragma once

#include "wavecomb/core/frame.h"
#include "wavecomb/core/math.h"
#include "wavecomb/material/bsdf.h"
#include "wavecomb/medium/volume/henyey_greenstein.h"
#include "wavecomb/medium/volume/moving_lookup.h"
#include "wavecomb/path/path_state.h"

namespace wavecomb {

/// BSDF of a volume event: the Henyey-Greenstein phase function, scaled by the albedo.
template <typename F>
class VolumeBsdf : public BsdfTraits {
 public:
  static constexpr ProgramId kProgram = ProgramId::kVolume;
  static constexpr uint32_t kInputs = 0;
  static constexpr bool kOnSurface = false;
  static constexpr bool kTransmits = true;

  VolumeBsdf(const Color<F>& albedo, const F& anisotropy)
      : albedo_(albedo), g_(select(abs(anisotropy) < F(kMinMeanCosine), F(0.f), anisotropy)) {}

  Color<F> albedo() const { return albedo_; }
  Mask<F> has_non_delta() const { return max_component(albedo_) > 0.f; }
  F delta_probability(const Vec3<F>& /*wo*/) const { return F(0.f); }
  BsdfEval<F> eval(const Vec3<F>& wo, const Vec3<F>& wi) const {
    const F p = henyey_greenstein<F>(g_, F(-dot(wo, wi)));
    return {albedo_ * p, p};
  }
  Color<F> diffuse_f_cos(const Vec3<F>& wo, const Vec3<F>& wi) const { return eval(wo, wi).f_cos; }
  BsdfSample<F> sample(const Vec3<F>& wo, const F& /*u_lobe*/, const F& u, const F& v) const {
    const F c = sample_henyey_greenstein<F>(g_, u);
    const F s = safe_sqrt(F(1.f - c * c));
    const SinCos<F> turn = sincos_2pi(v);
    const Vec3<F> wi = make_frame<F>(-wo).to_world(Vec3<F>(F(s * turn.cos), F(s * turn.sin), c));
    return {wi, albedo_, henyey_greenstein<F>(g_, c), Mask<F>(false), F(1.f), F(1.f)};
  }

  /// Volume event, in place of a surface's shading point (path/steps/interact.h).
  struct Interaction {
    VolumeBsdf bsdf;
    Color<F> throughput;
    Vec3<F> p;

    template <uint32_t kFeatures>
    Frame<F> frame(const Vertex<F, kFeatures>& v) const {
      return make_frame<F>(-v.path.dir);
    }
    template <uint32_t kFeatures>
    void record_aovs(const Vertex<F, kFeatures>& v, const Frame<F>& /*frame*/) const {
      if (!v.recorded_aovs()) return;
      v.aovs->albedo = bsdf.albedo();
      v.aovs->normal = -v.path.dir;
      v.aovs->is_clear = Mask<F>(false);
      if (v.aovs->wants_uv) v.aovs->uv = {F(0.f), F(0.f)};
    }
    template <uint32_t kFeatures>
    UInt<F> link_class(const Vertex<F, kFeatures>& /*v*/) const {
      return UInt<F>(0u);
    }
    Vec3<F> origin(const Vec3<F>& /*dir*/) const { return p; }
    Mask<F> is_consistent(const Vec3<F>& /*world*/, const Vec3<F>& /*local*/) const {
      return Mask<F>(true);
    }
  };
  template <uint32_t kFeatures>
  static Interaction interact(const Vertex<F, kFeatures>& v) {
    using U = UInt<F>;
    const VolumeView& volumes = v.scene.volumes;
    const Vec3<F> p = fma(v.path.dir, v.t, v.path.o);
    const U volume = v.material - volumes.first_material;
    Color<F> albedo(F(0.f));
    F g(0.f);
    Mask<F> in_mesh(false);
    if (v.has_medium_stack()) {
      // The weight of the free flight already includes absorption.
      in_mesh = v.active & Mask<F>(v.material == U(v.scene.nested_media.event_material));
      albedo = select<F>(in_mesh, Color<F>(F(1.f)), albedo);
      g = select(in_mesh,
                 gather_field<F>(v.scene.nested_media.media, &MeshMedium<float>::anisotropy,
                                 v.path.medium, in_mesh),
                 g);
    }
    // Process one volume after the other, each for the lanes of the packet that are inside the
    // volume.
    for (Mask<F> rest = v.active & not_(in_mesh); any(rest);) {
      const uint32_t index = first_active<U>(volume, Mask<U>(rest));
      const VolumeRecord& r = volumes.volumes[index];
      const Mask<F> here = rest & Mask<F>(volume == U(index));
      const Color<F> tint = tint_at<F>(r, p, v.hit.time, here);
      const Color<F> own{F(r.albedo[0]), F(r.albedo[1]), F(r.albedo[2])};
      albedo = select<F>(here, own * tint, albedo);
      g = select(here, F(r.anisotropy), g);
      rest = rest & not_(here);
    }
    return {VolumeBsdf(albedo, g), v.path.throughput, p};
  }

 private:
  Color<F> albedo_;
  F g_;
};

}  // namespace wavecomb
