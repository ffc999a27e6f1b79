// SPDX-License-Identifier: Apache-2.0
/// What paths carry from vertex to vertex, and what the steps of a vertex (steps/) are given and
/// give.
#pragma once

#include "wavecomb/core/fields.h"
#include "wavecomb/core/sampler.h"
#include "wavecomb/core/settings.h"
#include "wavecomb/core/vec.h"
#include "wavecomb/integrate/features.h"
#include "wavecomb/integrate/light_vertices.h"
#include "wavecomb/integrate/visible_point.h"
#include "wavecomb/learn/guide_view.h"
#include "wavecomb/light/light.h"
#include "wavecomb/surface/hit.h"
#include "wavecomb/surface/surface.h"

namespace wavecomb {

/// The settings that shading reads.
struct ShadeSettings {
  SamplerKind sampler;
  uint32_t max_depth;
  bool roulette;    ///< by throughput, after a vertex
  bool cost_aware;  ///< by throughput and cost, before a vertex
  bool efficient;   ///< by what is expected to come back, after a vertex, where that was learned
  uint32_t roulette_depth;
  float clamp_indirect;  ///< 0: off
  bool schlick_fresnel;
  bool cosine_sampling;
  bool filters_textures_whole;
  bool shows_sky;  ///< to the camera itself: domes and distant lights
  bool connects;   ///< vertices of camera paths and of paths from lights, where those are joined
  bool joins_light = false;  ///< paths from lights share in the weights of camera paths
  /// Radius within which vertices are merged, over the width of a path's cone; 0: none are.
  float merge_scale = 0;
  float light_paths = 0;  ///< that a sample has, where vertices are merged

  explicit ShadeSettings(const Settings& s)
      : sampler(s.sampler),
        max_depth(s.max_depth),
        roulette(s.roulette != RouletteKind::kOff && s.roulette != RouletteKind::kCostAware),
        cost_aware(s.roulette == RouletteKind::kCostAware),
        efficient(s.roulette == RouletteKind::kEfficient || s.roulette == RouletteKind::kAuto),
        roulette_depth(s.roulette_depth),
        clamp_indirect(s.clamp_indirect),
        schlick_fresnel(s.schlick_fresnel),
        cosine_sampling(s.cosine_sampling),
        filters_textures_whole(s.texture_filter == TextureFilter::kWhole),
        shows_sky(!s.alpha),
        connects(s.connects()) {}

  /// Whether paths that leave the scene after `depth` vertices see what is around it.
  bool sees_sky(uint32_t depth) const { return shows_sky || depth > 0; }

  /// For paths from lights, whose every vertex the camera looks at.
  ShadeSettings of_light_paths() const {
    ShadeSettings s = *this;
    s.filters_textures_whole = true;
    return s;
  }
};

/// What a path carries from vertex to vertex. `dir` is the ray that arrived; the cone is at the
/// hit.
template <typename F>
struct PathState {
  Vec3<F> dir;
  Color<F> throughput;
  F pdf;  ///< of the bounce before; 0: delta or camera; less: it led below a surface
  F eta_scale;
  F cone_width, cone_spread;
  Vec3<F> o;          ///< origin of the ray that arrived
  UInt<F> receiver;   ///< LightReceiver::normal of the vertex before
  UInt<F> link{0u};   ///< class of the surface that the ray left, where lights are linked
  F importance{0.f};  ///< one over the brightness of the picture at the pixel; 0: not known
  F ratio{0.f};       ///< steps/join.h; 0: no path from a light could be this one; less: only
                      ///< deltas so far, which merging waits behind. Of a path from a light:
                      ///< density of the bounce before, 0 where it was none to connect to
  // Where paths know what they are inside of (InsideRow):
  F outer{1.f};        ///< index of refraction on the other side of the surface
  UInt<F> medium{0u};  ///< what collides, by material
  F time{0.5f};        ///< of the shutter, where lights move
  /// Share of what the bounce before scatters that is diffuse, where lights have multipliers.
  Color<F> diffuse{F(0.f)};

  /// How dense paths from lights are over this one.
  F joined() const { return max(ratio, F(0.f)); }
  LightReceiver<F> vertex_before() const {
    LightReceiver<F> from(o, receiver);
    from.time = time;
    return from;
  }
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
  Color<F> shade;      ///< share of it to add where it is not, where shadows have a colour
  Mask<F> alive;       ///< the path goes on
  PathState<F> next;   ///< the next ray and what goes with it
  // For who learns, where Vertex::guide is there: guide_axis of the surface, and the density of the
  // bounce by the BSDF alone.
  UInt<F> axis;
  F bsdf_pdf;
  UInt<F> crossed;  ///< InsideRow::crossed, where paths know what they are inside of
};

/// What a scattering does: its kind, a PathEvent, and what share of it is diffuse, by colour. What
/// is not is glossy, or of a mirror.
template <typename F>
struct ScatteringNote {
  UInt<F> event{0u};
  Color<F> diffuse{F(0.f)};
  Mask<F> is_delta{false};
};

/// What AOVs take from a vertex. Written to at once rather than returned: most vertices have none,
/// and values that live to the end of shading cost registers.
template <typename F>
struct VertexAovs {
  /// Asked for; the others are always given.
  bool wants_uv = false, wants_lights = false, wants_bounces = false;
  bool wants_events = false;  ///< and what scatters; goes with wants_lights
  Color<F> albedo;
  Vec3<F> normal;
  Mask<F> is_clear;  ///< nothing but what is mirrored or refracted is seen here
  Vec2<F> uv;
  UInt<F> emitter, lit_by;  ///< lights behind `emitted` and `direct`, or kNoLight
  // With wants_lights: where a light was chosen for, and the MIS weight in `direct`; weight -1: no
  // choice was made.
  Vec3<F> lit_at;
  F light_weight;
  // With wants_events: of light from the light sample and along the bounce, how it is scattered
  // here (steps/note_events.h).
  ScatteringNote<F> lit, bounce;
  // With wants_bounces: with which probability the field chose the bounce's direction, and with
  // which roulette lets it go on; survival -1: there was no bounce.
  F guided, survival;
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

/// A vertex of a camera path that may connect to one of a path from a light.
template <typename F>
struct ConnectionOffer {
  Vec3<F> to;                ///< the vertex from the light
  F vertices;                ///< LightVertexRow::vertices
  Mask<F> wanted;            ///< there is one, and it is not too far from the camera
  ConnectionRow<F> row;      ///< to be filled in; black where `wanted` is false
  ScatteringNote<F> note{};  ///< likewise, where events are wanted
};

/// The offer of the vertex at `depth` of paths in `slot` to the vertices kept there: black so far.
template <typename F>
inline ConnectionOffer<F> offer_for(const LightVertices& from, const UInt<F>& slot, uint32_t depth,
                                    uint32_t max_depth, const Mask<F>& active) {
  const auto chosen = load_row<LightVertexRow, F>(from.chosen, slot, active);
  const Vec3<F> none(F(0.f));
  return {chosen.p,
          F(Int<F>(chosen.vertices)),
          Mask<F>(active & Mask<F>(chosen.vertices != UInt<F>(0u)) &
                  Mask<F>(chosen.depth + (depth + 2) <= UInt<F>(max_depth))),
          {none, F(0.f), none, F(0.f)}};
}

/// What all steps of a vertex are told of it. `depth` 0 is the first one; `t` is the length of the
/// ray that led there. `hit` and `geom` (geometry within the instance's group) are of a surface;
/// where the vertex is on none, `hit.inst` is kNoSurface. `kFeatures` is what the kernel knows of.
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
  VertexAovs<F>* aovs;  ///< null where none are wanted
  const Mask<F>& active;
  const GuideView* guide = nullptr;     ///< the field that guides bounces, or is to be learned
  ConnectionOffer<F>* offer = nullptr;  ///< null where nothing is connected
  VisibleOffer<F>* visible = nullptr;   ///< null where nothing is merged

  static constexpr bool has(Feature feature) { return (kFeatures & feature) != 0; }
  /// What AOVs are to be given; null where nothing is.
  VertexAovs<F>* notes() const { return has(kNotes) ? aovs : nullptr; }
  bool joins_light() const { return has(kJoined) && settings.joins_light; }
  bool wants_lights() const { return notes() && aovs->wants_lights; }
  bool wants_events() const { return notes() && aovs->wants_events; }
  bool wants_bounces() const { return notes() && aovs->wants_bounces; }
  bool knows_inside() const { return has(kInside) && scene.interiors.media; }
  bool has_links() const { return has(kLinks) && scene.lights.links.members; }
};

/// A shadow ray ends at this share of the way to the light, and so before its surface.
inline constexpr float kShadowReach = 0.9999f;

/// Limits a contribution so that its luminance is at most `limit` (0: no limit), and drops it if it
/// is not finite.
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
  /// The share of the limited contribution that `part` has, which may be the whole.
  Color<F> of(const Color<F>& part) const {
    return limited_ ? finite(part) * scale_ : finite(part);
  }

 private:
  Color<F> finite(const Color<F>& c) const { return select<F>(finite_, c, Color<F>(F(0.f))); }

  Mask<F> finite_;
  bool limited_;
  F scale_;
};

/// A contribution, limited as a whole (ContributionLimit).
template <typename F>
inline Color<F> clean(const Color<F>& c, float limit) {
  return ContributionLimit<F>(c, limit).of(c);
}

/// The limit for a contribution that light brings after `bounces` scatterings: direct light is
/// free.
inline float clamp_limit(const ShadeSettings& s, uint32_t bounces) {
  return bounces > 1 ? s.clamp_indirect : 0.f;
}

/// Where geometry `geom` of instance `inst` is in the arrays that have an entry for each of an
/// instance's geometries.
template <typename F>
inline UInt<F> placed_geometry(const SceneView& scene, const UInt<F>& inst, const UInt<F>& geom,
                               const Mask<F>& active) {
  return gather_member<F>(scene.instances, &InstanceRecord::emissive, inst, active) + geom;
}

/// Lanes whose camera ray ends at geometry `geom` of instance `inst` and brings nothing, where
/// visibility is told.
template <typename F>
inline Mask<F> held_out(const SceneView& scene, const UInt<F>& inst, const UInt<F>& geom,
                        const Mask<F>& active) {
  using U = UInt<F>;
  const U seen =
      gather<U>(scene.visibility, placed_geometry<F>(scene, inst, geom, active), Mask<U>(active));
  return active & Mask<F>((seen & static_cast<uint32_t>(kHeldOut)) != U(0u));
}

/// The class that linking knows geometry `geom` of instance `inst` by.
template <typename F>
inline UInt<F> link_class(const SceneView& scene, const UInt<F>& inst, const UInt<F>& geom,
                          const Mask<F>& active) {
  return gather<UInt<F>>(scene.lights.links.classes, placed_geometry<F>(scene, inst, geom, active),
                         Mask<UInt<F>>(active));
}

}  // namespace wavecomb
