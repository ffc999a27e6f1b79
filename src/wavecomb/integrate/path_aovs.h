// SPDX-License-Identifier: Apache-2.0
/// What paths find for AOVs, beside their radiance. Both integrators own one of these, a row a path
/// slot, and tell it what happens to a path:
///
///   begin      a camera ray starts
///   hit_light, hit_surface   what it met first
///   vertex     a surface was shaded
///   add        light reached the path
///   end_depth  all light that scattering `depth` has met is in the radiance
///   resolve    the path's sums go to the film
///
/// Only what is asked for takes room and time. Radiance by parts costs shading nothing: it is
/// copied once before the first scattering brings light, and once after.
#pragma once

#include <array>
#include <chrono>
#include <cmath>
#include <cstring>
#include <limits>

#include "wavecomb/core/fields.h"
#include "wavecomb/film/aov_film.h"
#include "wavecomb/integrate/aov_tables.h"
#include "wavecomb/integrate/camera_ray.h"
#include "wavecomb/integrate/light_groups.h"
#include "wavecomb/integrate/path_aov_rows.h"
#include "wavecomb/integrate/path_expressions.h"
#include "wavecomb/integrate/path_pool.h"
#include "wavecomb/integrate/path_state.h"
#include "wavecomb/integrate/phase_clock.h"

namespace wavecomb {

/// What the model of costs says of a ray, in nanoseconds: about what it takes among a million
/// triangles.
inline constexpr float kModelRayNs = 250;

/// Values that AOVs have of the first vertex, once it was shaded and where `path` has reached it: a
/// line for each row whose source is kVertex. Runs put(aov, value), value of its channels.
template <typename F, typename Put>
inline void for_each_vertex_value(const VertexAovs<F>& v, const PathState<F>& /*path*/,
                                  const Put& put) {
  put(Aov::kAlbedo, v.albedo);
  put(Aov::kNormal, v.normal);
  put(Aov::kUv, v.uv);
}

/// Contract: owned by one wave, or one reference integrator; slots below the capacity.
class PathAovs {
 public:
  PathAovs() = default;
  /// `tables` may be null where nothing of `layout` needs them.
  PathAovs(size_t capacity, const AovLayout& layout, const AovTables* tables)
      : layout_(layout), tables_(tables) {
    const AovSet& set = layout.set;
    const auto rows = [&](Block& block, bool wanted, size_t words) {
      if (wanted) block = Block(capacity, words);
    };
    uint32_t words = 0;
    for (const AovRow& row : kAovs) {
      if (row.source != AovSource::kVertex || !set.has(row.aov)) continue;
      vertex_at_[place_of(row.aov)] = words;
      words += row.channels;
    }
    rows(vertex_, words > 0, words);
    rows(depth_, set.has(Aov::kDepth), 1);
    rows(end_, set.any(Aov::kDeep | Aov::kHalfDepth | Aov::kTransmittance), kRowWords<RayEndRow>);
    rows(hits_, set.has(AovKind::kNearest) || set.has(AovKind::kCoverage), kRowWords<FirstHitRow>);
    rows(centre_, set.has(AovKind::kNearest), 1);
    rows(motion_, set.has(Aov::kMotion), 2);
    for (Block& part : parts_) rows(part, set.any(AovSet::kParts), kRadianceWords);
    rows(groups_, layout.light_groups > 0, kRadianceWords * layout.light_groups);
    if (layout.expressions > 0)
      expressions_ = PathExpressions(capacity, tables->automaton, tables->end_of_light);
    rows(alpha_, set.has(Aov::kAlpha), 1);
    rows(cost_ns_, set.has(Aov::kCost), 1);
    rows(guides_, set.has(AovSource::kGuide), kRowWords<GuideRow>);
    rows(light_samples_, set.has(AovSource::kWay), kRadianceWords);
    rows(bounces_, set.has(AovSource::kBounce), kRowWords<BounceRow>);
  }

  size_t bytes() const {
    size_t n = expressions_.bytes();
    for (const Block* block : blocks()) n += block->bytes();
    return n;
  }

  // ---- before the first ray ---------------------------------------------------------------------

  /// Forgets the paths in slots below `slots`.
  void clear(size_t slots) {
    for (Block* block :
         {&vertex_, &guides_, &cost_ns_, &groups_, &alpha_, &light_samples_, &bounces_, &motion_})
      block->zero(slots);
    expressions_.clear(slots);
    constexpr float kFar = std::numeric_limits<float>::infinity();
    if (depth_) std::fill_n(depth_.rows, slots, kFar);
    for (uint32_t i = 0; end_ && i < slots; ++i)
      store_row<RayEndRow, float>(end_.rows, i, {kFar, 0.f, Color<float>(1.f)}, true);
    const FirstHitRow<float> none{Vec3<float>(0.f), kNothingHit, kNothingHit,
                                  kNothingHit,      kFar,        kFar};
    for (uint32_t i = 0; hits_ && i < slots; ++i)
      store_row<FirstHitRow, float>(hits_.rows, i, none, true);
  }

  /// The camera ray of numbers `r` starts.
  template <typename F>
  void begin(const CameraSetup& camera, const Sample4<F>& r, const UInt<F>& slot,
             const Mask<F>& active) const {
    if (centre_) scatter<F>(centre_.rows, centre_distance2<F>(camera, r, active), slot, active);
  }

  // ---- first hits -------------------------------------------------------------------------------

  bool wants_hits() const { return hits_ || depth_ || end_; }
  bool wants_alpha() const { return bool(alpha_); }
  /// The camera's rays of the active lanes have met something that covers what is behind.
  template <typename F>
  void cover(const UInt<F>& slot, const Mask<F>& active) const {
    wavecomb::scatter<F>(alpha_.rows, F(1.f), slot, active);
  }

  /// The camera's ray has met the shape of light `light` at `p`.
  template <typename F>
  void hit_light(const CameraSetup& camera, const UInt<F>& slot, const Vec3<F>& p, const F& time,
                 const UInt<F>& light, const Mask<F>& active) const {
    const F depth = camera_depth<F>(camera, p, time, active);
    store_depth<F>(slot, depth, active);
    if (!hits_) return;
    const UInt<F> none(kNothingHit);
    store_row<FirstHitRow, F>(hits_.rows, slot,
                              {p, tables_->light_object(light), none, none, depth,
                               camera_distance<F>(camera, p, time, active)},
                              active);
  }

  /// The camera's ray has met geometry `geom` of instance `inst` at `p`.
  template <typename F>
  void hit_surface(const CameraSetup& camera, const UInt<F>& slot, const Vec3<F>& p, const F& time,
                   const UInt<F>& inst, const UInt<F>& geom, const UInt<F>& material,
                   const Mask<F>& active) const {
    const F depth = camera_depth<F>(camera, p, time, active);
    store_depth<F>(slot, depth, active);
    if (hits_)
      store_row<FirstHitRow, F>(hits_.rows, slot,
                                {p, tables_->template object<F>(inst, geom, active), material, inst,
                                 depth, camera_distance<F>(camera, p, time, active)},
                                active);
  }

  bool wants_motion() const { return bool(motion_); }
  /// What the camera's ray has met moves so far about the picture (screen_motion.h).
  template <typename F>
  void move(const UInt<F>& slot, const Vec2<F>& pixels, const Mask<F>& active) const {
    scatter_words<F>(motion_.rows, pixels, slot * 2u, active);
  }

  /// A volume has stopped the camera's ray at `p`: `seen`. There is no surface whose place, depth
  /// and instance could be told.
  template <typename F>
  [[gnu::noinline, gnu::cold]] void hit_volume(const CameraSetup& camera, const UInt<F>& slot,
                                               const Vec3<F>& p, const F& time,
                                               const VolumeSeen<F>& seen,
                                               const Mask<F>& active) const {
    if (end_) scatter_ray_end<F>(slot, camera_depth<F>(camera, p, time, active), F(1.f), active);
    if (!hits_) return;
    const F far(std::numeric_limits<float>::infinity());
    const UInt<F> object =
        select(Mask<UInt<F>>(seen.in_mesh), seen.place, tables_->volume_object(seen.volume));
    store_row<FirstHitRow, F>(
        hits_.rows, slot, {Vec3<F>(F(0.f)), object, seen.material, UInt<F>(kNothingHit), far, far},
        active);
  }
  bool wants_transmittance() const { return layout_.set.has(Aov::kTransmittance); }
  /// So much of what is behind comes through volumes along the camera's ray, if only what comes
  /// through counts.
  template <typename F>
  void pass(const UInt<F>& slot, const Color<F>& through, const Mask<F>& active) const {
    scatter_words<F>(end_.rows, through, slot * uint32_t{kRowWords<RayEndRow>} + 2u, active);
  }

  // ---- vertices ---------------------------------------------------------------------------------

  /// What shading is to give at `depth`.
  template <typename F>
  VertexAovs<F> wanted(uint32_t depth) const {
    VertexAovs<F> v;
    v.wants_uv = depth == 0 && layout_.set.has(Aov::kUv);
    v.wants_lights = wants_lights();
    v.wants_events = bool(expressions_);
    v.wants_bounces = bool(bounces_);
    v.uv = {F(0.f), F(0.f)};
    return v;
  }
  /// Whether that is anything at all.
  bool wants_vertex(uint32_t depth) const {
    return (depth == 0 && vertex_) || guides_ || wants_lights() || bounces_;
  }

  /// A vertex was shaded, which `path` had reached.
  template <typename F>
  void vertex(uint32_t depth, const UInt<F>& slot, const VertexAovs<F>& v, const PathState<F>& path,
              const Mask<F>& active) const {
    if (depth == 0 && vertex_) {
      const UInt<F> row = slot * static_cast<uint32_t>(vertex_.words);
      for_each_vertex_value<F>(v, path, [&](Aov aov, const auto& value) {
        const uint32_t at = vertex_at_[place_of(aov)];
        if (at != kNotKept) scatter_words<F>(vertex_.rows, value, row + at, active);
      });
    }
    if (guides_) store_guides<F>(slot, v, path, active);
    if (bounces_) add_bounce<F>(slot, v, active);
  }
  /// Roulette that is played where a bounce has led, of paths at `depth`, lets them go on with `q`.
  template <typename F>
  void survive(uint32_t depth, const UInt<F>& slot, const F& q, const Mask<F>& active) const {
    if (!bounces_ || depth == 0) return;
    BounceRow<F> row = load_row<BounceRow, F>(bounces_.rows, slot, active);
    row.survived += q - 1.f;  // the bounce counts as one that went on
    store_row<BounceRow, F>(bounces_.rows, slot, row, active);
  }

  // ---- light ------------------------------------------------------------------------------------

  /// Whether it is to be known which light brings what.
  bool wants_lights() const { return groups_ || expressions_; }
  /// Where the group of the lanes' lights is kept, or kNoGroup.
  template <typename F>
  UInt<F> group_of(const UInt<F>& light, const Mask<F>& active) const {
    if (!groups_) return UInt<F>(kNoGroup);
    return kept_group<F>(tables_->kept_group.data(), light, active);
  }
  const PathExpressions& expressions() const { return expressions_; }
  /// Light `light`, or kNoLight, has met the paths in the active lanes' slots, which are distinct.
  template <typename F>
  void add_light(const UInt<F>& slot, const UInt<F>& light, const Color<F>& c,
                 const Mask<F>& active) const {
    if (groups_) add<F>(slot, group_of<F>(light, active), c, active);
    if (expressions_) expressions_.add<F>(slot, light, c, active);
  }
  /// A volume that shines has.
  template <typename F>
  void add_glow(const UInt<F>& slot, const Color<F>& c, const Mask<F>& active) const {
    if (groups_) add<F>(slot, UInt<F>(tables_->group_of_rest), c, active);
    if (expressions_) expressions_.add_glow<F>(slot, c, active);
  }
  /// The light samples of the last vertices have brought `c`, of a light of `group`.
  template <typename F>
  void add_direct(const UInt<F>& slot, const UInt<F>& group, const Color<F>& c,
                  const Mask<F>& active) const {
    if (groups_) add<F>(slot, group, c, active);
    if (expressions_) expressions_.add_lit<F>(slot, c, active);
  }
  /// The same for light of `group` and the groups alone.
  template <typename F>
  void add(const UInt<F>& slot, const UInt<F>& group, const Color<F>& c,
           const Mask<F>& active) const {
    const Mask<F> kept = active & Mask<F>(group != UInt<F>(kNoGroup));
    if (any(kept)) add_radiance<F>(groups_.rows, slot * layout_.light_groups + group, c, kept);
  }
  bool wants_light_samples() const { return bool(light_samples_); }
  /// Light samples have brought the paths in the active lanes' slots, which are distinct, `c`.
  template <typename F>
  void add_light_sample(const UInt<F>& slot, const Color<F>& c, const Mask<F>& active) const {
    add_radiance<F>(light_samples_.rows, slot, c, active);
  }
  /// The environment's light has reached the paths of the active lanes.
  template <typename F>
  void add_environment(const SceneView& scene, const ShadeSettings& settings, uint32_t depth,
                       const UInt<F>& slot, const PathState<F>& path, const Mask<F>& active) const {
    split_environment<F>(
        scene, settings, depth, path, active,
        [&](uint32_t light) { return expressions_ || tables_->kept_group[light] != kNoGroup; },
        [&](uint32_t light, const Color<F>& share) {
          add_light<F>(slot, UInt<F>(light), share, active);
        });
  }

  /// Keeps the radiance of slots below `slots` as a part: it holds all light that scattering
  /// `depth` has met, and none that it gathers.
  void end_depth(uint32_t depth, const float* radiance, size_t slots) const {
    if (depth < parts_.size() && parts_[depth])
      std::memcpy(parts_[depth].rows, radiance, slots * kRadianceWords * sizeof(float));
  }
  /// The same for `depth` and all that follow, of paths that have ended.
  void end_path(uint32_t depth, const float* radiance, size_t slots) const {
    for (; depth < parts_.size(); ++depth) end_depth(depth, radiance, slots);
  }

  // ---- time -------------------------------------------------------------------------------------

  bool wants_cost() const { return bool(cost_ns_); }
  /// Costs are of the model: no time is taken.
  bool models_cost() const { return wants_cost() && tables_ && tables_->models_cost; }
  bool wants_time() const { return wants_cost() && !models_cost(); }
  /// Adds a cost of the model, in nanoseconds. A path's come in the order of its vertices.
  void add_cost(size_t slot, float ns) const { cost_ns_.rows[slot] += ns; }
  /// What the model says of a ray of each path in slots slot(0) ... slot(n - 1), where it is asked.
  template <typename Slot>
  void charge_rays(size_t n, const Slot& slot) const {
    for (size_t i = 0; models_cost() && i < n; ++i) add_cost(slot(i), kModelRayNs);
  }
  PhaseClock::Clock::time_point start_time() const {
    return wants_time() ? PhaseClock::Clock::now() : PhaseClock::Clock::time_point();
  }
  /// Spreads the time since `start` evenly over the paths in slots slot(0) ... slot(n - 1), where
  /// it is taken: a batch at a time, so a path's share is the mean of its batch.
  template <typename Slot>
  void spread_time(size_t n, PhaseClock::Clock::time_point start, const Slot& slot) const {
    if (!wants_time() || n == 0) return;
    const double ns =
        std::chrono::duration<double, std::nano>(PhaseClock::Clock::now() - start).count();
    const auto share = static_cast<float>(ns / static_cast<double>(n));
    for (size_t i = 0; i < n; ++i) cost_ns_.rows[slot(i)] += share;
  }

  // ---- to the film ------------------------------------------------------------------------------

  /// The camera's exposure: multiplies what is radiance.
  void expose(float exposure, size_t slots) const {
    const auto scale = [&](const Block& block, size_t words) {
      for (size_t i = 0; block && i < slots * words; ++i) block.rows[i] *= exposure;
    };
    for (const Block& part : parts_) scale(part, kRadianceWords);
    scale(groups_, kRadianceWords * layout_.light_groups);
    expressions_.scale(exposure, slots);
    scale(light_samples_, kRadianceWords);
  }
  /// Adds what the paths in slots [begin, end) found to `pixel`, slot by slot. `radiance`: theirs.
  void resolve(AovFilm& film, size_t pixel, size_t begin, size_t end, const float* radiance) const;

  // For tests: rows of light groups, or null.
  const float* group_rows() const { return groups_.rows; }

 private:
  using Block = SlotRows;

  std::array<const Block*, 14> blocks() const {
    return {&vertex_, &depth_,   &end_,    &hits_,  &centre_,        &parts_[0], &parts_[1],
            &groups_, &cost_ns_, &guides_, &alpha_, &light_samples_, &bounces_,  &motion_};
  }

  /// In place of where an AOV's value is kept.
  static constexpr uint32_t kNotKept = 0xffffffffu;
  static constexpr std::array<uint32_t, kAovCount> nothing_kept() {
    std::array<uint32_t, kAovCount> at{};
    at.fill(kNotKept);
    return at;
  }

  /// How deep the camera's ray went, and whether a volume has stopped it: the head of RayEndRow.
  template <typename F>
  void scatter_ray_end(const UInt<F>& slot, const F& depth, const F& in_volume,
                       const Mask<F>& active) const {
    const UInt<F> at = slot * uint32_t{kRowWords<RayEndRow>};
    scatter_words<F>(end_.rows, Vec2<F>{depth, in_volume}, at, active);
  }
  /// Distance along the camera's axis, of a surface.
  template <typename F>
  void store_depth(const UInt<F>& slot, const F& depth, const Mask<F>& active) const {
    if (depth_) scatter<F>(depth_.rows, depth, slot, active);
    if (end_) scatter_ray_end<F>(slot, depth, F(0.f), active);
  }

  /// What guides a denoiser, of paths that have met clear surfaces only so far.
  template <typename F>
  void store_guides(const UInt<F>& slot, const VertexAovs<F>& v, const PathState<F>& path,
                    const Mask<F>& active) const {
    const GuideRow<F> before = load_row<GuideRow, F>(guides_.rows, slot, active);
    const Mask<F> seen = active & (before.is_final == 0.f);
    if (none(seen)) return;
    const Guides<F> g = guides_of<F>(v, path);
    store_row<GuideRow, F>(guides_.rows, slot,
                           {g.albedo, g.normal, select(v.is_clear, F(0.f), F(1.f))}, seen);
  }

  /// The bounce of a vertex, where there is one.
  template <typename F>
  void add_bounce(const UInt<F>& slot, const VertexAovs<F>& v, const Mask<F>& active) const {
    const Mask<F> there = active & (v.survival >= 0.f);
    if (none(there)) return;
    BounceRow<F> row = load_row<BounceRow, F>(bounces_.rows, slot, there);
    row.guided += v.guided;
    row.survived += v.survival;
    row.bounces += 1.f;
    store_row<BounceRow, F>(bounces_.rows, slot, row, there);
  }

  AovLayout layout_;
  const AovTables* tables_ = nullptr;
  Block vertex_, depth_, end_, hits_;
  /// By an AOV's place: its words in a row of vertex_, or kNotKept.
  std::array<uint32_t, kAovCount> vertex_at_ = nothing_kept();
  Block motion_;                ///< pixels, x and y
  Block centre_;                ///< squared distance of the sample from the pixel's centre, pixels
  std::array<Block, 2> parts_;  ///< radiance as it was before scattering 0 and 1
  Block groups_;                ///< radiance by light group, a slot's groups side by side
  Block cost_ns_, guides_, bounces_;
  Block alpha_;  ///< 1 where the camera's ray has met something that covers
  PathExpressions expressions_;
  Block light_samples_;  ///< radiance that light samples brought
};

}  // namespace wavecomb
