// SPDX-License-Identifier: Apache-2.0
/// Radiance of paths by light path expressions (core/path_expression.h). Run only where there are
/// any.
///
/// A path carries a state for each of its three colours. Where a scattering is partly diffuse, the
/// share s of a colour, that colour goes on as diffuse with probability s, by one number of the
/// vertex for all three, and else as glossy. Whatever light comes then is added whole to what the
/// state says, so that the layers of a partition add up to the beauty, and each has the mean that
/// its lobes bring. Light samples are split by s itself: they need no choice. So is what a bounce
/// meets of a light that gives the two lobes other shares of itself.
#pragma once

#include <array>
#include <cstring>

#include "wavecomb/core/fields.h"
#include "wavecomb/core/hash.h"
#include "wavecomb/core/path_expression.h"
#include "wavecomb/core/sampler.h"
#include "wavecomb/core/soa.h"
#include "wavecomb/integrate/path_state.h"

namespace wavecomb {

/// What a path keeps of itself.
template <typename F>
struct ExpressionRow {
  UInt<F> states;  ///< of the three colours, ten bits each
  // Of the light sample under way: the states that it found, its event, its end, and the share of
  // it that is diffuse.
  UInt<F> lit_states, lit_event, lit_end;
  Color<F> lit_diffuse;
  // Of the last bounce, for lights with multipliers: the states before it, 1 + its event, or 0 of a
  // mirror and before the first, and the share of it that is diffuse.
  UInt<F> from_states, bounce;
  Color<F> bounce_diffuse;
  WAVECOMB_FIELDS(states, lit_states, lit_event, lit_end, lit_diffuse, from_states, bounce,
                  bounce_diffuse)
};

/// Runs each(number, value) for the three colours.
template <typename F, typename Each>
inline void for_each_colour(const Color<F>& c, const Each& each) {
  each(0u, c.x);
  each(1u, c.y);
  each(2u, c.z);
}

/// States of an automaton for the three colours in one word, and how scatterings lead on from them.
struct ColourStates {
  static constexpr uint32_t kBits = 10, kMask = 1023;
  static_assert(PathAutomaton::kMostStates <= kMask + 1);

  template <typename F>
  static UInt<F> of(const UInt<F>& states, uint32_t colour) {
    return (states >> (kBits * colour)) & kMask;
  }
  /// The state after a scattering, by an automaton's table `next`; those in volumes and below
  /// surfaces have no lobes.
  template <typename F>
  static UInt<F> next(const uint32_t* table, const UInt<F>& state, const UInt<F>& event,
                      const UInt<F>& lobe, const Mask<F>& active) {
    using U = UInt<F>;
    const U volume(static_cast<uint32_t>(PathEvent::kVolume));
    const U at =
        state * PathAutomaton::kNextWords + event + select(Mask<U>(event < volume), lobe, U(0u));
    return gather<U>(table, at, Mask<U>(active));
  }
  /// The states after a bounce, of whose lobes `u` in [0, 1) chooses one for each colour.
  template <typename F>
  static UInt<F> after(const uint32_t* table, const UInt<F>& states,
                       const ScatteringNote<F>& bounce, const F& u, const Mask<F>& active) {
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

/// Contract: owned by one PathAovs; slots below the capacity. Light in the active lanes' slots,
/// which are distinct.
class PathExpressions {
 public:
  PathExpressions() = default;
  /// `end_of_light`: path_end of each light, and at the end those of what is no light: surfaces,
  /// then volumes. `multipliers`: of each light, diffuse and specular; empty where all are 1.
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
  /// Radiance of a path in `slot`, rgb, expression by expression.
  const float* sums(size_t slot) const { return sums_.floats(0) + slot * words_; }

  /// Forgets the paths in slots below `slots`.
  void clear(size_t slots) {
    if (!*this) return;
    std::memset(rows_.floats(0), 0, slots * kRowWords<ExpressionRow> * sizeof(float));
    std::memset(sums_.floats(0), 0, slots * words_ * sizeof(float));
  }
  void scale(float factor, size_t slots) const {
    for (size_t i = 0; *this && i < slots * words_; ++i) sums_.floats(0)[i] *= factor;
  }

  /// Light `light`, or kNoLight, has reached the paths.
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

  /// Volumes that shine have.
  template <typename F>
  [[gnu::noinline, gnu::cold]] void add_glow(const UInt<F>& slot, const Color<F>& c,
                                             const Mask<F>& active) const {
    if (none(active)) return;
    const UInt<F> states = load_row<ExpressionRow, F>(rows_.floats(0), slot, active).states;
    add_to<F>(slot, states, UInt<F>(end_of_light_[lights_ + 1]), c, active);
  }

  /// A vertex was shaded: `v` says how it scatters. `has_shadow`: where a light sample is under
  /// way.
  template <typename F>
  [[gnu::noinline, gnu::cold]] void scatter(uint32_t depth, const UInt<F>& slot,
                                            const SampleKey<F>& key, const VertexAovs<F>& v,
                                            const Mask<F>& has_shadow,
                                            const Mask<F>& active) const {
    using U = UInt<F>;
    ExpressionRow<F> row = load_row<ExpressionRow, F>(rows_.floats(0), slot, active);
    row.lit_states = row.states;
    row.lit_event = v.lit.event;
    row.lit_diffuse = v.lit.diffuse;
    row.lit_end = end_of<F>(v.lit_by, has_shadow);
    const U path = hash_u32<U>(key.pixel_hash, key.sample);
    const F u = unit_float<F>(hash_u32<U>(path, U(0x2c1b3c6du + depth)));
    row.from_states = row.states;
    row.bounce = select(Mask<U>(v.bounce.is_delta), U(0u), v.bounce.event + 1u);
    row.bounce_diffuse = v.bounce.diffuse;
    row.states = ColourStates::after<F>(automaton_->next.data(), row.states, v.bounce, u, active);
    store_row<ExpressionRow, F>(rows_.floats(0), slot, row, active);
  }

  /// The paths have walked through what scatters within a mesh.
  template <typename F>
  [[gnu::noinline, gnu::cold]] void walk(const UInt<F>& slot, const Mask<F>& active) const {
    using U = UInt<F>;
    ExpressionRow<F> row = load_row<ExpressionRow, F>(rows_.floats(0), slot, active);
    row.states =
        next_of_all<F>(row.states, U(static_cast<uint32_t>(PathEvent::kVolume)), U(0u), active);
    row.bounce = U(0u);
    store_row<ExpressionRow, F>(rows_.floats(0), slot, row, active);
  }

  /// The light sample under way has brought `c`.
  template <typename F>
  [[gnu::noinline, gnu::cold]] void add_lit(const UInt<F>& slot, const Color<F>& c,
                                            const Mask<F>& active) const {
    using U = UInt<F>;
    if (none(active)) return;
    const ExpressionRow<F> row = load_row<ExpressionRow, F>(rows_.floats(0), slot, active);
    const Color<F> diffuse = c * row.lit_diffuse;
    const auto add_part = [&](uint32_t lobe, const Color<F>& part) {
      add_to<F>(slot, next_of_all<F>(row.lit_states, row.lit_event, U(lobe), active), row.lit_end,
                part, active);
    };
    add_part(kDiffuseEvent, diffuse);
    add_part(kGlossyEvent, c - diffuse);
  }

  /// The states of paths.
  template <typename F>
  UInt<F> states(const UInt<F>& slot, const Mask<F>& active) const {
    return load_row<ExpressionRow, F>(rows_.floats(0), slot, active).states;
  }
  /// The state after a scattering.
  template <typename F>
  UInt<F> next(const UInt<F>& state, const UInt<F>& event, const UInt<F>& lobe,
               const Mask<F>& active) const {
    return ColourStates::next<F>(automaton_->next.data(), state, event, lobe, active);
  }
  /// Adds light of a colour to the expressions in `matched`.
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
  /// Adds what a bounce has met of lights with multipliers: each of its two lobes gets what that
  /// light gives to it, so that they add up to `c`. Where it was so.
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
  /// The same of the states of all colours.
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
  /// Adds `c`, colour by colour, to the expressions that hold what ends so in such states.
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
