// SPDX-License-Identifier: Apache-2.0
/// The step `interact`: from what a path has met to a place with a BSDF, and the frame that it is
/// seen in.
///
/// Where the way to x_k leads through what absorbs, with extinction sigma over the length t of the
/// ray, T_k <- T_k exp(-sigma t) (Beer and Lambert). Where paths know what they are inside of
/// (medium/interiors.h) that is done by now, and the surface bends by the quotient of the indices
/// on its two sides.
#pragma once

#include "wavecomb/core/frame.h"
#include "wavecomb/curve/fibre.h"
#include "wavecomb/curve/splat_surface.h"
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

/// Where a path has met a surface. Texture coordinates are worked out only where a texture or an
/// AOV asks for them.
template <typename Bsdf, typename F>
struct SurfacePlace {
  UInt<F> textured_inputs;  ///< MaterialRecord::textured_inputs
  Mask<F> reads_texture;    ///< lanes that need uv and a frame along it
  bool textured;            ///< whether any does
  Surface<F> s;

  template <uint32_t kFeatures>
  explicit SurfacePlace(const Vertex<F, kFeatures>& v);
};

/// What it is made of.
template <typename Bsdf, typename F>
struct SurfaceLook {
  Bsdf bsdf;
  Color<F> throughput;  ///< of the path, up to the surface
  Color<F> emission;    ///< where the program emits
  Vec3<F> normal;       ///< in tangent space, where the program reads textures
};

/// A surface as a path has met it. Steps after this one know of it `bsdf`, `throughput` and the
/// functions, which whatever else a path meets has, too; `emit` alone is for surfaces.
template <typename Bsdf, typename F>
struct SurfaceInteraction : SurfacePlace<Bsdf, F>, SurfaceLook<Bsdf, F> {
  using SurfacePlace<Bsdf, F>::s;
  using SurfaceLook<Bsdf, F>::bsdf;

  template <uint32_t kFeatures>
  explicit SurfaceInteraction(const Vertex<F, kFeatures>& v);

  /// What the BSDF's directions are local to: z is the shading normal.
  template <uint32_t kFeatures>
  Frame<F> frame(const Vertex<F, kFeatures>& v) const;
  /// The same as paths from the lights have it, which do not know yet who looks: with the normal
  /// that nobody's look has bent.
  template <uint32_t kFeatures>
  Frame<F> unbent_frame(const Vertex<F, kFeatures>& v) const;
  /// Lanes where the normal is bent towards who looks along `dir`. What is seen there is the
  /// camera's paths' to find.
  template <uint32_t kFeatures>
  Mask<F> bends(const Vertex<F, kFeatures>& v, const Frame<F>& unbent, const Vec3<F>& dir) const;
  /// Notes for AOVs what is seen here, where they are wanted.
  template <uint32_t kFeatures>
  void note(const Vertex<F, kFeatures>& v, const Frame<F>& frame) const;
  /// The class that linking knows it by.
  template <uint32_t kFeatures>
  UInt<F> link_class(const Vertex<F, kFeatures>& v) const;
  /// Where a ray starts that leaves along `dir`.
  Vec3<F> origin(const Vec3<F>& dir) const;
  /// Where a ray of a light path starts that leaves along `dir` (steps/connection.h).
  Vec3<F> light_path_origin(const Vec3<F>& dir) const;
  /// Whether a direction is on the side of the surface that the BSDF thinks it is on; or light
  /// leaks.
  Mask<F> is_consistent(const Vec3<F>& world, const Vec3<F>& local) const;

 private:
  /// Lanes whose normal is of a map.
  template <uint32_t kFeatures>
  Mask<F> mapped(const Vertex<F, kFeatures>& v) const;
  /// The normal of the map, about the normal `n`.
  Vec3<F> bumped(const Vec3<F>& n, const Vec3<F>& tangent) const;
  Vec3<F> tangent() const { return select<F>(this->reads_texture, s.dpdu, Vec3<F>(F(0.f))); }
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

namespace detail {

template <typename Bsdf, typename F, uint32_t kFeatures>
WAVECOMB_INLINE UInt<F> textured_inputs_of(const Vertex<F, kFeatures>& v) {
  if constexpr (!Bsdf::kTextured) return UInt<F>(0u);
  return gather_member<F>(v.scene.materials.materials, &MaterialRecord::textured_inputs, v.material,
                          v.active);
}

/// What is made of parameters is made here, so that kernels keep none that they do not read.
template <typename Bsdf, typename F, uint32_t kFeatures>
WAVECOMB_INLINE SurfaceLook<Bsdf, F> look_at(const Vertex<F, kFeatures>& v, const Surface<F>& s,
                                             bool textured) {
  const PathState<F>& path = v.path;
  Footprint<F> footprint(F(0.f));
  if (textured) {
    const F cos_seen = max(abs(dot(path.dir, s.ng)), F(0.05f));
    footprint = footprint_of<F>(v, F(path.cone_width * s.uv_per_length / sqrt(cos_seen)));
  }
  const auto make_point = [&](const Mask<F>& lanes) {
    // Copies, as everything is that only graphs are given.
    const MeshHit<F> at = v.hit;
    const Surface<F> surface = s;
    const Vec3<F> dir = path.dir;
    const Footprint<F> seen = footprint;
    return graph_point<F>(v.scene, at, surface, dir, seen, lanes);
  };
  const Vec2<F> uv = s.uv;
  auto params = fetch_for<Bsdf, kVertexInputs<Bsdf>, F>(v.scene.materials, v.material, uv,
                                                        footprint, make_point, v.active);
  if constexpr (Bsdf::kOnSplats && Vertex<F, kFeatures>::has(kCurves))
    if (v.scene.has_curves) [[unlikely]]
      params.emission *= splat_radiance<F>(v.scene, v.hit, path.dir, v.active);
  Color<F> throughput = path.throughput;
  if (v.knows_inside()) [[unlikely]] {
    if constexpr (Bsdf::kReadsIor && Bsdf::kTransmits)
      params.ior = clamp(F(params.ior / select(path.outer > 0.f, path.outer, F(1.f))),
                         F(1.f / kMaxIor), F(kMaxIor));
  } else if constexpr (Bsdf::kAbsorbs) {
    throughput *= params.transmittance(v.t, F(-dot(path.dir, s.ng)));
  }
  const Vec3<F> none(F(0.f));
  return {Bsdf(params, v.has(kExperiments) && v.settings.schlick_fresnel), throughput,
          Bsdf::kEmits ? params.emission : none, Bsdf::kTextured ? params.normal : none};
}

}  // namespace detail

template <typename Bsdf, typename F>
template <uint32_t kFeatures>
WAVECOMB_INLINE SurfacePlace<Bsdf, F>::SurfacePlace(const Vertex<F, kFeatures>& v)
    : textured_inputs(detail::textured_inputs_of<Bsdf, F>(v)),
      reads_texture(v.active & Mask<F>((textured_inputs & (kVertexInputs<Bsdf> | kReadsGraph)) !=
                                       UInt<F>(0u))),
      textured(Bsdf::kTextured && any(reads_texture)),
      s(setup_surface<F, Vertex<F, kFeatures>::has(kCurves), Vertex<F, kFeatures>::has(kMotion)>(
          v.scene, v.hit, v.path.dir, textured || Bsdf::kOnFibre || (v.notes() && v.aovs->wants_uv),
          Bsdf::kHasTerminator, v.active)) {}

template <typename Bsdf, typename F>
template <uint32_t kFeatures>
WAVECOMB_INLINE SurfaceInteraction<Bsdf, F>::SurfaceInteraction(const Vertex<F, kFeatures>& v)
    : SurfacePlace<Bsdf, F>(v),
      SurfaceLook<Bsdf, F>(detail::look_at<Bsdf, F>(v, s, this->textured)) {}

/// What program `Bsdf` has met.
template <typename Bsdf, typename F, uint32_t kFeatures>
WAVECOMB_INLINE auto interact(const Vertex<F, kFeatures>& v) {
  if constexpr (Bsdf::kOnSurface)
    return SurfaceInteraction<Bsdf, F>(v);
  else
    return Bsdf::interact(v);
}

template <typename Bsdf, typename F>
template <uint32_t kFeatures>
WAVECOMB_INLINE Mask<F> SurfaceInteraction<Bsdf, F>::mapped(const Vertex<F, kFeatures>& v) const {
  return v.active & Mask<F>((this->textured_inputs & (input_bit(Input::kNormal) | kGraphNormal)) !=
                            UInt<F>(0u));
}

template <typename Bsdf, typename F>
WAVECOMB_INLINE Vec3<F> SurfaceInteraction<Bsdf, F>::bumped(const Vec3<F>& n,
                                                            const Vec3<F>& tangent) const {
  return normalize(make_frame<F>(n, tangent, s.handedness).to_world(this->normal));
}

/// The shading frame, along the texture where a lane reads one: a lane's frame depends on nothing
/// but its own hit, whatever its neighbours are.
template <typename Bsdf, typename F>
template <uint32_t kFeatures>
WAVECOMB_INLINE Frame<F> SurfaceInteraction<Bsdf, F>::frame(const Vertex<F, kFeatures>& v) const {
  if constexpr (Bsdf::kOnFibre) return fibre_frame<F>(v.scene, v.hit, s, v.path.dir, v.active);
  if (!Bsdf::kTextured || !this->textured) return make_frame<F>(s.ns);
  const Vec3<F>& dir = v.path.dir;
  Vec3<F> n = s.ns;
  const Vec3<F> along = tangent();
  if (const Mask<F> by_map = mapped(v); any(by_map)) {
    const Vec3<F> seen = facing_normal<F>(dir, s.ng, bumped(n, along));
    n = select<F>(by_map, reflecting_normal<F>(dir, s.ng, seen), n);
  }
  return make_frame<F>(n, along, s.handedness);
}

template <typename Bsdf, typename F>
template <uint32_t kFeatures>
WAVECOMB_INLINE Frame<F> SurfaceInteraction<Bsdf, F>::unbent_frame(
    const Vertex<F, kFeatures>& v) const {
  if (!Bsdf::kTextured || !this->textured) return make_frame<F>(s.unbent);
  Vec3<F> n = s.unbent;
  const Vec3<F> along = tangent();
  if (const Mask<F> by_map = mapped(v); any(by_map)) n = select<F>(by_map, bumped(n, along), n);
  return make_frame<F>(n, along, s.handedness);
}

template <typename Bsdf, typename F>
template <uint32_t kFeatures>
WAVECOMB_INLINE Mask<F> SurfaceInteraction<Bsdf, F>::bends(const Vertex<F, kFeatures>& v,
                                                           const Frame<F>& unbent,
                                                           const Vec3<F>& dir) const {
  const auto differ = [](const Vec3<F>& a, const Vec3<F>& b) {
    return Mask<F>(a.x != b.x) | Mask<F>(a.y != b.y) | Mask<F>(a.z != b.z);
  };
  Mask<F> bent = differ(facing_normal<F>(dir, s.ng, s.unbent), s.unbent);
  if (!Bsdf::kTextured || !this->textured) return bent;
  if (const Mask<F> by_map = mapped(v); any(by_map)) {
    const Vec3<F> seen = facing_normal<F>(dir, s.ng, unbent.n);
    bent = bent | (by_map & differ(reflecting_normal<F>(dir, s.ng, seen), unbent.n));
  }
  return bent;
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
WAVECOMB_INLINE Vec3<F> SurfaceInteraction<Bsdf, F>::light_path_origin(const Vec3<F>& dir) const {
  return clear_origin<F>(s, dir);
}

template <typename Bsdf, typename F>
WAVECOMB_INLINE Mask<F> SurfaceInteraction<Bsdf, F>::is_consistent(const Vec3<F>& world,
                                                                   const Vec3<F>& local) const {
  if constexpr (Bsdf::kOnFibre) return Mask<F>(true);
  return F(dot(world, s.ng) * local.z) > 0.f;
}

}  // namespace wavecomb
