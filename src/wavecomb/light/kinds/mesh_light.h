// SPDX-License-Identifier: Apache-2.0
/// Mesh lights: triangles of meshes with UsdLux light attributes, whose light may differ from the
/// emission of their material.
#pragma once

#include "wavecomb/light/filters/shaping.h"
#include "wavecomb/light/kinds/triangle.h"
#include "wavecomb/light/sampling/linking.h"

namespace wavecomb {

namespace detail {

/// Returns the radiance of samples `s` on triangles `light`, with the tint and shaping of their
/// mesh lights. Constant radiance was already tinted when the scene was built.
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

/// Returns the factor by which to multiply the emission of a light that a path hits. `diffuse` and
/// `specular` are the multipliers of the light. `share` is the diffuse fraction of the path's last
/// bounce, and 1 - `share` is its specular fraction. Camera rays receive the emission without
/// multipliers. `is_specular_view` marks paths that light sampling cannot produce.
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

/// Ray that hits an emissive mesh, and the bounce that started it.
template <typename F>
struct MeshLightRay {
  Vec3<F> dir;
  UInt<F> link;      ///< light linking class of the surface at which the ray starts
  Mask<F> is_delta;  ///< whether the ray is a camera ray or a delta bounce, which light sampling
                     ///< cannot produce
  bool from_camera;
  Color<F> diffuse;  ///< diffuse fraction of the bounce for each colour
};

/// Returns the radiance, without MIS weight, that a path receives along `ray` from meshes with mesh
/// light records `record` (kNoLight for other meshes). `emission` is the emission of the material.
template <typename F>
inline Color<F> mesh_light_radiance(const LightView& view, const UInt<F>& record,
                                    const Color<F>& emission, const MeshLightRay<F>& ray,
                                    const Mask<F>& active) {
  using U = UInt<F>;
  using R = LightRecord;
  const Mask<F> known = active & Mask<F>(record != U(kNoLight));
  if (none(known)) return emission;
  const detail::LightReader<F> light(view.lights, record, known);
  const U sync = light[&R::sync];
  const Mask<F> shows_material =
      ray.is_delta & Mask<F>(sync != U(static_cast<uint32_t>(MaterialSync::kNoResponse)));
  const Mask<F> uses_light = known & not_(shows_material);
  if (none(uses_light)) return emission;
  Color<F> radiance = emission * light.radiance();
  if (view.shapings)
    radiance = detail::shaped<F>(view, light.shaping(), -ray.dir, radiance, uses_light);
  const Mask<F> sampled_only = Mask<F>(light[&R::sampled_only] != U(0u));
  radiance =
      radiance * detail::factor_of_hit<F>(light[&R::diffuse], light[&R::specular], sampled_only,
                                          ray.is_delta, ray.from_camera, ray.diffuse);
  if (view.links.members) {
    const U set = light[&R::light_link];
    radiance =
        radiance * select(is_linked<F>(view.links, ray.link, set, uses_light), F(1.f), F(0.f));
  }
  return select<F>(uses_light, radiance, emission);
}

/// Class of mesh lights, an entry of WAVECOMB_LIGHT_KINDS (light/kinds/kinds.h). Light sampling
/// does not select the records of mesh lights. Instead, it selects their triangles, which have
/// separate records.
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
