// SPDX-License-Identifier: Apache-2.0
/// The step `interact`: turns a hit into a shading point with a BSDF and a shading frame.
///
/// If the surface transmits straight with the probability T, then T_k <- T_k / (1 - T)
/// (material/lobes/straight_transmission.h).
///
/// If the ray to x_k, of length t, passes through an absorbing material with extinction sigma, then
/// T_k <- T_k exp(-sigma t) (Beer and Lambert). With nested dielectrics
/// (medium/nested/nested_media.h), absorption was applied earlier, and the surface refracts by the
/// ratio of the indices of refraction on its two sides.
#pragma once

#include "wavecomb/core/frame.h"
#include "wavecomb/geometry/hit/fibre_frame.h"
#include "wavecomb/geometry/hit/gaussian_splat_surface.h"
#include "wavecomb/geometry/hit/shading_normal.h"
#include "wavecomb/geometry/hit/surface.h"
#include "wavecomb/material/inputs/graph_inputs.h"
#include "wavecomb/material/lobes/straight_transmission.h"
#include "wavecomb/material/params.h"
#include "wavecomb/path/path_state.h"

namespace wavecomb {

/// Material inputs that a vertex with shading program `Bsdf` reads: the inputs of the BSDF, and
/// emission.
template <typename Bsdf>
inline constexpr uint32_t kVertexInputs =
    Bsdf::kInputs | (Bsdf::kEmits ? input_bit(Input::kEmission) : 0u);

/// Hit point of a path. Computes texture coordinates only if a texture or an AOV needs them.
template <typename Bsdf, typename F>
struct SurfaceHitPoint {
  UInt<F> textured_inputs;  ///< MaterialRecord::textured_inputs
  Mask<F> reads_texture;    ///< lanes that need texture coordinates and a tangent along u
  bool textured;            ///< whether any lane needs texture coordinates
  Surface<F> s;

  template <uint32_t kFeatures>
  explicit SurfaceHitPoint(const Vertex<F, kFeatures>& v);
};

/// Material lookup at a hit point.
template <typename Bsdf, typename F>
struct MaterialLookup {
  Bsdf bsdf;
  Color<F> throughput;  ///< throughput on arrival at the surface
  Color<F> emission;    ///< emission of the surface; used only if the program emits
  Vec3<F> normal;       ///< normal in tangent space, if the program reads textures
};

/// Shading point on a surface. Later steps use only `bsdf`, `throughput` and the member functions,
/// so that volume events can provide the same interface. The step `emit` runs only for surfaces.
template <typename Bsdf, typename F>
struct SurfaceInteraction : SurfaceHitPoint<Bsdf, F>, MaterialLookup<Bsdf, F> {
  using SurfaceHitPoint<Bsdf, F>::s;
  using MaterialLookup<Bsdf, F>::bsdf;

  template <uint32_t kFeatures>
  explicit SurfaceInteraction(const Vertex<F, kFeatures>& v);

  /// Returns the frame of the BSDF's local directions, in which z is the shading normal.
  template <uint32_t kFeatures>
  Frame<F> frame(const Vertex<F, kFeatures>& v) const;
  /// Returns the shading frame for an unknown viewing direction: uses the normal without the
  /// view-dependent adjustment.
  template <uint32_t kFeatures>
  Frame<F> unadjusted_frame(const Vertex<F, kFeatures>& v) const;
  /// Returns the lanes whose shading normal is adjusted to the viewing direction `dir`.
  template <uint32_t kFeatures>
  Mask<F> is_adjusted(const Vertex<F, kFeatures>& v, const Frame<F>& unadjusted,
                      const Vec3<F>& dir) const;
  /// Records albedo, normal and texture coordinates for the AOVs of the render.
  template <uint32_t kFeatures>
  void record_aovs(const Vertex<F, kFeatures>& v, const Frame<F>& frame) const;
  /// Returns the link class of the surface.
  template <uint32_t kFeatures>
  UInt<F> link_class(const Vertex<F, kFeatures>& v) const;
  /// Returns the origin of a ray that leaves along `dir`.
  Vec3<F> origin(const Vec3<F>& dir) const;
  /// Returns the origin of a ray that leaves along `dir`, without the terminator offset.
  Vec3<F> clear_origin(const Vec3<F>& dir) const;
  /// Returns whether a direction is on the same side of the surface by the geometric normal and by
  /// the shading normal. Other directions would leak light.
  Mask<F> is_consistent(const Vec3<F>& world, const Vec3<F>& local) const;

 private:
  /// Returns the lanes with a normal map.
  template <uint32_t kFeatures>
  Mask<F> mapped(const Vertex<F, kFeatures>& v) const;
  /// Returns the mapped normal, given the shading normal `n`.
  Vec3<F> bumped(const Vec3<F>& n, const Vec3<F>& tangent) const;
  Vec3<F> tangent() const { return select<F>(this->reads_texture, s.dpdu, Vec3<F>(F(0.f))); }
};

/// Returns the footprint of a texture lookup of the given width. Lookups at the first hit filter
/// the whole footprint, since single texels would be visible as noise. Lookups after a bounce read
/// a single random texel, since the path itself adds more noise than a single texel does. The
/// setting `filters_all_lookups` filters all lookups.
template <typename F, uint32_t kFeatures>
WAVECOMB_INLINE Footprint<F> footprint_of(const Vertex<F, kFeatures>& v, const F& width) {
  using U = UInt<F>;
  if (v.depth == 0 || v.settings.filters_all_lookups) return width;
  const U path = path_hash<F>(v.key);
  return {width, hash_u32<U>(path, U(0x7e3a15c1u + v.depth))};
}

namespace detail {

template <typename Bsdf, typename F, uint32_t kFeatures>
WAVECOMB_INLINE UInt<F> textured_inputs_of(const Vertex<F, kFeatures>& v) {
  if constexpr (!Bsdf::kTextured) return UInt<F>(0u);
  return gather_member<F>(v.scene.materials.materials, &MaterialRecord::textured_inputs, v.material,
                          v.active);
}

/// Returns the shading point of a vertex.
template <typename Bsdf, typename F, uint32_t kFeatures>
WAVECOMB_INLINE Surface<F> surface_of(const Vertex<F, kFeatures>& v, bool with_uv) {
  if constexpr (Vertex<F, kFeatures>::kInlines)
    return setup_plain_surface<F>(v.scene, v.hit, v.path.dir, with_uv, Bsdf::kHasTerminator,
                                  v.active);
  else
    return setup_surface<F>(v.scene, v.hit, v.path.dir, with_uv, Bsdf::kHasTerminator, v.active);
}

/// Looks up the material and constructs the BSDF in one function, so that kernels do not store
/// parameters that they never read.
template <typename Bsdf, typename F, uint32_t kFeatures>
WAVECOMB_INLINE MaterialLookup<Bsdf, F> look_up_material(const Vertex<F, kFeatures>& v,
                                                         const Surface<F>& s, bool textured) {
  const PathState<F>& path = v.path;
  Footprint<F> footprint(F(0.f));
  if (textured) {
    const F view_cosine = max(abs(dot(path.dir, s.ng)), F(0.05f));
    footprint = footprint_of<F>(v, F(path.cone_width * s.uv_per_length / sqrt(view_cosine)));
  }
  const auto make_point = [&](const Mask<F>& lanes) {
    // Copy the inputs of value graphs, so that the compiler keeps the originals in registers for
    // materials without graphs.
    const MeshHit<F> at = v.hit;
    const Surface<F> surface = s;
    const Vec3<F> dir = path.dir;
    const Footprint<F> lookup_footprint = footprint;
    return graph_point<F>(v.scene, at, surface, dir, lookup_footprint, lanes);
  };
  const Vec2<F> uv = s.uv;
  auto params = fetch_for<Bsdf, kVertexInputs<Bsdf>, F>(v.scene.materials, v.material, uv,
                                                        footprint, make_point, v.active);
  if constexpr (Bsdf::kOnGaussianSplats && Vertex<F, kFeatures>::has(kCurves))
    if (v.scene.has_curves) [[unlikely]]
      params.emission *= gaussian_splat_radiance<F>(v.scene, v.hit, path.dir, v.active);
  Color<F> throughput = path.throughput;
  if (v.has_medium_stack()) [[unlikely]] {
    if constexpr (Bsdf::kReadsIor && Bsdf::kTransmits)
      params.ior = clamp(F(params.ior / select(path.outer > 0.f, path.outer, F(1.f))),
                         F(1.f / kMaxIor), F(kMaxIor));
  } else if constexpr (Bsdf::kAbsorbs) {
    throughput *= params.transmittance(v.t, F(-dot(path.dir, s.ng)));
  }
  if constexpr (Bsdf::kTransmitsStraight) {
    const Mask<F> clear = v.active & transmits_straight<F>(params.flags);
    if (any(clear)) {
      const auto cosine = [&](const Mask<F>& /*lanes*/) {
        return unadjusted_cosine<F>(s.unadjusted, path.dir);
      };
      const StraightTransmission<F> straight =
          straight_transmission<F>(v.scene, v.hit, v.material, cosine, clear);
      params.opacity = select(clear, straight.opacity, params.opacity);
      const F stopped = max(F(1.f - straight.probability), F(1e-6f));
      throughput = select<F>(clear, throughput * F(1.f / stopped), throughput);
    }
  }
  const Vec3<F> none(F(0.f));
  return {Bsdf(params, v.has(kExperiments) && v.settings.schlick_fresnel), throughput,
          Bsdf::kEmits ? params.emission : none, Bsdf::kTextured ? params.normal : none};
}

}  // namespace detail

template <typename Bsdf, typename F>
template <uint32_t kFeatures>
WAVECOMB_INLINE SurfaceHitPoint<Bsdf, F>::SurfaceHitPoint(const Vertex<F, kFeatures>& v)
    : textured_inputs(detail::textured_inputs_of<Bsdf, F>(v)),
      reads_texture(v.active & Mask<F>((textured_inputs & (kVertexInputs<Bsdf> | kReadsGraph)) !=
                                       UInt<F>(0u))),
      textured(Bsdf::kTextured && any(reads_texture)),
      s(detail::surface_of<Bsdf, F>(
          v, textured || Bsdf::kOnFibre || (v.recorded_aovs() && v.aovs->wants_uv))) {}

template <typename Bsdf, typename F>
template <uint32_t kFeatures>
WAVECOMB_INLINE SurfaceInteraction<Bsdf, F>::SurfaceInteraction(const Vertex<F, kFeatures>& v)
    : SurfaceHitPoint<Bsdf, F>(v),
      MaterialLookup<Bsdf, F>(detail::look_up_material<Bsdf, F>(v, s, this->textured)) {}

/// Returns the shading point or volume event of program `Bsdf`.
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

/// In lanes that read a texture, aligns the frame to the texture. The frame of a lane depends only
/// on the lane's hit, not on other lanes.
template <typename Bsdf, typename F>
template <uint32_t kFeatures>
WAVECOMB_INLINE Frame<F> SurfaceInteraction<Bsdf, F>::frame(const Vertex<F, kFeatures>& v) const {
  if constexpr (Bsdf::kOnFibre) return fibre_frame<F>(v.scene, v.hit, s, v.path.dir, v.active);
  if (!Bsdf::kTextured || !this->textured) return make_frame<F>(s.ns);
  const Vec3<F>& dir = v.path.dir;
  Vec3<F> n = s.ns;
  const Vec3<F> along = tangent();
  if (const Mask<F> by_map = mapped(v); any(by_map)) {
    const Vec3<F> facing = facing_normal<F>(dir, s.ng, bumped(n, along));
    n = select<F>(by_map, reflecting_normal<F>(dir, s.ng, facing), n);
  }
  return make_frame<F>(n, along, s.handedness);
}

template <typename Bsdf, typename F>
template <uint32_t kFeatures>
WAVECOMB_INLINE Frame<F> SurfaceInteraction<Bsdf, F>::unadjusted_frame(
    const Vertex<F, kFeatures>& v) const {
  if (!Bsdf::kTextured || !this->textured) return make_frame<F>(s.unadjusted);
  Vec3<F> n = s.unadjusted;
  const Vec3<F> along = tangent();
  if (const Mask<F> by_map = mapped(v); any(by_map)) n = select<F>(by_map, bumped(n, along), n);
  return make_frame<F>(n, along, s.handedness);
}

template <typename Bsdf, typename F>
template <uint32_t kFeatures>
WAVECOMB_INLINE Mask<F> SurfaceInteraction<Bsdf, F>::is_adjusted(const Vertex<F, kFeatures>& v,
                                                                 const Frame<F>& unadjusted,
                                                                 const Vec3<F>& dir) const {
  const auto differ = [](const Vec3<F>& a, const Vec3<F>& b) {
    return Mask<F>(a.x != b.x) | Mask<F>(a.y != b.y) | Mask<F>(a.z != b.z);
  };
  Mask<F> adjusted = differ(facing_normal<F>(dir, s.ng, s.unadjusted), s.unadjusted);
  if (!Bsdf::kTextured || !this->textured) return adjusted;
  if (const Mask<F> by_map = mapped(v); any(by_map)) {
    const Vec3<F> facing = facing_normal<F>(dir, s.ng, unadjusted.n);
    adjusted = adjusted | (by_map & differ(reflecting_normal<F>(dir, s.ng, facing), unadjusted.n));
  }
  return adjusted;
}

template <typename Bsdf, typename F>
template <uint32_t kFeatures>
WAVECOMB_INLINE void SurfaceInteraction<Bsdf, F>::record_aovs(const Vertex<F, kFeatures>& v,
                                                              const Frame<F>& frame) const {
  if (!v.recorded_aovs()) return;
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
WAVECOMB_INLINE Vec3<F> SurfaceInteraction<Bsdf, F>::clear_origin(const Vec3<F>& dir) const {
  return wavecomb::clear_origin<F>(s, dir);
}

template <typename Bsdf, typename F>
WAVECOMB_INLINE Mask<F> SurfaceInteraction<Bsdf, F>::is_consistent(const Vec3<F>& world,
                                                                   const Vec3<F>& local) const {
  if constexpr (Bsdf::kOnFibre) return Mask<F>(true);
  return F(dot(world, s.ng) * local.z) > 0.f;
}

}  // namespace wavecomb
