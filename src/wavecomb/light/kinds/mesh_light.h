// SPDX-License-Identifier: Apache-2.0
/// Mesh lights: triangles of meshes with UsdLux light attributes, whose light may differ from the
/// emission of their material.
#pragma once

#include "wavecomb/light/filters/shaping.h"
#include "wavecomb/light/kinds/triangle.h"
#include "wavecomb/light/sampling/linking.h"

namespace wavecomb {

namespace detail {

/// Returns the radiance of samples `s` on triangles `light`, with tint and shaping of their mesh
/// lights. Constant radiance was tinted when the scene was built.
template <typename F>
inline Color<F> mesh_light_sample_radiance(const LightView& view, const UInt<F>& light,
                                           const TriangleReader<F>& triangle,
                                           const KindSample<F>& s, const Mask<F>& active) {
  const UInt<F> record = record_of<F>(view, light, active);
  const Mask<F> known = active & (s.pdf > 0.f) & Mask<F>(record != UInt<F>(kNoLight));
  if (none(known)) return s.radiance;
  const LightReader<F> reader(view.lights, record, known);
  const Mask<F> varies = known & (triangle.radiance.x < 0.f);
  const Color<F> radiance = select<F>(varies, s.radiance * reader.radiance(), s.radiance);
  if (!view.shapings) return radiance;
  return shaped<F>(view, reader.shaping(), -s.wi, radiance, known);
}

/// Returns the factor for emission that a path hits, for a light with these multipliers. `share` is
/// the diffuse fraction of the path's last bounce; the rest is specular. Cameras see the light
/// without multipliers. `is_specular_view` marks paths that light sampling cannot produce.
template <typename F>
inline Color<F> factor_of_hit(const F& diffuse, const F& specular, const Mask<F>& sampled_only,
                              const Mask<F>& is_specular_view, bool from_camera,
                              const Color<F>& share) {
  Color<F> factor(F(1.f));
  if (!from_camera) {
    const F more = diffuse - specular;
    factor = {fma(more, share.x, specular), fma(more, share.y, specular),
              fma(more, share.z, specular)};
  }
  return select<F>(sampled_only & not_(is_specular_view), Color<F>(F(0.f)), factor);
}

}  // namespace detail

/// Returns the radiance that a path along `dir` receives from meshes with mesh light records
/// `record` (kNoLight for other meshes), before MIS. `material_emission` is the emission of the
/// material. `is_specular_view` marks hits from a camera or a mirror. Other hits are bounces that
/// light sampling can also produce, with the diffuse fraction `share`.
template <typename F>
inline Color<F> mesh_light_radiance(const LightView& view, const UInt<F>& record,
                                    const Color<F>& material_emission, const Vec3<F>& dir,
                                    const UInt<F>& link, const Mask<F>& is_specular_view,
                                    bool from_camera, const Color<F>& share,
                                    const Mask<F>& active) {
  using U = UInt<F>;
  using R = LightRecord;
  const Mask<F> known = active & Mask<F>(record != U(kNoLight));
  if (none(known)) return material_emission;
  const detail::LightReader<F> light(view.lights, record, known);
  const U sync = light[&R::sync];
  const Mask<F> shows_material =
      is_specular_view & Mask<F>(sync != U(static_cast<uint32_t>(MaterialSync::kNoResponse)));
  const Mask<F> uses_light = known & not_(shows_material);
  if (none(uses_light)) return material_emission;
  Color<F> radiance = material_emission * light.radiance();
  if (view.shapings)
    radiance = detail::shaped<F>(view, light.shaping(), -dir, radiance, uses_light);
  const Mask<F> sampled_only = Mask<F>(light[&R::sampled_only] != U(0u));
  radiance =
      radiance * detail::factor_of_hit<F>(light[&R::diffuse], light[&R::specular], sampled_only,
                                          is_specular_view, from_camera, share);
  if (view.links.members) {
    const U set = light[&R::light_link];
    radiance = radiance * select(is_linked<F>(view.links, link, set, uses_light), F(1.f), F(0.f));
  }
  return select<F>(uses_light, radiance, material_emission);
}

/// Kind of mesh lights in WAVECOMB_LIGHT_KINDS (light/kinds/kinds.h). Records of mesh lights are
/// never selected themselves; their triangles have separate rows.
struct TriangleKind : FlatKind {
  static LightKindInfo describe();
  template <typename F>
  static detail::KindHit<F> hit(const detail::LightHitQuery<F>& /*query*/) {
    return detail::dark<F>();
  }
  template <typename F>
  static detail::KindSample<F> sample(const detail::LightQuery<F>& /*query*/) {
    return {};
  }
  template <typename F>
  static detail::KindEmission<F> emit(const detail::EmissionQuery<F>& /*query*/) {
    return {};
  }
  template <typename F>
  static F emission_density(const detail::LightHitQuery<F>& /*query*/) {
    return F(0.f);
  }
};

}  // namespace wavecomb
