// SPDX-License-Identifier: Apache-2.0
/// The step `emit`: emission that a path hits.
///
/// With throughput T_k at x_k, a bounce with density p_bsdf (0 for a mirror or the camera) that
/// hits emission Le adds its contribution, weighted against light sampling with density p_light:
///   L += T_k Le(x_k) w,   w = p_bsdf / (p_bsdf + p_light)   (balance heuristic, Veach 1997, 9.2)
#pragma once

#include "wavecomb/light/emission/emission.h"
#include "wavecomb/light/sampling/light_sample.h"
#include "wavecomb/path/steps/interact.h"

namespace wavecomb {

/// Returns the balance heuristic weight of a bounce against a light sample; 1 for a delta bounce
/// (bsdf_pdf = 0).
template <typename F>
inline F bounce_weight(const F& bsdf_pdf, const F& light_pdf) {
  return select(bsdf_pdf > 0.f,
                F(bsdf_pdf / select(bsdf_pdf > 0.f, F(bsdf_pdf + light_pdf), F(1.f))), F(1.f));
}

/// Returns the radiance of emissive surfaces, without MIS weight, in scenes with mesh lights.
/// `emission` is the emission of the surfaces' materials.
template <typename F>
[[gnu::noinline]] Color<F> mesh_light_emission(const SceneView& scene, const UInt<F>& inst,
                                               const UInt<F>& geom, const Color<F>& emission,
                                               const PathState<F>& path, bool from_camera,
                                               const Mask<F>& active) {
  using U = UInt<F>;
  const U object = instance_geometry<F>(scene, inst, geom, active);
  const U record =
      select(Mask<U>(active), gather<U>(scene.mesh_lights, object, Mask<U>(active)), U(kNoLight));
  return mesh_light_radiance<F>(scene.lights, record, emission,
                                {.dir = path.dir,
                                 .link = path.link,
                                 .is_delta = not_(path.pdf > 0.f),
                                 .from_camera = from_camera,
                                 .diffuse = path.diffuse},
                                active);
}

/// Returns the emission of a surface. In `lanes`, textures and graphs are evaluated at the finest
/// texture level, as in light sampling and emission sampling. In all other lanes, the result is
/// `filtered`. Filtered emission has a different mean wherever emission is cut off by an edge of
/// the mesh, or reduced by MIS weights.
template <typename F>
[[gnu::noinline, gnu::cold]] Color<F> finest_emission(const SceneView& scene, const MeshHit<F>& hit,
                                                      const Surface<F>& s, const Vec3<F>& dir,
                                                      const UInt<F>& material,
                                                      const Color<F>& filtered,
                                                      const Mask<F>& lanes) {
  const Footprint<F> finest(F(0.f));
  const auto point = [&](const Mask<F>& driven) {
    return graph_point<F>(scene, hit, s, dir, finest, driven);
  };
  return select<F>(lanes, fetch_emission<F>(scene.materials, material, s.uv, finest, point, lanes),
                   filtered);
}

/// Returns the contribution of a light whose shape a path hits, including the MIS weight.
template <typename F>
inline Color<F> shape_emission(const SceneView& scene, const ShadeSettings& settings,
                               uint32_t depth, const UInt<F>& light, const F& t,
                               const PathState<F>& path, const Mask<F>& active) {
  LightHit<F> hit = light_hit<F>(scene.lights, light, path.vertex_before(), path.dir, t, active);
  F w = bounce_weight<F>(path.pdf, hit.pdf);
  if (scene.lights.emits_paths()) [[unlikely]]
    w = joint_bounce_weight<F>(
        path.pdf, hit.pdf, not_(Mask<F>(path.pdf > 0.f)),
        F(path.ratio * emission_density<F>(scene.lights, light, path.o, path.dir, t, active)));
  if (scene.lights.has_effects) [[unlikely]]
    hit.radiance = hit.radiance * LightEffect<F>(scene.lights, light, active)
                                      .of_hit(not_(path.pdf > 0.f), depth == 0, path.diffuse);
  if (scene.lights.links.members)
    w = select(illuminates<F>(scene.lights, path.link, light, active), w, F(0.f));
  return clean<F>(path.throughput * hit.radiance * w, clamp_limit(settings, depth));
}

/// Returns the contribution of the emissive surface at a vertex. Records the emitter for AOVs.
template <typename Bsdf, typename F, uint32_t kFeatures, typename Coupling>
WAVECOMB_INLINE Color<F> emit(const Vertex<F, kFeatures>& v, const SurfaceInteraction<Bsdf, F>& at,
                              const Coupling& joint) {
  using U = UInt<F>;
  const SceneView& scene = v.scene;
  Color<F> emission = at.emission;
  // Emission that the camera sees directly or in a mirror keeps the texture filter for
  // antialiasing. No other technique samples this emission, so the filter does not bias MIS.
  if constexpr (Bsdf::kTextured)
    if (at.textured && v.depth > 0) [[unlikely]] {
      const Mask<F> varies =
          Mask<F>((at.textured_inputs & (input_bit(Input::kEmission) | kReadsGraph)) != U(0u));
      const Mask<F> lanes = v.depth > 1 ? varies : varies & (v.path.pdf > 0.f);
      if (any(v.active & lanes))
        emission = finest_emission<F>(scene, v.hit, at.s, v.path.dir, v.material, emission,
                                      v.active & lanes);
    }
  if (v.has(kMeshLights) && scene.mesh_lights) [[unlikely]]
    emission =
        mesh_light_emission<F>(scene, v.hit.inst, v.geom, emission, v.path, v.depth == 0, v.active);
  const Mask<F> emits = v.active & not_(is_black(emission));
  if (none(emits)) return Color<F>(F(0.f));
  F light_pdf(0.f);
  U light(kNoLight);
  if (scene.has_emissive_meshes) {
    const U object = instance_geometry<F>(scene, v.hit.inst, v.geom, emits);
    const U base = gather<U>(scene.emissive_lights, object, Mask<U>(emits));
    light = select(Mask<U>(base != U(kNoLight)), U(base + v.hit.prim), base);
    if (v.wants_lights()) v.aovs->emitter = light;
    const Mask<F> sampled = emits & Mask<F>(base != U(kNoLight)) & (v.path.pdf > 0.f);
    if (any(sampled))
      light_pdf = select(sampled,
                         triangle_light_pdf<F>(scene.lights, light, v.path.vertex_before(),
                                               v.path.dir, v.t, sampled),
                         F(0.f));
  }
  F w = bounce_weight<F>(v.path.pdf, light_pdf);
  if (scene.has_emissive_meshes)
    w = joint.emission_weight(v, light, emits & Mask<F>(light != U(kNoLight)), light_pdf, w);
  const Color<F> e = clean<F>(at.throughput * emission * w, clamp_limit(v.settings, v.depth));
  return select<F>(emits, e, Color<F>(F(0.f)));
}

}  // namespace wavecomb
