// SPDX-License-Identifier: Apache-2.0
/// Events of camera paths. Waves and the reference integrator call the functions of `PathEvents`
/// for each event of a path: its start, its first hit, its ray segments through media, its
/// vertices, and each contribution of light. The functions update the radiance of the path, its
/// AOVs, and the stored vertices that later train the guiding field.
#pragma once

#include "wavecomb/aov/path_aovs.h"
#include "wavecomb/aov/screen_motion.h"
#include "wavecomb/path/media.h"
#include "wavecomb/path/path_history.h"
#include "wavecomb/path/steps/escape.h"

namespace wavecomb {

/// End points of camera rays in world space, and the shutter times of the rays.
template <typename F>
struct RayEnd {
  const UInt<F>& slot;
  Vec3<F> p;
  F time;
};

/// Shaded vertex, with the AOV values that shading has provided.
template <typename F>
struct VertexEvent {
  uint32_t depth;  ///< 0 at the first vertex
  const UInt<F>& slot;
  const SampleKey<F>& key;
  const ShadedVertex<F>& at;
  const VertexAovs<F>& aovs;
};

/// Returns the volume, or the mesh that a medium fills, and the material of scattering events in
/// the lanes `stopped`. `material` is the material index that free-flight sampling returned.
/// `stacks` points to the MediumStackRow of each slot; it may be null if the scene has no nested
/// dielectrics.
template <typename F>
VolumeHit<F> volume_hit(const SceneView& scene, const float* stacks, const UInt<F>& slot,
                        const UInt<F>& material, const Mask<F>& stopped) {
  using U = UInt<F>;
  VolumeHit<F> hit{material - scene.volumes.first_material, U(0u), material, Mask<F>(false)};
  if (!scene.nested_media.media) return hit;
  hit.in_mesh = stopped & Mask<F>(material == U(scene.nested_media.event_material));
  const auto of_path = [&](auto member) {
    return gather_field<F>(stacks, member, slot, hit.in_mesh);
  };
  hit.object = of_path(&MediumStackRow<float>::object);
  hit.material =
      select(Mask<U>(hit.in_mesh), of_path(&MediumStackRow<float>::medium), hit.material);
  return hit;
}

/// Receiver of the events of camera paths. `active` marks the lanes of the event; the slots of
/// active lanes must be distinct.
///
/// Contract: the object refers to the buffers of one wave or reference integrator, which must
/// outlive the object.
class PathEvents {
 public:
  /// `radiance` points to the RadianceRow of each slot.
  WAVECOMB_INLINE PathEvents(const SceneView& scene, const CameraSetup& camera,
                             const PathAovs& aovs, PathHistory& history, float* radiance)
      : scene_(scene), camera_(camera), aovs_(aovs), history_(history), radiance_(radiance) {}

  // ---- before the first vertex ------------------------------------------------------------------

  /// Records the start of camera rays. `r` contains the sample values with which the rays were
  /// generated.
  template <typename F>
  void begin(const Sample4<F>& r, const UInt<F>& slot, const Mask<F>& active) const {
    aovs_.begin<F>(camera_, r, slot, active);
  }

  /// Returns whether some AOV needs first hits. If not, the functions hit_light(), hit_surface()
  /// and hit_volume() do nothing.
  bool wants_hits() const { return aovs_.wants_hits() || aovs_.wants_alpha(); }

  /// Records camera rays that hit the shapes of the lights `light`.
  template <typename F>
  void hit_light(const RayEnd<F>& end, const UInt<F>& light, const Mask<F>& active) const {
    cover<F>(end.slot, active);
    if (!aovs_.wants_hits()) return;
    aovs_.hit_light<F>(camera_, end.slot, end.p, end.time, light, active);
    if (aovs_.wants_motion()) [[unlikely]]
      aovs_.move<F>(
          end.slot,
          screen_motion_of_light<F>(scene_.lights, camera_, light, end.p, end.time, active),
          active);
  }

  /// Records camera rays with the directions `dir` that hit surfaces. `hit` is needed only for the
  /// motion of the surfaces, and its time is not used.
  template <typename F>
  void hit_surface(const RayEnd<F>& end, const Vec3<F>& dir, const FirstSurface<F>& surface,
                   const MeshHit<F>& hit, const Mask<F>& active) const {
    cover<F>(end.slot, active);
    if (!aovs_.wants_hits()) return;
    aovs_.hit_surface<F>(camera_, end.slot, end.p, end.time, surface, active);
    if (aovs_.wants_motion()) [[unlikely]]
      aovs_.move<F>(end.slot, screen_motion_of_hit<F>(scene_, camera_, hit, dir, active), active);
  }

  /// Records camera rays that scatter in volumes or media.
  template <typename F>
  void hit_volume(const RayEnd<F>& end, const VolumeHit<F>& hit, const Mask<F>& active) const {
    cover<F>(end.slot, active);
    if (aovs_.wants_hits()) aovs_.hit_volume<F>(camera_, end.slot, end.p, end.time, hit, active);
  }

  // ---- path segments and vertices ---------------------------------------------------------------

  /// Records ray segments through volumes and media. `throughput` is the throughput of the paths at
  /// the ends of the segments.
  template <typename F>
  void segment(uint32_t depth, const UInt<F>& slot, const Flight<F>& flight,
               const Color<F>& throughput, const Mask<F>& active) const {
    if (depth == 0 && aovs_.wants_transmittance())
      aovs_.pass<F>(slot,
                    select<F>(flight.stopped | flight.has_scattered, Color<F>(F(0.f)), throughput),
                    active);
    if (!aovs_.expressions()) return;
    const Mask<F> has_scattered = active & flight.has_scattered;
    if (any(has_scattered)) aovs_.expressions().template walk<F>(slot, has_scattered);
  }

  /// Records `q`, the survival probability of Russian roulette before the vertex at `depth`.
  template <typename F>
  void survive(uint32_t depth, const UInt<F>& slot, const F& q, const Mask<F>& active) const {
    aovs_.survive<F>(depth, slot, q, active);
  }

  /// Adds the emission at shaded vertices, and records the vertices. Returns the light group of
  /// each lane's light sample, which light<Technique::kLightSample>() needs. `kRecords` is false in
  /// kernels that are compiled without AOVs.
  template <bool kRecords, typename F>
  WAVECOMB_INLINE UInt<F> vertex(const VertexEvent<F>& e, const Mask<F>& active) const {
    const VertexResult<F>& v = e.at.result;
    UInt<F> group(0u);
    const Mask<F> emits = active & not_(is_black(v.emitted));
    if (any(emits)) {
      if constexpr (kRecords)
        light<Technique::kEmitter, F>(
            {e.depth, e.slot, v.emitted}, [&] { return e.aovs.emitter; }, emits);
      else
        add_radiance<F>(radiance_, e.slot, v.emitted, emits);
    }
    if constexpr (kRecords) {
      if (aovs_.wants_lights()) {
        group = aovs_.group_of<F>(e.aovs.light_id, v.has_shadow);
        if (aovs_.expressions())
          aovs_.expressions().template scatter<F>(e.depth, e.slot, e.key, e.aovs, v.has_shadow,
                                                  active & (v.alive | v.has_shadow));
      }
      if (aovs_.wants_vertex(e.depth)) aovs_.vertex<F>(e.depth, e.slot, e.aovs, e.at.path, active);
      if (history_) history_.vertex<F>(e.depth, e.slot, e.at, radiance_, active);
    }
    return group;
  }

  /// Records that the radiance of the paths in the first `slots` slots includes the emission at the
  /// vertex at `depth`, but not its light sample.
  void end_depth(uint32_t depth, size_t slots) const { aovs_.end_depth(depth, radiance_, slots); }
  /// Records that the paths in the first `slots` slots have ended before the vertex at `depth`.
  void end_path(uint32_t depth, size_t slots) const { aovs_.end_path(depth, radiance_, slots); }

  // ---- light ------------------------------------------------------------------------------------

  /// Adds contributions of light that paths found by `kTechnique`. `source()` returns the light of
  /// each lane, or kNoLight; for light samples, it returns the result of vertex(). `source` is
  /// called only if an AOV needs the light.
  template <Technique kTechnique, typename F, typename Source>
  WAVECOMB_INLINE void light(const LightEvent<F>& e, const Source& source,
                             const Mask<F>& active) const {
    add_radiance<F>(radiance_, e.slot, e.c, active);
    if (aovs_.wants(kTechnique)) [[unlikely]]
      aovs_.light<kTechnique, F>(e, source(), active);
    if constexpr (kTechnique == Technique::kLightSample)
      if (history_) [[unlikely]]
        history_.light<F>(e.depth, e.slot, e.c, active);
  }

  /// Adds the light of the environment to paths that leave the scene after `depth` vertices. `path`
  /// is their state at the last vertex.
  template <typename F>
  WAVECOMB_INLINE void environment(const ShadeSettings& settings, uint32_t depth,
                                   const UInt<F>& slot, const PathState<F>& path,
                                   const Mask<F>& active) const {
    if (!settings.adds_environment(depth)) return;
    const Color<F> c = environment_emission<F>(scene_, settings, depth, path, active);
    add_radiance<F>(radiance_, slot, c, active & not_(is_black(c)));
    if (aovs_.wants(Technique::kEmitter)) [[unlikely]]
      aovs_.environment<F>(scene_, settings, {depth, slot, c}, path, active);
  }

 private:
  /// Sets alpha to 1.
  template <typename F>
  void cover(const UInt<F>& slot, const Mask<F>& active) const {
    if (aovs_.wants_alpha()) aovs_.cover<F>(slot, active);
  }

  const SceneView& scene_;
  const CameraSetup& camera_;
  const PathAovs& aovs_;
  PathHistory& history_;
  float* radiance_;
};

}  // namespace wavecomb
