// SPDX-License-Identifier: Apache-2.0
/// The step `interact`: from what a path has met to a place with a BSDF, and the frame that it is
/// seen in.
///
/// Where the way to x_k leads through what absorbs, with extinction sigma over the length t of the
/// ray, T_k <- T_k exp(-sigma t) (Beer and Lambert).
#pragma once

#include "wavecomb/core/frame.h"
#include "wavecomb/graph/hit_point.h"
#include "wavecomb/integrate/path_state.h"
#include "wavecomb/material/params.h"
#include "wavecomb/surface/facing.h"
#include "wavecomb/surface/surface.h"

namespace wavecomb {

/// Slots that a vertex of program `Bsdf` reads: those of its BSDF, and emission.
template <typename Bsdf>
inline constexpr uint32_t kVertexInputs =
    Bsdf::kInputs | (Bsdf::kEmits ? input_bit(Input::kEmission) : 0u);

/// A surface as a path has met it. Steps after this one know of it `bsdf`, `throughput` and the
/// functions, which whatever else a path meets has, too; `emit` alone is for surfaces.
template <typename Bsdf, typename F>
struct SurfaceInteraction {
  UInt<F> textured_inputs;  ///< MaterialRecord::textured_inputs
  Mask<F> reads_texture;    ///< lanes that need uv and a frame along it
  bool textured;            ///< whether any does
  Surface<F> s;
  ParamsOf<Bsdf, F> params;
  Bsdf bsdf;
  Color<F> throughput;  ///< of the path, up to the surface

  /// What the BSDF's directions are local to: z is the shading normal.
  template <uint32_t kFeatures>
  Frame<F> frame(const Vertex<F, kFeatures>& v) const;
  /// Notes for AOVs what is seen here, where they are wanted.
  template <uint32_t kFeatures>
  void note(const Vertex<F, kFeatures>& v, const Frame<F>& frame) const;
  /// The class that linking knows it by.
  template <uint32_t kFeatures>
  UInt<F> link_class(const Vertex<F, kFeatures>& v) const;
  /// Where a ray starts that leaves along `dir`.
  Vec3<F> origin(const Vec3<F>& dir) const;
  /// Whether a direction is on the side of the surface that the BSDF thinks it is on; or light
  /// leaks.
  Mask<F> is_consistent(const Vec3<F>& world, const Vec3<F>& local) const;
};

/// How textures are seen whose footprint is `width` wide: whole by the camera, where a texel alone
/// would be noise in the picture, and by one texel after a bounce, where the path is noisier than
/// the texture.
template <typename F, uint32_t kFeatures>
WAVECOMB_INLINE Footprint<F> footprint_of(const Vertex<F, kFeatures>& v, const F& width) {
  using U = UInt<F>;
  if (v.depth == 0 || v.settings.filters_textures_whole) return width;
  const U path = hash_u32<U>(v.key.pixel_hash, v.key.sample);
  return {width, hash_u32<U>(path, U(0x7e3a15c1u + v.depth))};
}

/// The surface with the values of its material. Texture coordinates are worked out only where a
/// texture or an AOV asks for them.
template <typename Bsdf, typename F, uint32_t kFeatures>
WAVECOMB_INLINE SurfaceInteraction<Bsdf, F> interact_surface(const Vertex<F, kFeatures>& v) {
  using U = UInt<F>;
  const SceneView& scene = v.scene;
  const PathState<F>& path = v.path;
  U textured_inputs(0u);
  Mask<F> reads_texture(false);
  bool textured = false;
  if constexpr (Bsdf::kTextured) {
    textured_inputs = gather_member<F>(scene.materials.materials, &MaterialRecord::textured_inputs,
                                       v.material, v.active);
    reads_texture =
        v.active & Mask<F>((textured_inputs & (kVertexInputs<Bsdf> | kReadsGraph)) != U(0u));
    textured = any(reads_texture);
  }
  const bool wants_uv = textured || (v.notes() && v.aovs->wants_uv);
  const Surface<F> s = setup_surface<F, v.has(kCurves), v.has(kMotion)>(
      scene, v.hit, path.dir, wants_uv, Bsdf::kHasTerminator, v.active);
  const F cos_seen = max(abs(dot(path.dir, s.ng)), F(0.05f));
  const Footprint<F> footprint =
      footprint_of<F>(v, F(path.cone_width * s.uv_per_length / sqrt(cos_seen)));

  MaterialView materials = scene.materials;
  const bool schlick = v.has(kExperiments) && v.settings.schlick_fresnel;
  materials.schlick_fresnel = schlick;
  const auto make_point = [&](const Mask<F>& lanes) {
    // Copies, as everything is that only graphs are given.
    const MeshHit<F> at = v.hit;
    const Surface<F> surface = s;
    const Vec3<F> dir = path.dir;
    const Footprint<F> seen = footprint;
    return graph_point<F>(scene, at, surface, dir, seen, lanes);
  };
  const auto params = fetch_for<Bsdf, kVertexInputs<Bsdf>, F>(materials, v.material, s.uv,
                                                              footprint, make_point, v.active);
  Color<F> throughput = path.throughput;
  if constexpr (Bsdf::kAbsorbs) throughput *= params.transmittance(v.t, F(-dot(path.dir, s.ng)));
  return {textured_inputs, reads_texture, textured, s, params, Bsdf(params, schlick), throughput};
}

/// What program `Bsdf` has met.
template <typename Bsdf, typename F, uint32_t kFeatures>
WAVECOMB_INLINE auto interact(const Vertex<F, kFeatures>& v) {
  if constexpr (Bsdf::kOnSurface)
    return interact_surface<Bsdf, F>(v);
  else
    return Bsdf::interact(v);
}

/// The shading frame, along the texture where a lane reads one: a lane's frame depends on nothing
/// but its own hit, whatever its neighbours are.
template <typename Bsdf, typename F>
template <uint32_t kFeatures>
WAVECOMB_INLINE Frame<F> SurfaceInteraction<Bsdf, F>::frame(const Vertex<F, kFeatures>& v) const {
  using U = UInt<F>;
  if (!Bsdf::kTextured || !textured) return make_frame<F>(s.ns);
  const Vec3<F>& dir = v.path.dir;
  Vec3<F> n = s.ns;
  const Vec3<F> tangent = select<F>(reads_texture, s.dpdu, Vec3<F>(F(0.f)));
  const Mask<F> mapped =
      v.active & Mask<F>((textured_inputs & (input_bit(Input::kNormal) | kGraphNormal)) != U(0u));
  if (any(mapped)) {
    const Vec3<F> bumped =
        normalize(make_frame<F>(n, tangent, s.handedness).to_world(params.normal));
    const Vec3<F> seen = facing_normal<F>(dir, s.ng, bumped);
    n = select<F>(mapped, reflecting_normal<F>(dir, s.ng, seen), n);
  }
  return make_frame<F>(n, tangent, s.handedness);
}

template <typename Bsdf, typename F>
template <uint32_t kFeatures>
WAVECOMB_INLINE void SurfaceInteraction<Bsdf, F>::note(const Vertex<F, kFeatures>& v,
                                                       const Frame<F>& frame) const {
  if (!v.notes()) return;
  v.aovs->albedo = bsdf.albedo();
  v.aovs->normal = select<F>(dot(v.path.dir, s.ng) > 0.f, -frame.n, frame.n);
  v.aovs->is_clear = not_(bsdf.has_non_delta());
  if (v.aovs->wants_uv) v.aovs->uv = s.uv;
}

template <typename Bsdf, typename F>
template <uint32_t kFeatures>
WAVECOMB_INLINE UInt<F> SurfaceInteraction<Bsdf, F>::link_class(
    const Vertex<F, kFeatures>& v) const {
  return wavecomb::link_class<F>(v.scene, v.hit.inst, v.geom, v.active);
}

template <typename Bsdf, typename F>
WAVECOMB_INLINE Vec3<F> SurfaceInteraction<Bsdf, F>::origin(const Vec3<F>& dir) const {
  return spawn_origin<F>(s, dir);
}

template <typename Bsdf, typename F>
WAVECOMB_INLINE Mask<F> SurfaceInteraction<Bsdf, F>::is_consistent(const Vec3<F>& world,
                                                                   const Vec3<F>& local) const {
  return F(dot(world, s.ng) * local.z) > 0.f;
}

}  // namespace wavecomb
