// SPDX-License-Identifier: Apache-2.0
/// State that a path carries from vertex to vertex, and the inputs and outputs of the steps of a
/// vertex (steps/).
#pragma once

#include "wavecomb/core/rows/fields.h"
#include "wavecomb/core/sampler.h"
#include "wavecomb/core/vec.h"
#include "wavecomb/geometry/hit/hit_material.h"
#include "wavecomb/geometry/hit/surface.h"
#include "wavecomb/guiding/field/field_view.h"
#include "wavecomb/light/sampling/light_sample.h"
#include "wavecomb/path/features.h"
#include "wavecomb/path/path_pool.h"
#include "wavecomb/path/shade_settings.h"

namespace wavecomb {

/// State of a path at a vertex. `dir` is the direction of the ray that hit the vertex. The ray cone
/// is given at the hit point.
template <typename F>
struct PathState {
  Vec3<F> dir;
  Color<F> throughput;
  F pdf{0.f};  ///< density of the previous bounce; 0 for a delta bounce or camera ray
  F eta_scale{1.f};
  F cone_width{0.f}, cone_spread{0.f};
  Vec3<F> o;             ///< origin of the ray that arrived
  UInt<F> receiver{0u};  ///< LightReceiver::normal of the previous vertex
  UInt<F> link{0u};      ///< link class of the surface that the ray left, if lights are linked
  F importance{0.f};  ///< reciprocal of the estimated brightness of the path's pixel; 0 if unknown
  /// Ratio R (joint_transport.h): the density with which a joint transport samples this path,
  /// divided by the density of bounces. The density of the light's emission is not included. R is 0
  /// without a joint transport.
  F ratio{0.f};
  Mask<F> enters_body{false};  ///< whether the bounce enters a subsurface body
  BodyEntry<F> entry{};        ///< that body
  // The following fields are set only in scenes with nested dielectrics (MediumStackRow).
  F outer{1.f};        ///< index of refraction of the medium on the other side of the surface
  UInt<F> medium{0u};  ///< material whose medium scatters light at this vertex
  F time{0.5f};        ///< shutter time, if lights move
  /// Diffuse fraction of the previous bounce, by colour, if lights have diffuse and specular
  /// multipliers.
  Color<F> diffuse{F(0.f)};

  LightReceiver<F> vertex_before() const {
    LightReceiver<F> from(o, receiver);
    from.time = time;
    return from;
  }
};

/// Returns the state of a camera path at the end of its ray of length `t`. State fields that
/// PathRow does not store have their default values.
template <typename F>
WAVECOMB_INLINE PathState<F> path_state(const PathRow<F>& row, const F& t) {
  return {.dir = row.d,
          .throughput = row.throughput,
          .pdf = row.pdf,
          .eta_scale = row.eta_scale,
          .cone_width = fma(row.cone_spread, t, row.cone_width),
          .cone_spread = row.cone_spread,
          .o = row.o,
          .receiver = row.receiver};
}
/// Returns the row of a camera path that continues in the state `next`. `kMayEnter` is false if no
/// ray can enter a subsurface body.
template <bool kMayEnter, typename F>
WAVECOMB_INLINE PathRow<F> path_row(const PathState<F>& next, const SampleKey<F>& key) {
  PathRow<F> row{.o = next.o,
                 .d = next.dir,
                 .throughput = next.throughput,
                 .pdf = next.pdf,
                 .eta_scale = next.eta_scale,
                 .cone_width = next.cone_width,
                 .cone_spread = next.cone_spread,
                 .key = key,
                 .receiver = next.receiver};
  if constexpr (kMayEnter) row.set_entry(next.enters_body, next.entry);
  return row;
}

/// Result of shading one vertex. The fields of the shadow ray are undefined in lanes outside
/// `has_shadow`, and the fields of the next ray are undefined in lanes outside `alive`.
template <typename F>
struct VertexResult {
  Color<F> emitted;    ///< emission to add to the path's radiance, already clamped
  Mask<F> has_shadow;  ///< whether the vertex casts a shadow ray
  Vec3<F> shadow_o, shadow_d;
  F shadow_tfar;
  UInt<F> shadow_set;  ///< result of shadow_set(); 0 without light linking
  Color<F> direct;     ///< contribution if the shadow ray is free, already clamped
  Color<F>
      /// Fraction of `direct` that remains if the shadow ray is blocked, for each colour channel.
      shadow_tint;
  Mask<F> alive;      ///< whether the path continues
  PathState<F> next;  ///< ray and state of the next path segment
  // Values for training the guiding field, set if Vertex::guide is not null: guiding_axis of the
  // surface, and the bounce density of the BSDF alone.
  UInt<F> axis;
  F bsdf_pdf;
  UInt<F> crossed;  ///< MediumStackRow::crossed, if the scene has nested dielectrics
};

/// Classification of a scattering event for light path expressions: the PathEvent, and the diffuse
/// fraction for each colour channel. The remaining fraction is specular if `is_delta` is set, and
/// glossy otherwise.
template <typename F>
struct ScatteringEvent {
  UInt<F> event{0u};
  Color<F> diffuse{F(0.f)};
  Mask<F> is_delta{false};
};

/// AOV values of a vertex. The steps of a vertex write AOVs directly instead of returning AOV
/// values: most renders have no AOVs, and values that are needed until the end of shading would
/// occupy registers.
template <typename F>
struct VertexAovs {
  /// Flags of optional fields. Fields without a flag are always written.
  bool wants_uv = false, wants_lights = false, wants_bounces = false;
  bool wants_events = false;  ///< whether scattering events are classified; implies wants_lights
  Color<F> albedo;
  Vec3<F> normal;
  Mask<F> is_clear;  ///< whether the surface has only delta lobes, such as a mirror or glass
  Vec2<F> uv;
  /// Light that contributes `emitted` and light that contributes `direct`, or kNoLight.
  UInt<F> emitter, light_id;
  // With wants_lights: the position from which a light was sampled, and the MIS weight that
  // `direct` contains. A weight of -1 means that no light was sampled.
  Vec3<F> light_position;
  F light_weight;
  // With wants_events: classification of the scattering towards the light sample and along the
  // bounce (path/steps/note_events.h).
  ScatteringEvent<F> light_scattering, bounce;
  // With wants_bounces: the probability that the guiding field sampled the direction of the bounce,
  // and the survival probability of roulette. A survival of -1 means that there was no bounce.
  F guided, survival;
};

/// Albedo and normal at a vertex, as auxiliary inputs of a denoiser.
template <typename F>
struct Guides {
  Color<F> albedo;
  Vec3<F> normal;
};

/// Returns the denoiser inputs at a vertex: normal and albedo, where the albedo is tinted by the
/// mirrors and glass that the path has met before. If `is_clear` is set, the values of the next
/// vertex replace these values.
template <typename F>
inline Guides<F> guides_of(const VertexAovs<F>& v, const PathState<F>& path) {
  const auto tinted = [&](const F& albedo, const F& throughput) {
    // eta_scale removes the radiance scaling at refractions. The limit of 1 is needed because
    // roulette may have increased the throughput.
    return F(min(F(albedo * throughput * path.eta_scale), F(1.f)));
  };
  return {{tinted(v.albedo.x, path.throughput.x), tinted(v.albedo.y, path.throughput.y),
           tinted(v.albedo.z, path.throughput.z)},
          v.normal};
}

/// Input of all steps of a vertex. `depth` is 0 at the first vertex, and `t` is the length of the
/// ray that arrived. `hit` and `geom` (the geometry within the instance's group) describe a
/// surface; at a vertex in a volume `hit.inst` is kNoSurface. `kFeatures` is the set of features
/// with which the kernel is compiled.
template <typename F, uint32_t kFeatures = kEverything>
struct Vertex {
  const SceneView& scene;
  const ShadeSettings& settings;
  const SampleKey<F>& key;
  uint32_t depth;
  const MeshHit<F>& hit;
  const UInt<F>& geom;
  const F& t;
  const UInt<F>& material;
  const PathState<F>& path;
  VertexAovs<F>* aovs;  ///< null if no AOV needs the vertex
  const Mask<F>& active;
  const GuidingView* guide = nullptr;  ///< guiding field that is used for bounces or is in training

  static constexpr bool has(Feature feature) { return (kFeatures & feature) != 0; }
  /// Whether the kernel inlines the drawing of samples and setup_surface(). General kernels call
  /// shared functions instead, which makes them compile faster.
  static constexpr bool kInlines = kFeatures == kPlain;
  /// Returns the AOV values to write, or null.
  VertexAovs<F>* recorded_aovs() const { return has(kRecordsAovs) ? aovs : nullptr; }
  bool wants_lights() const { return recorded_aovs() && aovs->wants_lights; }
  bool wants_events() const { return recorded_aovs() && aovs->wants_events; }
  bool wants_bounces() const { return recorded_aovs() && aovs->wants_bounces; }
  bool has_medium_stack() const { return has(kNestedMedia) && scene.nested_media.media; }
  /// Returns the sample values of the set `name` at this vertex.
  WAVECOMB_INLINE Sample4<F> sample(VertexSet name) const {
    const uint32_t set = vertex_set(name, depth);
    if constexpr (kInlines)
      return inlined_sample_4d<F>(settings.sampler, key, set);
    else
      return sample_4d<F>(settings.sampler, key, set);
  }
  bool has_links() const { return has(kLinks) && scene.lights.links.members; }
};

/// Length of a shadow ray as a fraction of the distance to the light. The fraction is below 1 so
/// that the ray ends before the light's surface.
inline constexpr float kShadowRayFraction = 0.9999f;

/// Returns the fraction of a light's radiance that a shadow ray contributes, for a light whose
/// shadows have the colour `tint` and partly transparent surfaces with transmittance `passed`.
template <typename F>
WAVECOMB_INLINE Color<F> tinted_transmittance(const Color<F>& tint, const F& passed) {
  return tint + (Color<F>(F(1.f)) - tint) * passed;
}

/// Scales a contribution down to a luminance of at most `limit`, where 0 means no limit.
/// Contributions that are not finite become 0.
template <typename F>
class ContributionLimit {
 public:
  ContributionLimit(const Color<F>& whole, float limit)
      : finite_(is_finite(whole.x) & is_finite(whole.y) & is_finite(whole.z)),
        limited_(limit > 0),
        scale_(1.f) {
    if (!limited_) return;
    const F y = luminance(finite(whole));
    scale_ = select(y > limit, F(limit / max(y, F(1e-30f))), F(1.f));
  }
  /// Returns `part`, limited by the same factor as the contribution given to the constructor.
  /// `part` is this contribution or one of its summands.
  Color<F> of(const Color<F>& part) const {
    return limited_ ? finite(part) * scale_ : finite(part);
  }

 private:
  Color<F> finite(const Color<F>& c) const { return select<F>(finite_, c, Color<F>(F(0.f))); }

  Mask<F> finite_;
  bool limited_;
  F scale_;
};

/// Returns `c`, limited by ContributionLimit.
template <typename F>
inline Color<F> clean(const Color<F>& c, float limit) {
  return ContributionLimit<F>(c, limit).of(c);
}

/// Returns the luminance limit of a contribution after `bounces` scatterings. Direct light has no
/// limit.
inline float clamp_limit(const ShadeSettings& s, uint32_t bounces) {
  return bounces > 1 ? s.clamp_indirect : 0.f;
}

/// Returns the index of geometry `geom` of instance `inst`, for arrays with one entry per geometry
/// of each instance.
template <typename F>
inline UInt<F> instance_geometry(const SceneView& scene, const UInt<F>& inst, const UInt<F>& geom,
                                 const Mask<F>& active) {
  return gather_member<F>(scene.instances, &InstanceRecord::emissive, inst, active) + geom;
}

/// Returns the lanes whose camera ray hits a holdout. Holdouts are black and have alpha 0. Requires
/// scene.visibility.
template <typename F>
inline Mask<F> is_holdout(const SceneView& scene, const UInt<F>& inst, const UInt<F>& geom,
                          const Mask<F>& active) {
  using U = UInt<F>;
  const U visibility_bits =
      gather<U>(scene.visibility, instance_geometry<F>(scene, inst, geom, active), Mask<U>(active));
  return active & Mask<F>((visibility_bits & static_cast<uint32_t>(kHoldout)) != U(0u));
}

/// Returns the link class of geometry `geom` of instance `inst`.
template <typename F>
inline UInt<F> link_class(const SceneView& scene, const UInt<F>& inst, const UInt<F>& geom,
                          const Mask<F>& active) {
  return gather<UInt<F>>(scene.lights.links.classes,
                         instance_geometry<F>(scene, inst, geom, active), Mask<UInt<F>>(active));
}

}  // namespace wavecomb
