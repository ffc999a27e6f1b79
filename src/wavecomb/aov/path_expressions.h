// SPDX-License-Identifier: Apache-2.0
/// Radiance of paths by light path expressions (core/path_expressions/path_expression.h). The
/// functions run only if the render has light path expressions.
///
/// A path stores an automaton state for each of its three colours. At a scattering event whose
/// diffuse fraction in a colour is s, the automaton takes the diffuse event for that colour with
/// probability s, and the glossy event otherwise; all three colours use the same random number.
/// Later contributions are added in full to the expressions that match the state, so that
/// complementary layers add up to the beauty and each layer has the correct mean. Light samples are
/// split in proportion to s, without a random choice. Emission that a bounce hits is also split
/// directly if the light has different diffuse and specular multipliers.
#pragma once

#include <array>
#include <cstring>

#include "wavecomb/core/encoding/hash.h"
#include "wavecomb/core/path_expressions/path_expression.h"
#include "wavecomb/core/rows/fields.h"
#include "wavecomb/core/rows/soa.h"
#include "wavecomb/core/sampler.h"
#include "wavecomb/path/path_state.h"

namespace wavecomb {

/// Row with the state of a path for light path expressions.
template <typename F>
struct ExpressionRow {
  UInt<F> states;  ///< automaton states of the three colours, ten bits each
  // Current light sample: automaton states before the scattering, scattering event, path end, and
  // diffuse fraction.
  UInt<F> light_states, light_event, light_end;
  Color<F> light_diffuse;
  // Last bounce, for lights with multipliers: automaton states before the bounce, its event plus 1
  // (0 for a specular bounce and before the first bounce), and its diffuse fraction.
  UInt<F> from_states, bounce;
  Color<F> bounce_diffuse;
  WAVECOMB_FIELDS(states, light_states, light_event, light_end, light_diffuse, from_states, bounce,
                  bounce_diffuse)
};

/// Calls each(index, value) for the three colours.
template <typename F, typename Each>
inline void for_each_colour(const Color<F>& c, const Each& each) {
  each(0u, c.x);
  each(1u, c.y);
  each(2u, c.z);
}

/// Automaton states of the three colours in one word, and their transitions.
struct ColourStates {
  static constexpr uint32_t kBits = 10, kMask = 1023;
  static_assert(PathAutomaton::kMaxStates <= kMask + 1);

  template <typename F>
  static UInt<F> of(const UInt<F>& states, uint32_t colour) {
    return (states >> (kBits * colour)) & kMask;
  }
  /// Returns the automaton state after a scattering event, from the automaton's table `next`.
  /// Scatterings in volumes and subsurface bodies have no diffuse or glossy lobes.
  template <typename F>
  static UInt<F> next(const uint32_t* table, const UInt<F>& state, const UInt<F>& event,
                      const UInt<F>& lobe, const Mask<F>& active) {
    using U = UInt<F>;
    const U volume(static_cast<uint32_t>(PathEvent::kVolume));
    const U at =
        state * PathAutomaton::kNextWords + event + select(Mask<U>(event < volume), lobe, U(0u));
    return gather<U>(table, at, Mask<U>(active));
  }
  /// Returns the automaton states after a bounce. `u` in [0, 1) chooses the lobe of each colour.
  template <typename F>
  static UInt<F> after(const uint32_t* table, const UInt<F>& states,
                       const ScatteringEvent<F>& bounce, const F& u, const Mask<F>& active) {
    using U = UInt<F>;
    U all(0u);
    for_each_colour<F>(bounce.diffuse, [&](uint32_t c, const F& share) {
      const U lobe = select(Mask<U>(bounce.is_delta), U(kSingularEvent),
                            select(Mask<U>(Mask<F>(u < share)), U(kDiffuseEvent), U(kGlossyEvent)));
      all = all | (next<F>(table, of<F>(states, c), bounce.event, lobe, active) << (kBits * c));
    });
    return all;
  }
};

/// Light path expression states and sums of the paths of a wave.
///
/// Contract: owned by a PathAovs object. Slots must be below the capacity, and the slots of the
/// active lanes must be distinct.
class PathExpressions {
 public:
  PathExpressions() = default;
  /// `end_of_light` holds the path end (path_end()) of each light, followed by the path ends of
  /// other surfaces and of volumes. `multipliers` holds the diffuse and specular multiplier of each
  /// light; empty means that all are 1.
  PathExpressions(size_t capacity, const PathAutomaton& automaton,
                  const std::vector<uint32_t>& end_of_light, const std::vector<float>& multipliers)
      : automaton_(&automaton),
        end_of_light_(end_of_light.data()),
        multipliers_(multipliers.empty() ? nullptr : multipliers.data()),
        lights_(static_cast<uint32_t>(end_of_light.size() - 2)),
        words_(3 * automaton.expressions),
        rows_(1, capacity * kRowWords<ExpressionRow>),
        sums_(1, capacity * words_) {}

  explicit operator bool() const { return automaton_ != nullptr; }
  size_t bytes() const { return rows_.bytes() + sums_.bytes(); }
  /// Returns the radiance of the path in `slot`: rgb for each expression.
  const float* sums(size_t slot) const { return sums_.floats(0) + slot * words_; }

  /// Clears the rows of the first `slots` path slots.
  void clear(size_t slots) {
    if (!*this) return;
    std::memset(rows_.floats(0), 0, slots * kRowWords<ExpressionRow> * sizeof(float));
    std::memset(sums_.floats(0), 0, slots * words_ * sizeof(float));
  }
  void scale(float factor, size_t slots) const {
    for (size_t i = 0; *this && i < slots * words_; ++i) sums_.floats(0)[i] *= factor;
  }

  /// Adds a contribution of `light`, or kNoLight, to the paths.
  template <typename F>
  [[gnu::noinline, gnu::cold]] void add(const UInt<F>& slot, const UInt<F>& light,
                                        const Color<F>& c, const Mask<F>& active) const {
    if (none(active)) return;
    const ExpressionRow<F> row = load_row<ExpressionRow, F>(rows_.floats(0), slot, active);
    const UInt<F> end = end_of<F>(light, active);
    Mask<F> whole = active;
    if (multipliers_) [[unlikely]]
      whole = whole & not_(add_by_parts<F>(slot, row, light, end, c, active));
    add_to<F>(slot, row.states, end, c, whole);
  }

  /// Adds emission of volumes to the paths.
  template <typename F>
  [[gnu::noinline, gnu::cold]] void add_volume_emission(const UInt<F>& slot, const Color<F>& c,
                                                        const Mask<F>& active) const {
    if (none(active)) return;
    const UInt<F> states = load_row<ExpressionRow, F>(rows_.floats(0), slot, active).states;
    add_to<F>(slot, states, UInt<F>(end_of_light_[lights_ + 1]), c, active);
  }

  /// Records a shaded vertex; `v` contains the classification of its scattering events.
  /// `has_shadow` marks the lanes with a light sample.
  template <typename F>
  [[gnu::noinline, gnu::cold]] void scatter(uint32_t depth, const UInt<F>& slot,
                                            const SampleKey<F>& key, const VertexAovs<F>& v,
                                            const Mask<F>& has_shadow,
                                            const Mask<F>& active) const {
    using U = UInt<F>;
    ExpressionRow<F> row = load_row<ExpressionRow, F>(rows_.floats(0), slot, active);
    row.light_states = row.states;
    row.light_event = v.light_scattering.event;
    row.light_diffuse = v.light_scattering.diffuse;
    row.light_end = end_of<F>(v.light_id, has_shadow);
    const U path = hash_u32<U>(key.pixel_hash, key.sample);
    const F u = unit_float<F>(hash_u32<U>(path, U(0x2c1b3c6du + depth)));
    row.from_states = row.states;
    row.bounce = select(Mask<U>(v.bounce.is_delta), U(0u), v.bounce.event + 1u);
    row.bounce_diffuse = v.bounce.diffuse;
    row.states = ColourStates::after<F>(automaton_->next.data(), row.states, v.bounce, u, active);
    store_row<ExpressionRow, F>(rows_.floats(0), slot, row, active);
  }

  /// Records a random walk through a medium inside a mesh.
  template <typename F>
  [[gnu::noinline, gnu::cold]] void walk(const UInt<F>& slot, const Mask<F>& active) const {
    using U = UInt<F>;
    ExpressionRow<F> row = load_row<ExpressionRow, F>(rows_.floats(0), slot, active);
    row.states =
        next_of_all<F>(row.states, U(static_cast<uint32_t>(PathEvent::kVolume)), U(0u), active);
    row.bounce = U(0u);
    store_row<ExpressionRow, F>(rows_.floats(0), slot, row, active);
  }

  /// Adds the contribution `c` of the current light sample.
  template <typename F>
  [[gnu::noinline, gnu::cold]] void add_light_sample(const UInt<F>& slot, const Color<F>& c,
                                                     const Mask<F>& active) const {
    using U = UInt<F>;
    if (none(active)) return;
    const ExpressionRow<F> row = load_row<ExpressionRow, F>(rows_.floats(0), slot, active);
    const Color<F> diffuse = c * row.light_diffuse;
    const auto add_part = [&](uint32_t lobe, const Color<F>& part) {
      add_to<F>(slot, next_of_all<F>(row.light_states, row.light_event, U(lobe), active),
                row.light_end, part, active);
    };
    add_part(kDiffuseEvent, diffuse);
    add_part(kGlossyEvent, c - diffuse);
  }

  /// Returns the automaton states of the paths.
  template <typename F>
  UInt<F> states(const UInt<F>& slot, const Mask<F>& active) const {
    return load_row<ExpressionRow, F>(rows_.floats(0), slot, active).states;
  }
  /// Returns the automaton state after a scattering event.
  template <typename F>
  UInt<F> next(const UInt<F>& state, const UInt<F>& event, const UInt<F>& lobe,
               const Mask<F>& active) const {
    return ColourStates::next<F>(automaton_->next.data(), state, event, lobe, active);
  }
  /// Adds one colour component of a contribution to the expressions whose bits are set in
  /// `matched`.
  template <typename F>
  void add_matched(const UInt<F>& slot, uint32_t colour, const UInt<F>& matched, const F& value,
                   const Mask<F>& active) const {
    using U = UInt<F>;
    for (uint32_t e = 0; e < automaton_->expressions; ++e) {
      const Mask<F> here = active & Mask<F>(((matched >> e) & 1u) != U(0u));
      if (none(here)) continue;
      const U word = slot * words_ + (3 * e + colour);
      const F before = gather<F>(sums_.floats(0), word, here);
      wavecomb::scatter<F>(sums_.floats(0), F(before + value), word, here);
    }
  }

 private:
  /// Adds the emission that a bounce hits, for lights whose two multipliers differ. Splits `c`
  /// between the diffuse and glossy lobes of the bounce in proportion to their contributions.
  /// Returns the lanes whose lights have two different multipliers.
  template <typename F>
  [[gnu::noinline, gnu::cold]] Mask<F> add_by_parts(const UInt<F>& slot,
                                                    const ExpressionRow<F>& row,
                                                    const UInt<F>& light, const UInt<F>& end,
                                                    const Color<F>& c,
                                                    const Mask<F>& active) const {
    using U = UInt<F>;
    const Mask<F> known = active & Mask<F>(light != U(kNoLight)) & Mask<F>(row.bounce != U(0u));
    const U at = select(Mask<U>(known), light + light, U(0u));
    const F d = gather<F>(multipliers_, at, known), s = gather<F>(multipliers_, at + 1u, known);
    const Mask<F> here = known & not_(Mask<F>(d == s));
    if (none(here)) return here;
    const auto share = [&](const F& diffuse) {
      const F part = diffuse * d, all = fma(F(1.f - diffuse), s, part);
      return select(all > 0.f, F(part / select(all > 0.f, all, F(1.f))), F(0.f));
    };
    const Color<F> diffuse = c * Color<F>(share(row.bounce_diffuse.x), share(row.bounce_diffuse.y),
                                          share(row.bounce_diffuse.z));
    const auto add_part = [&](uint32_t lobe, const Color<F>& part) {
      add_to<F>(slot, next_of_all<F>(row.from_states, row.bounce - 1u, U(lobe), here), end, part,
                here);
    };
    add_part(kDiffuseEvent, diffuse);
    add_part(kGlossyEvent, c - diffuse);
    return here;
  }
  /// Returns the automaton states of all three colours after a scattering event.
  template <typename F>
  UInt<F> next_of_all(const UInt<F>& states, const UInt<F>& event, const UInt<F>& lobe,
                      const Mask<F>& active) const {
    UInt<F> all(0u);
    for (uint32_t i = 0; i < 3; ++i)
      all = all | (next<F>(ColourStates::of<F>(states, i), event, lobe, active)
                   << (ColourStates::kBits * i));
    return all;
  }
  template <typename F>
  UInt<F> end_of(const UInt<F>& light, const Mask<F>& active) const {
    using U = UInt<F>;
    return gather<U>(end_of_light_, select(Mask<U>(light == U(kNoLight)), U(lights_), light),
                     Mask<U>(active));
  }
  /// Adds `c`, colour by colour, to the expressions that match the states and the path end `end`.
  template <typename F>
  void add_to(const UInt<F>& slot, const UInt<F>& states, const UInt<F>& end, const Color<F>& c,
              const Mask<F>& active) const {
    using U = UInt<F>;
    for_each_colour<F>(c, [&](uint32_t colour, const F& value) {
      const U at = ColourStates::of<F>(states, colour) * automaton_->ends + end;
      const U matched = select(Mask<U>(active),
                               gather<U>(automaton_->matched.data(), at, Mask<U>(active)), U(0u));
      add_matched<F>(slot, colour, matched, value, active);
    });
  }

  const PathAutomaton* automaton_ = nullptr;
  const uint32_t* end_of_light_ = nullptr;
  const float* multipliers_ = nullptr;
  uint32_t lights_ = 0, words_ = 0;
  SoaBlock rows_, sums_;
};

}  // namespace wavecomb
