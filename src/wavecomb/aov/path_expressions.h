// SPDX-License-Identifier: Apache-2.0
/// Radiance of paths for each light path expression (core/path_expressions/path_expression.h). The
/// functions of this file run only if the render has light path expressions.
///
/// A path stores an automaton state for each colour component (red, green, blue). If a fraction s
/// of the scattered light in a colour component is diffuse, the automaton of this component
/// receives the diffuse event with probability s, and the glossy event otherwise. All three
/// components use the same random number. Later contributions are added without weights to all
/// expressions that match the state. Complementary layers therefore add up to the beauty, and each
/// layer is unbiased. Light samples are split in proportion to s, without a random choice. The
/// emission of a light that a bounce hits is split in the same way if the light has different
/// diffuse and specular multipliers.
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

/// State of a path for light path expressions, as a row of 32-bit words.
template <typename F>
struct ExpressionRow {
  UInt<F> states;  ///< automaton states of the three colour components, ten bits each
  // Values of the current light sample: the automaton states before scattering, the scattering
  // event, the path end, and the diffuse fraction of the scattered light.
  UInt<F> light_states, light_event, light_end;
  Color<F> light_diffuse;
  // Values of the last bounce, for lights with multipliers: the automaton states before the bounce,
  // the scattering event plus 1 (0 for a specular bounce and before the first bounce), and the
  // diffuse fraction of the scattered light.
  UInt<F> from_states, bounce;
  Color<F> bounce_diffuse;
  WAVECOMB_FIELDS(states, light_states, light_event, light_end, light_diffuse, from_states, bounce,
                  bounce_diffuse)
};

/// Calls `each(index, value)` for the three components of a colour.
template <typename F, typename Each>
inline void for_each_colour(const Color<F>& c, const Each& each) {
  each(0u, c.x);
  each(1u, c.y);
  each(2u, c.z);
}

/// Functions for the automaton states of the three colour components, which are packed in one word.
struct ColourStates {
  static constexpr uint32_t kBits = 10, kMask = 1023;
  static_assert(PathAutomaton::kMaxStates <= kMask + 1);

  template <typename F>
  static UInt<F> of(const UInt<F>& states, uint32_t colour) {
    return (states >> (kBits * colour)) & kMask;
  }
  /// Returns the automaton state after a scattering event. `table` is the automaton's transition
  /// table. Events in volumes and subsurface random walks have no diffuse and glossy variants.
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

/// States and radiance of the paths of a wave for all light path expressions.
///
/// Contract: the object belongs to a `PathAovs` object. Path slots must be below the capacity, and
/// the slots of active lanes must be distinct.
class PathExpressions {
 public:
  PathExpressions() = default;
  /// `end_of_light` contains the index (`path_end()`) of the path end of each light, followed by
  /// the path ends of other emissive surfaces and of volumes. `multipliers` contains the diffuse
  /// and the specular multiplier of each light. If `multipliers` is empty, all multipliers are 1.
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
  /// Returns the radiance of the path in `slot` as three RGB values for each expression.
  const float* sums(size_t slot) const { return sums_.floats(0) + slot * words_; }

  /// Resets the states and the radiance of the first `slots` path slots.
  void clear(size_t slots) {
    if (!*this) return;
    std::memset(rows_.floats(0), 0, slots * kRowWords<ExpressionRow> * sizeof(float));
    std::memset(sums_.floats(0), 0, slots * words_ * sizeof(float));
  }
  void scale(float factor, size_t slots) const {
    for (size_t i = 0; *this && i < slots * words_; ++i) sums_.floats(0)[i] *= factor;
  }

  /// Adds `c`, a contribution of the light `light`, to the paths. `light` may be `kNoLight`.
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

  /// Adds `c`, the emission of volumes, to the paths.
  template <typename F>
  [[gnu::noinline, gnu::cold]] void add_volume_emission(const UInt<F>& slot, const Color<F>& c,
                                                        const Mask<F>& active) const {
    if (none(active)) return;
    const UInt<F> states = load_row<ExpressionRow, F>(rows_.floats(0), slot, active).states;
    add_to<F>(slot, states, UInt<F>(end_of_light_[lights_ + 1]), c, active);
  }

  /// Updates the automaton states at a shaded vertex. `v` contains the kind of scattering of the
  /// light sample and of the bounce. `has_shadow` marks the lanes with a light sample.
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
    const U path = path_hash<F>(key);
    const F u = unit_float<F>(hash_u32<U>(path, U(0x2c1b3c6du + depth)));
    row.from_states = row.states;
    row.bounce = select(Mask<U>(v.bounce.is_delta), U(0u), v.bounce.event + 1u);
    row.bounce_diffuse = v.bounce.diffuse;
    row.states = ColourStates::after<F>(automaton_->next.data(), row.states, v.bounce, u, active);
    store_row<ExpressionRow, F>(rows_.floats(0), slot, row, active);
  }

  /// Updates the automaton states after a random walk through a medium inside a mesh.
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
  /// Adds `c`, the emission of a light that a bounce hits, if the light's diffuse and specular
  /// multipliers differ. Splits `c` between the diffuse and glossy events of the bounce in
  /// proportion to their contributions. Returns a mask of the lanes whose lights have different
  /// multipliers.
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
  /// Returns the automaton states of all three colour components after a scattering event.
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
  /// Adds each component of `c` to the expressions that match the component's automaton state and
  /// the path end `end`.
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
