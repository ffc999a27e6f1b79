// SPDX-License-Identifier: Apache-2.0
/// One vertex of a path: emission, next event estimation, the BSDF's bounce and roulette. Both
/// integrators, wave and reference, run this and nothing else.
///
/// The estimator, for a path that reaches x_k with throughput T_k:
///   L += T_k Le(x_k) w_bsdf                                     (emission met by the bounce
///   before) L += T_k f |cos| Le / p_light  w_light  V                   (one light sample, balance
///   heuristic) T_{k+1} = T_k f |cos| / p_bsdf / q                          (bounce, survival
///   probability q)
/// with w_bsdf = p_bsdf / (p_bsdf + p_light), w_light = p_light / (p_bsdf + p_light) (Veach
/// 1997, 9.2).
#pragma once

#include "wavecomb/core/sampler.h"
#include "wavecomb/core/warp.h"
#include "wavecomb/light/light.h"
#include "wavecomb/material/params.h"
#include "wavecomb/material/program_table.h"
#include "wavecomb/schedule/cost_snapshot.h"
#include "wavecomb/surface/graph_point.h"
#include "wavecomb/surface/surface.h"

namespace wavecomb {

/// The settings that shading reads.
struct ShadeSettings {
  SamplerKind sampler;
  uint32_t max_depth;
  bool roulette;    ///< by throughput, after a vertex
  bool cost_aware;  ///< by throughput and cost, before a vertex
  uint32_t roulette_depth;
  float clamp_indirect;  ///< 0: off
  bool schlick_fresnel;
  bool cosine_sampling;

  explicit ShadeSettings(const Settings& s)
      : sampler(s.sampler),
        max_depth(s.max_depth),
        roulette(s.roulette == RouletteKind::kThroughput),
        cost_aware(s.roulette == RouletteKind::kCostAware),
        roulette_depth(s.roulette_depth),
        clamp_indirect(s.clamp_indirect),
        schlick_fresnel(s.schlick_fresnel),
        cosine_sampling(s.cosine_sampling) {}
};

/// What a path carries from vertex to vertex. `dir` is the ray that arrived; the cone is at the
/// hit.
template <typename F>
struct PathState {
  Vec3<F> dir;
  Color<F> throughput;
  F pdf;  ///< of the bounce before; 0: delta or camera
  F eta_scale;
  F cone_width, cone_spread;
  Vec3<F> o;         ///< origin of the ray that arrived
  UInt<F> receiver;  ///< LightReceiver::normal of the vertex before
  UInt<F> link{0u};  ///< class of the surface that the ray left, where lights are linked

  LightReceiver<F> vertex_before() const { return LightReceiver<F>(o, receiver); }
};

/// What shading a vertex gives. Lanes outside the masks hold anything.
template <typename F>
struct VertexResult {
  Color<F> emitted;    ///< to add to the path's radiance, clamped
  Mask<F> has_shadow;  ///< a shadow ray is wanted
  Vec3<F> shadow_o, shadow_d;
  F shadow_tfar;
  UInt<F> shadow_set;  ///< of shadow_set, 0 where nothing is linked
  Color<F> direct;     ///< to add where the shadow ray is free, clamped
  Mask<F> alive;       ///< the path goes on
  PathState<F> next;   ///< the next ray and what goes with it
};

/// What AOVs take from a vertex. Written to at once rather than returned: most vertices have none,
/// and values that live to the end of shading cost registers.
template <typename F>
struct VertexAovs {
  bool wants_uv = false, wants_lights = false;  ///< asked for; the others are always given
  Color<F> albedo;
  Vec3<F> normal;
  Mask<F> is_clear;  ///< nothing but what is mirrored or refracted is seen here
  Vec2<F> uv;
  UInt<F> emitter, lit_by;  ///< lights behind `emitted` and `direct`, or kNoLight
  // With wants_lights: where a light was chosen for, and the MIS weight in `direct`; weight -1: no
  // choice was made.
  Vec3<F> lit_at;
  F light_weight;
};

/// What guides a denoiser.
template <typename F>
struct Guides {
  Color<F> albedo;
  Vec3<F> normal;
};

/// That of a path that has reached a vertex: albedo, tinted by the mirrors and glass before it, and
/// normal. Both are replaced by the next vertex where this one is clear.
template <typename F>
inline Guides<F> guides_of(const VertexAovs<F>& v, const PathState<F>& path) {
  const auto tinted = [&](const F& albedo, const F& throughput) {
    // Without the scaling of radiance by indices of refraction; roulette may have made it larger.
    return F(min(F(albedo * throughput * path.eta_scale), F(1.f)));
  };
  return {{tinted(v.albedo.x, path.throughput.x), tinted(v.albedo.y, path.throughput.y),
           tinted(v.albedo.z, path.throughput.z)},
          v.normal};
}

/// c scaled down so that its luminance is at most `limit`; unchanged for limit 0 (off) and
/// NaN-free: a contribution that is not finite is dropped.
template <typename F>
inline Color<F> clean(const Color<F>& c, float limit) {
  const Mask<F> ok = is_finite(c.x) & is_finite(c.y) & is_finite(c.z);
  Color<F> r = select<F>(ok, c, Color<F>(F(0.f)));
  if (limit > 0) {
    const F y = luminance(r);
    r = r * select(y > limit, F(limit / max(y, F(1e-30f))), F(1.f));
  }
  return r;
}

/// The limit for a contribution that light brings after `bounces` scatterings: direct light is
/// free.
inline float clamp_limit(const ShadeSettings& s, uint32_t bounces) {
  return bounces > 1 ? s.clamp_indirect : 0.f;
}

/// Balance heuristic for the technique with density `a` against `b`; 1 where a was a delta (a = 0).
template <typename F>
inline F bounce_weight(const F& bsdf_pdf, const F& light_pdf) {
  return select(bsdf_pdf > 0.f,
                F(bsdf_pdf / select(bsdf_pdf > 0.f, F(bsdf_pdf + light_pdf), F(1.f))), F(1.f));
}

/// Where geometry `geom` of instance `inst` is in the arrays that have an entry for each of an
/// instance's geometries.
template <typename F>
inline UInt<F> placed_geometry(const SceneView& scene, const UInt<F>& inst, const UInt<F>& geom,
                               const Mask<F>& active) {
  using U = UInt<F>;
  constexpr uint32_t kWords = sizeof(InstanceRecord) / 4;
  return gather<U>(scene.instances,
                   inst * kWords + static_cast<uint32_t>(offsetof(InstanceRecord, emissive) / 4),
                   Mask<U>(active)) +
         geom;
}

/// The class that linking knows geometry `geom` of instance `inst` by.
template <typename F>
inline UInt<F> link_class(const SceneView& scene, const UInt<F>& inst, const UInt<F>& geom,
                          const Mask<F>& active) {
  return gather<UInt<F>>(scene.lights.links.classes, placed_geometry<F>(scene, inst, geom, active),
                         Mask<UInt<F>>(active));
}

/// What a path gets of surfaces that glow with `glow`, before MIS, where there are mesh lights.
template <typename F>
[[gnu::noinline]] Color<F> mesh_light_emission(const SceneView& scene, const UInt<F>& inst,
                                               const UInt<F>& geom, const Color<F>& glow,
                                               const PathState<F>& path, bool from_camera,
                                               const Mask<F>& active) {
  using U = UInt<F>;
  const U place = placed_geometry<F>(scene, inst, geom, active);
  const U record =
      select(Mask<U>(active), gather<U>(scene.mesh_lights, place, Mask<U>(active)), U(kNoLight));
  return mesh_light_radiance<F>(scene.lights, record, glow, path.dir, path.link,
                                not_(path.pdf > 0.f), from_camera, active);
}

/// Radiance of a light's own shape met by a path.
template <typename F>
inline Color<F> shape_emission(const SceneView& scene, const ShadeSettings& settings,
                               uint32_t depth, const UInt<F>& light, const F& t,
                               const PathState<F>& path, const Mask<F>& active) {
  const LightHit<F> hit =
      light_hit<F>(scene.lights, light, path.vertex_before(), path.dir, t, active);
  F w = bounce_weight<F>(path.pdf, hit.pdf);
  if (scene.lights.has_sampled_only)
    w *= LightEffect<F>(scene.lights, light, active).of_hit(not_(path.pdf > 0.f), depth == 0);
  if (scene.lights.links.members)
    w = select(shines_on<F>(scene.lights, path.link, light, active), w, F(0.f));
  return clean<F>(path.throughput * hit.radiance * w, clamp_limit(settings, depth));
}

/// Radiance of the environment met by a path that left the scene.
template <typename F>
inline Color<F> environment_emission(const SceneView& scene, const ShadeSettings& settings,
                                     uint32_t depth, const PathState<F>& path,
                                     const Mask<F>& active) {
  const Mask<F> delta = not_(Mask<F>(path.pdf > 0.f));
  const Color<F> le = escaped_radiance<F>(scene.lights, path.o, path.dir, path.pdf, delta, active,
                                          depth == 0, path.link);
  return clean<F>(path.throughput * le, clamp_limit(settings, depth));
}

/// Roulette ends paths whose throughput is below 1 / kRouletteGain. With a gain of 1 it saves rays
/// and costs more noise than they are worth: on Cornell, 3 has the least product of relMSE and rays
/// (docs/decisions/roulette.md).
inline constexpr float kRouletteGain = 3.f;

/// Cost-aware roulette: the probability of shading a vertex that a path has reached.
///
/// The efficiency 1 / (variance x cost) is greatest when a path goes on with a probability
/// proportional to
///   sqrt(E[contribution^2] / cost)
/// of what comes next (Bolin and Meyer 1997; Rath et al., "EARS", 2022, eq. 8). The contribution is
/// throughput times an unknown incident radiance, taken to be alike everywhere, so that
///   q = kRouletteGain T / sqrt(cost of this material / mean cost),
/// clamped to [0.05, 1]. Surfaces that shine are always shaded.
template <typename F>
inline F cost_aware_survival(const SceneView& scene, const CostSnapshot& costs,
                             const UInt<F>& material, const PathState<F>& path,
                             const Mask<F>& active) {
  using U = UInt<F>;
  const F cost = gather<F>(costs.material_ns.data(), material, active);
  const F relative = max(F(cost * (1.f / costs.mean_ns)), F(1e-3f));
  const F t = max_component(path.throughput) * path.eta_scale * kRouletteGain;
  const U flags = gather<U>(scene.materials.materials,
                            material * static_cast<uint32_t>(sizeof(MaterialRecord) / 4) +
                                static_cast<uint32_t>(offsetof(MaterialRecord, flags) / 4),
                            Mask<U>(active));
  const Mask<F> shines = Mask<F>((flags & static_cast<uint32_t>(kEmits)) != U(0u));
  return select(active & not_(shines), clamp(F(t / sqrt(relative)), F(0.05f), F(1.f)), F(1.f));
}

/// The random number that cost_aware_survival is compared with; none of the sampler's.
template <typename F>
inline F cost_aware_number(const SampleKey<F>& key, uint32_t depth) {
  using U = UInt<F>;
  const U path = hash_u32<U>(key.pixel_hash, key.sample);
  return unit_float<F>(hash_u32<U>(path, U(0x5f3759dfu + depth)));
}

/// The parameters that program `Bsdf` takes.
template <typename Bsdf, uint32_t kSlots, typename F, typename MakePoint>
WAVECOMB_INLINE auto fetch_for(const MaterialView& materials, const UInt<F>& material,
                               const Vec2<F>& uv, const F& uv_width, const MakePoint& make_point,
                               const Mask<F>& active) {
  if constexpr (Bsdf::kProgram == ProgramId::kOpenPbr)
    return fetch_openpbr<kSlots, F>(materials, material, uv, uv_width, make_point, active);
  else
    return fetch_params<kSlots, F>(materials, material, uv, uv_width, make_point, active);
}

/// Density of a bounce by cosine, with which the setting cosine_sampling replaces all lobes of a
/// program but the deltas: those keep the probability q of their choice, so it is
///   p(wi) = (1 - q) |cos theta_i| / pi
/// on wo's side.
template <typename Bsdf, typename F>
inline F cosine_bounce_pdf(const Bsdf& bsdf, const Vec3<F>& wo, const Vec3<F>& wi) {
  const F rest = max(F(1.f - bsdf.delta_probability(wo)), F(0.f));
  return select(F(wo.z * wi.z) > 0.f, F(rest * cosine_hemisphere_pdf(abs(wi.z))), F(0.f));
}

/// Shades vertex `depth` (0: the camera's first hit) of the active lanes' paths with program
/// `Bsdf`. `material` and `geom` (geometry within the instance's group) belong to `hit`; t is the
/// length of the ray.
template <typename Bsdf, typename F>
inline VertexResult<F> shade_vertex(const SceneView& scene, const ShadeSettings& settings,
                                    const SampleKey<F>& key, uint32_t depth, const MeshHit<F>& hit,
                                    const UInt<F>& geom, const F& t, const UInt<F>& material,
                                    const PathState<F>& path, VertexAovs<F>* aovs,
                                    const Mask<F>& active) {
  using U = UInt<F>;
  VertexResult<F> out;
  out.emitted = Color<F>(F(0.f));
  out.direct = Color<F>(F(0.f));
  out.has_shadow = Mask<F>(false);
  out.alive = Mask<F>(false);
  out.shadow_set = U(0u);
  out.next.link = U(0u);
  const bool wants_lights = aovs && aovs->wants_lights;
  if (wants_lights) {
    aovs->emitter = aovs->lit_by = U(kNoLight);
    aovs->light_weight = F(-1.f);
  }

  // Programs that emit read one slot more than their BSDF does.
  constexpr bool kEmits = can_emit(Bsdf::kProgram);
  constexpr uint32_t kSlots = Bsdf::kSlots | (kEmits ? slot_bit(Slot::kEmission) : 0u);

  // Texture coordinates are worked out only where a texture is read.
  const U slots = gather<U>(scene.materials.materials,
                            material * static_cast<uint32_t>(sizeof(MaterialRecord) / 4) +
                                static_cast<uint32_t>(offsetof(MaterialRecord, texture_slots) / 4),
                            Mask<U>(active));
  const Mask<F> reads_texture = active & Mask<F>((slots & (kSlots | kReadsGraph)) != U(0u));
  const bool textured = any(reads_texture);
  constexpr bool kSolid = Bsdf::kProgram != ProgramId::kDielectric;
  constexpr bool kOpaque = kSolid && Bsdf::kProgram != ProgramId::kOpenPbr;
  const bool wants_uv = textured || (aovs && aovs->wants_uv);
  const Surface<F> s = setup_surface<F>(scene, hit, path.dir, wants_uv, kSolid, active);
  const F cos_seen = max(abs(dot(path.dir, s.ng)), F(0.05f));
  const F uv_width = path.cone_width * s.uv_per_length / sqrt(cos_seen);

  MaterialView materials = scene.materials;
  materials.schlick_fresnel = settings.schlick_fresnel;
  const auto make_point = [&](const Mask<F>& lanes) {
    // Copies, as everything is that only graphs are given.
    const MeshHit<F> at = hit;
    const Surface<F> surface = s;
    const Vec3<F> dir = path.dir;
    const F width = uv_width;
    return graph_point<F>(scene, at, surface, dir, width, lanes);
  };
  const auto params =
      fetch_for<Bsdf, kSlots, F>(materials, material, s.uv, uv_width, make_point, active);
  const Bsdf bsdf(params, settings.schlick_fresnel);
  Color<F> throughput = path.throughput;
  if constexpr (Bsdf::kProgram == ProgramId::kOpenPbr)
    throughput *= openpbr_transmittance<F>(params, t, F(-dot(path.dir, s.ng)));

  if constexpr (kEmits) {
    Color<F> emission = params.emission;
    if (scene.mesh_lights) [[unlikely]]
      emission = mesh_light_emission<F>(scene, hit.inst, geom, emission, path, depth == 0, active);
    const Mask<F> emits = active & not_(is_black(emission));
    if (any(emits)) {
      F light_pdf(0.f);
      if (scene.has_emissive_meshes) {
        const U place = placed_geometry<F>(scene, hit.inst, geom, emits);
        const U base = gather<U>(scene.emissive_lights, place, Mask<U>(emits));
        if (wants_lights)
          aovs->emitter = select(Mask<U>(base == U(kNoLight)), base, U(base + hit.prim));
        const Mask<F> sampled = emits & Mask<F>(base != U(kNoLight)) & (path.pdf > 0.f);
        if (any(sampled))
          light_pdf = select(sampled,
                             triangle_light_pdf<F>(scene.lights, base + hit.prim,
                                                   path.vertex_before(), path.dir, t, sampled),
                             F(0.f));
      }
      const F w = bounce_weight<F>(path.pdf, light_pdf);
      const Color<F> e = clean<F>(throughput * emission * w, clamp_limit(settings, depth));
      out.emitted = select<F>(emits, e, Color<F>(F(0.f)));
    }
  }

  // The shading frame, along the texture where a lane reads one: a lane's frame depends on nothing
  // but its own hit, whatever its neighbours are.
  Vec3<F> n = s.ns;
  Vec3<F> tangent(F(0.f));
  if (textured) {
    tangent = select<F>(reads_texture, s.dpdu, tangent);
    const Mask<F> mapped =
        active & Mask<F>((slots & (slot_bit(Slot::kNormal) | kGraphNormal)) != U(0u));
    if (any(mapped)) {
      Vec3<F> bumped = normalize(make_frame<F>(n, tangent).to_world(params.normal));
      const F towards = select(dot(path.dir, s.ng) < 0.f, F(1.f), F(-1.f));
      const F seen = -dot(path.dir, bumped) * towards;
      bumped = select<F>(seen < 1e-3f,
                         normalize(fma(path.dir, F(-towards * (1e-3f - seen)), bumped)), bumped);
      n = select<F>(mapped, bumped, n);
    }
  }
  const Frame<F> frame = textured ? make_frame<F>(n, tangent) : make_frame<F>(n);
  const Vec3<F> wo = frame.to_local(-path.dir);

  if (aovs) {
    aovs->albedo = bsdf.albedo();
    aovs->normal = select<F>(dot(path.dir, s.ng) > 0.f, -frame.n, frame.n);
    aovs->is_clear = not_(bsdf.has_non_delta());
    if (aovs->wants_uv) aovs->uv = s.uv;
  }
  if (depth >= settings.max_depth) return out;
  if (scene.lights.links.members) [[unlikely]]
    out.next.link = link_class<F>(scene, hit.inst, geom, active);

  const Sample4<F> rl = sample_4d<F>(settings.sampler, key, light_set(depth));

  // A direction is on the side of the surface that the BSDF thinks it is on, or light leaks.
  const auto consistent = [&](const Vec3<F>& world, const Vec3<F>& local) {
    return F(dot(world, s.ng) * local.z) > 0.f;
  };

  LightReceiver<F> receiver(Vec3<F>(F(0.f)));
  if (scene.lights.by_tree) {
    // What reflects alone is lit on the side that it is seen from.
    if (kOpaque) receiver.normal = pack_normal<F>(select<F>(wo.z < 0.f, -frame.n, frame.n));
    receiver.seed = hash_u32<U>(key.pixel_hash, U(key.sample + 0x632be5abu * (depth + 1)));
  }
  const Mask<F> lit = active & bsdf.has_non_delta();
  if (Bsdf::kHasNonDelta && scene.lights.count > 0 && any(lit)) {
    // Light is gathered where reflected rays will start, so that both techniques agree.
    receiver.p = spawn_origin<F>(s, -path.dir);
    const LightSample<F> l = sample_light<F>(scene.lights, receiver, rl.x, rl.y, rl.z, lit);
    const Vec3<F> wi = frame.to_local(l.wi);
    const BsdfEval<F> e = bsdf.eval(wo, wi);
    const F bounce_pdf =
        settings.cosine_sampling && kOpaque ? cosine_bounce_pdf(bsdf, wo, wi) : e.pdf;
    F w = select(l.is_delta, F(1.f), F(l.pdf / max(F(l.pdf + bounce_pdf), F(1e-30f))));
    Color<F> f_cos = e.f_cos;
    U light(kNoLight);
    if (scene.lights.has_sampled_only || scene.lights.links.members || wants_lights) [[unlikely]]
      light = chosen_light<F>(scene.lights, receiver, rl.x, lit);
    if (scene.lights.has_sampled_only) [[unlikely]] {
      const LightEffect<F> effect(scene.lights, light, lit);
      const Color<F> diffuse = bsdf.diffuse_f_cos(wo, wi);
      f_cos = select<F>(effect.sampled_only,
                        fma(f_cos - diffuse, effect.specular, diffuse * effect.diffuse), f_cos);
      w = select(effect.sampled_only, F(1.f), w);
    }
    if (scene.lights.links.members) [[unlikely]] {
      w = select(shines_on<F>(scene.lights, out.next.link, light, lit), w, F(0.f));
      out.shadow_set = shadow_set<F>(scene.lights, light, lit);
    }
    const Color<F> c =
        clean<F>(throughput * f_cos * l.weight * w, clamp_limit(settings, depth + 1));
    out.has_shadow = lit & l.valid & consistent(l.wi, wi) & (max_component(c) > 0.f);
    out.direct = c;
    if (wants_lights) {
      aovs->lit_by = light;
      aovs->lit_at = receiver.p;
      aovs->light_weight = w;
    }
    out.shadow_o = spawn_origin<F>(s, l.wi);
    out.shadow_d = l.wi;
    out.shadow_tfar = l.distance * 0.9999f;
  }

  const Sample4<F> rb = sample_4d<F>(settings.sampler, key, bsdf_set(depth));
  BsdfSample<F> b = bsdf.sample(wo, rb.x, rb.y, rb.z);
  if (settings.cosine_sampling && kOpaque) {
    // The dissertation's way: the hemisphere by cosine, whatever the lobe that is not a delta.
    Vec3<F> wi = square_to_cosine_hemisphere(rb.y, rb.z);
    wi.z = select(wo.z < 0.f, F(-wi.z), wi.z);
    const F pdf = cosine_bounce_pdf(bsdf, wo, wi);
    const BsdfEval<F> e = bsdf.eval(wo, wi);
    const Mask<F> use = not_(b.is_delta) & (pdf > 0.f);
    const F inv = 1.f / select(pdf > 0.f, pdf, F(1.f));
    b.wi = select<F>(use, wi, b.wi);
    b.weight = select<F>(use, e.f_cos * inv, b.weight);
    b.pdf = select(use, pdf, b.pdf);
  }
  const Vec3<F> d = normalize(frame.to_world(b.wi));
  out.next.dir = d;
  out.next.throughput = throughput * b.weight;
  out.next.pdf = select(b.is_delta, F(0.f), b.pdf);
  out.next.eta_scale = path.eta_scale * b.eta * b.eta;
  out.next.receiver = receiver.normal;
  out.next.cone_width = path.cone_width;
  // A rough bounce spreads the cone: the lobe's half width is about alpha = roughness^2.
  out.next.cone_spread = max(path.cone_spread, F(b.roughness * b.roughness * 0.25f));
  out.next.o = spawn_origin<F>(s, d);
  const F largest = max_component(out.next.throughput);
  out.alive = active & (b.pdf > 0.f) & consistent(d, b.wi) & (largest > 0.f) & is_finite(largest);

  if (settings.roulette && depth + 1 >= settings.roulette_depth) {
    const F q = min(F(largest * out.next.eta_scale * kRouletteGain), F(1.f));
    out.alive = out.alive & (rl.w < q);
    out.next.throughput *= F(1.f / max(q, F(1e-10f)));
  }
  return out;
}

}  // namespace wavecomb
