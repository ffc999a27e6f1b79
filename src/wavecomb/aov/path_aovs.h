// SPDX-License-Identifier: Apache-2.0
/// AOV values of paths, stored for each path slot until they are added to the film. Integrators
/// report events of paths to `PathEvents` (path_events.h), which calls these member functions:
///
///   begin, hit_light, hit_surface, hit_volume   first_hits.h
///   vertex       a vertex was shaded
///   light        light contributes to the path
///   end_depth    the radiance includes the emission at vertex `depth`, but not its light sample
///   resolve      the path's values are added to the film
///
/// Only the requested AOVs are stored. The split of the radiance into emission, direct and indirect
/// light adds no work to shading. It only needs copies of the radiance before the light samples of
/// the first two vertices.
#pragma once

#include <array>
#include <cmath>
#include <cstring>
#include <iterator>

#include "wavecomb/aov/aov_tables.h"
#include "wavecomb/aov/cost_rows.h"
#include "wavecomb/aov/first_hits.h"
#include "wavecomb/aov/light_groups.h"
#include "wavecomb/aov/path_expressions.h"
#include "wavecomb/aov/rows.h"
#include "wavecomb/core/rows/fields.h"
#include "wavecomb/film/aov_film.h"
#include "wavecomb/path/path_pool.h"
#include "wavecomb/path/path_state.h"

namespace wavecomb {

/// Technique that finds the light of a contribution. Each technique is one bit of a mask.
enum class Technique : uint32_t {
  kEmitter = 1,      ///< A ray of the camera or of a bounce hits an emitter or leaves the scene.
  kVolume = 2,       ///< A ray of the camera or of a bounce passes an emissive volume.
  kLightSample = 4,  ///< A shadow ray reaches a sampled point on a light.
  kConnection = 8,   ///< A shadow ray reaches a vertex of a light path.
};
constexpr uint32_t operator|(Technique a, Technique b) {
  return static_cast<uint32_t>(a) | static_cast<uint32_t>(b);
}

/// AOV that sums the contributions of some techniques.
struct TechniqueAov {
  Aov aov;
  uint32_t techniques;  ///< bits of `Technique`

  constexpr TechniqueAov(Aov of, uint32_t bits) : aov(of), techniques(bits) {}
  constexpr TechniqueAov(Aov of, Technique one) : TechniqueAov(of, static_cast<uint32_t>(one)) {}
};
/// AOVs that sum contributions by technique. `kByBounces` is not listed, since it is the radiance
/// minus `kByLightSamples`.
inline constexpr TechniqueAov kTechniqueAovs[] = {
    {Aov::kByLightSamples, Technique::kLightSample | Technique::kConnection},
};

/// Contribution of light to paths.
template <typename F>
struct LightEvent {
  uint32_t depth;  ///< depth of the vertex where the path found the light
  const UInt<F>& slot;
  const Color<F>& c;
};

/// Calls `put(aov, value)` for each AOV whose source is `kVertex`, with values of the first vertex.
/// `value` has the channels of the AOV, and `path` is the path's state before the vertex.
template <typename F, typename Put>
inline void for_each_vertex_value(const VertexAovs<F>& v, const PathState<F>& /*path*/,
                                  const Put& put) {
  put(Aov::kAlbedo, v.albedo);
  put(Aov::kNormal, v.normal);
  put(Aov::kUv, v.uv);
}

/// AOV values of the paths of a wave, in arrays indexed by path slot.
///
/// Contract: the object belongs to a single wave or reference integrator. Path slots must be below
/// the capacity.
class PathAovs : public PathFirstHits, public PathCostRows {
 public:
  PathAovs() = default;
  /// Allocates arrays for the AOVs in `layout`. `tables` may be null if no AOV in `layout` needs
  /// tables.
  PathAovs(size_t capacity, const AovLayout& layout, const AovTables* tables)
      : PathFirstHits(capacity, layout.set, tables),
        PathCostRows(layout.set.has(Aov::kCost) ? capacity : 0, tables && tables->models_cost),
        layout_(layout),
        tables_(tables) {
    const AovSet& set = layout.set;
    const auto rows = [&](Block& block, bool wanted, size_t words) {
      if (wanted) block = Block(capacity, words);
    };
    uint32_t words = 0;
    for (const AovRow& row : kAovs) {
      if (row.source != AovSource::kVertex || !set.has(row.aov)) continue;
      vertex_at_[aov_index(row.aov)] = words;
      words += row.channels;
    }
    rows(vertex_, words > 0, words);
    for (Block& part : parts_) rows(part, set.any(AovSet::kParts), kRadianceWords);
    rows(early_connections_, set.any(AovSet::kParts) && tables && tables->connects, kRadianceWords);
    rows(groups_, layout.light_groups > 0, kRadianceWords * layout.light_groups);
    if (layout.expressions > 0)
      expressions_ =
          PathExpressions(capacity, tables->automaton, tables->end_of_light, tables->multipliers);
    rows(guides_, set.has(AovSource::kGuide), kRowWords<GuideRow>);
    for (size_t i = 0; i < std::size(kTechniqueAovs); ++i) {
      const auto& [aov, techniques] = kTechniqueAovs[i];
      const uint32_t users = aov == Aov::kByLightSamples ? aov | Aov::kByBounces : uint32_t(aov);
      rows(by_technique_[i], set.any(users), kRadianceWords);
      if (by_technique_[i]) wanted_techniques_ |= techniques;
    }
    if (wants_lights()) wanted_techniques_ = ~0u;
    if (early_connections_) wanted_techniques_ |= static_cast<uint32_t>(Technique::kConnection);
    rows(bounces_, set.has(AovSource::kBounce), kRowWords<BounceRow>);
  }

  size_t bytes() const {
    size_t n = expressions_.bytes() + hit_bytes() + cost_bytes();
    for (const Block* block : blocks()) n += block->bytes();
    for (const Block& block : by_technique_) n += block.bytes();
    return n;
  }

  // ---- before the first ray ---------------------------------------------------------------------

  /// Sets the AOV values of the first `slots` path slots to 0.
  void clear(size_t slots) {
    for (const Block* block : {&vertex_, &guides_, &groups_, &bounces_, &early_connections_})
      block->zero(slots);
    for (const Block& block : by_technique_) block.zero(slots);
    clear_hits(slots);
    clear_costs(slots);
    expressions_.clear(slots);
  }

  // ---- vertices ---------------------------------------------------------------------------------

  /// Returns the AOV values that shading has to provide at `depth`.
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
  /// Returns whether shading has to provide any AOV value at `depth`.
  bool wants_vertex(uint32_t depth) const {
    return (depth == 0 && vertex_) || guides_ || wants_lights() || bounces_;
  }

  /// Records the AOV values of a shaded vertex. `path` is the path's state before the vertex.
  template <typename F>
  void vertex(uint32_t depth, const UInt<F>& slot, const VertexAovs<F>& v, const PathState<F>& path,
              const Mask<F>& active) const {
    if (depth == 0 && vertex_) {
      const UInt<F> row = slot * static_cast<uint32_t>(vertex_.words);
      for_each_vertex_value<F>(v, path, [&](Aov aov, const auto& value) {
        const uint32_t at = vertex_at_[aov_index(aov)];
        if (at != kNoWords) scatter_words<F>(vertex_.rows, value, row + at, active);
      });
    }
    if (guides_) store_guides<F>(slot, v, path, active);
    if (bounces_) add_bounce<F>(slot, v, active);
  }
  /// Records `q`, the survival probability of Russian roulette before the vertex at `depth`.
  template <typename F>
  void survive(uint32_t depth, const UInt<F>& slot, const F& q, const Mask<F>& active) const {
    if (!bounces_ || depth == 0) return;
    BounceRow<F> row = load_row<BounceRow, F>(bounces_.rows, slot, active);
    // `add_bounce` has already added a survival probability of 1 for this bounce.
    row.survived += q - 1.f;
    store_row<BounceRow, F>(bounces_.rows, slot, row, active);
  }

  // ---- light ------------------------------------------------------------------------------------

  /// Returns whether contributions of `technique` change an AOV.
  bool wants(Technique technique) const {
    return (wanted_techniques_ & static_cast<uint32_t>(technique)) != 0;
  }
  /// Returns whether some AOV needs the light of each contribution.
  bool wants_lights() const { return groups_ || expressions_; }
  /// Returns the index of the stored light group of each lane's light, or kNoGroup.
  template <typename F>
  UInt<F> group_of(const UInt<F>& light, const Mask<F>& active) const {
    if (!groups_) return UInt<F>(kNoGroup);
    return film_group<F>(tables_->film_group.data(), light, active);
  }
  const PathExpressions& expressions() const { return expressions_; }

  /// Adds a contribution to the AOVs of the paths in the active lanes, whose slots must be
  /// distinct. `source` is the light, or kNoLight; for light samples, it is the result of
  /// group_of(), and for volumes it is not used. For connections, the joint transport, which knows
  /// their scattering events, updates the light path expressions.
  template <Technique kTechnique, typename F>
  void light(const LightEvent<F>& e, const UInt<F>& source, const Mask<F>& active) const {
    add_by_light<kTechnique, F>(e.slot, e.c, source, active);
    add_by_technique<kTechnique, F>(e.slot, e.c, active);
    if constexpr (kTechnique == Technique::kConnection)
      if (early_connections_ && e.depth == 0)
        add_radiance<F>(early_connections_.rows, e.slot, e.c, active);
  }
  /// Adds `c`, the emission of infinite lights, to the paths of the active lanes, which hit no
  /// geometry. `path` is their state at the last vertex.
  template <typename F>
  void environment(const SceneView& scene, const ShadeSettings& settings, const LightEvent<F>& e,
                   const PathState<F>& path, const Mask<F>& active) const {
    add_by_technique<Technique::kEmitter, F>(e.slot, e.c, active);
    if (!wants_lights()) return;
    split_environment<F>(
        scene, settings, e.depth, path, active,
        [&](uint32_t light) { return expressions_ || tables_->film_group[light] != kNoGroup; },
        [&](uint32_t light, const Color<F>& share) {
          add_by_light<Technique::kEmitter, F>(e.slot, share, UInt<F>(light), active);
        });
  }

  /// Copies the radiance of the paths in the first `slots` slots. The radiance must include the
  /// emission at the vertex at `depth`, but not the vertex's light sample.
  void end_depth(uint32_t depth, const float* radiance, size_t slots) const {
    if (depth < parts_.size() && parts_[depth])
      std::memcpy(parts_[depth].rows, radiance, slots * kRadianceWords * sizeof(float));
  }
  /// Copies the radiance of paths that have ended. The copy is used for the vertex at `depth` and
  /// for all later vertices.
  void end_path(uint32_t depth, const float* radiance, size_t slots) const {
    for (; depth < parts_.size(); ++depth) end_depth(depth, radiance, slots);
  }

  // ---- to the film ------------------------------------------------------------------------------

  /// Multiplies all radiance values by the camera's exposure.
  void expose(float exposure, size_t slots) const {
    const auto scale = [&](const Block& block, size_t words) {
      for (size_t i = 0; block && i < slots * words; ++i) block.rows[i] *= exposure;
    };
    for (const Block& part : parts_) scale(part, kRadianceWords);
    scale(early_connections_, kRadianceWords);
    scale(groups_, kRadianceWords * layout_.light_groups);
    expressions_.scale(exposure, slots);
    for (const Block& sums : by_technique_) scale(sums, kRadianceWords);
  }
  /// Adds the values of the paths in the slots [begin, end) to the pixel `pixel` of the film, in
  /// the order of slots. `radiance` points to an array with a `RadianceRow` for each slot.
  void resolve(AovFilm& film, size_t pixel, size_t begin, size_t end, const float* radiance) const;

  // Returns the radiance of light groups by path slot, or null if there are no light groups. Only
  // tests call this function.
  const float* group_rows() const { return groups_.rows; }

 private:
  using Block = SlotRows;

  /// Range [begin, end) of slots, whose paths belong to the same pixel.
  struct SlotRange {
    uint32_t begin, end;
    template <typename Each>
    void for_each(const Each& each) const {
      for (uint32_t slot = begin; slot < end; ++slot) each(slot);
    }
  };
  // Parts of resolve(). These functions add to the film, in this order: ends of camera rays; values
  // of vertices and first hits; radiance by source; bounces and costs.
  void resolve_ends(AovFilm& film, size_t pixel, const SlotRange& slots,
                    const float* radiance) const;
  void resolve_vertices(AovFilm& film, size_t pixel, const SlotRange& slots) const;
  void resolve_light(AovFilm& film, size_t pixel, const SlotRange& slots,
                     const float* radiance) const;
  void resolve_work(AovFilm& film, size_t pixel, const SlotRange& slots) const;
  /// Calls `put(aov, words)` for each AOV of the kind `kind` that is stored in `vertex_`. `words`
  /// points to the AOV's first word for slot 0.
  template <typename Put>
  void for_each_vertex_aov(AovKind kind, const Put& put) const;

  std::array<const Block*, 7> blocks() const {
    return {&vertex_, &parts_[0], &parts_[1], &early_connections_, &groups_, &guides_, &bounces_};
  }
  /// Returns the index of an AOV in `kTechniqueAovs`.
  static constexpr size_t technique_index(Aov aov) {
    size_t i = 0;
    while (kTechniqueAovs[i].aov != aov) ++i;
    return i;
  }

  /// Adds `c` to the sums of one light group, or to none if `group` is kNoGroup.
  template <typename F>
  void add_to_group(const UInt<F>& slot, const UInt<F>& group, const Color<F>& c,
                    const Mask<F>& active) const {
    const Mask<F> grouped = active & Mask<F>(group != UInt<F>(kNoGroup));
    if (any(grouped))
      add_radiance<F>(groups_.rows, slot * layout_.light_groups + group, c, grouped);
  }
  /// Adds `c` to the AOVs that separate lights. `source` has the meaning that it has in light().
  template <Technique kTechnique, typename F>
  void add_by_light(const UInt<F>& slot, const Color<F>& c, const UInt<F>& source,
                    const Mask<F>& active) const {
    constexpr bool kIsVolume = kTechnique == Technique::kVolume;
    constexpr bool kIsSample = kTechnique == Technique::kLightSample;
    if (groups_) {
      UInt<F> group = source;
      if constexpr (kIsVolume)
        group = UInt<F>(tables_->group_of_rest);
      else if constexpr (!kIsSample)
        group = group_of<F>(source, active);
      add_to_group<F>(slot, group, c, active);
    }
    if (expressions_) {
      if constexpr (kIsVolume)
        expressions_.add_volume_emission<F>(slot, c, active);
      else if constexpr (kIsSample)
        expressions_.add_light_sample<F>(slot, c, active);
      else if constexpr (kTechnique == Technique::kEmitter)
        expressions_.add<F>(slot, source, c, active);
    }
  }
  template <Technique kTechnique, typename F>
  void add_by_technique(const UInt<F>& slot, const Color<F>& c, const Mask<F>& active) const {
    for (size_t i = 0; i < std::size(kTechniqueAovs); ++i)
      if ((kTechniqueAovs[i].techniques & static_cast<uint32_t>(kTechnique)) && by_technique_[i])
        add_radiance<F>(by_technique_[i].rows, slot, c, active);
  }

  /// Value of `vertex_at_` for AOVs that are not stored in `vertex_`.
  static constexpr uint32_t kNoWords = 0xffffffffu;
  static constexpr std::array<uint32_t, kAovCount> no_words() {
    std::array<uint32_t, kAovCount> at{};
    at.fill(kNoWords);
    return at;
  }

  /// Stores the denoiser's guide values (albedo and normal) of paths whose previous vertices were
  /// all clear surfaces, such as glass and mirrors.
  template <typename F>
  void store_guides(const UInt<F>& slot, const VertexAovs<F>& v, const PathState<F>& path,
                    const Mask<F>& active) const {
    const GuideRow<F> before = load_row<GuideRow, F>(guides_.rows, slot, active);
    const Mask<F> updates = active & (before.is_final == 0.f);
    if (none(updates)) return;
    const Guides<F> g = guides_of<F>(v, path);
    store_row<GuideRow, F>(guides_.rows, slot,
                           {g.albedo, g.normal, select(v.is_clear, F(0.f), F(1.f))}, updates);
  }

  /// Adds the values of a vertex's bounce to the sums over all bounces. Does nothing if the vertex
  /// has no bounce.
  template <typename F>
  void add_bounce(const UInt<F>& slot, const VertexAovs<F>& v, const Mask<F>& active) const {
    const Mask<F> has_survival = active & (v.survival >= 0.f);
    if (none(has_survival)) return;
    BounceRow<F> row = load_row<BounceRow, F>(bounces_.rows, slot, has_survival);
    row.guided += v.guided;
    row.survived += v.survival;
    row.bounces += 1.f;
    store_row<BounceRow, F>(bounces_.rows, slot, row, has_survival);
  }

  AovLayout layout_;
  const AovTables* tables_ = nullptr;
  Block vertex_;
  /// For each AOV, the index of its first word in a row of `vertex_`, or `kNoWords`.
  std::array<uint32_t, kAovCount> vertex_at_ = no_words();
  std::array<Block, 2> parts_;  ///< radiance before the light samples of vertices 0 and 1
  /// Contributions of connections at the first vertices of camera paths. These contributions count
  /// as indirect light. They must be stored separately, since the difference between the two copies
  /// in `parts_`, which is the direct light, would otherwise include them.
  Block early_connections_;
  Block groups_;  ///< radiance of each light group; the values of a slot are adjacent
  Block guides_, bounces_;
  PathExpressions expressions_;
  std::array<Block, std::size(kTechniqueAovs)> by_technique_;  ///< in the order of kTechniqueAovs
  uint32_t wanted_techniques_ = 0;  ///< techniques whose contributions change an AOV
};

}  // namespace wavecomb
