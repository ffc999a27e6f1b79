// SPDX-License-Identifier: Apache-2.0
/// What paths from the lights bring AOVs, and what they keep for it: the light that has sent them,
/// which their rows have, how often they were scattered, and, for light path expressions, a state
/// of BackwardAutomaton for each colour.
///
/// Lobes are told apart as camera paths do (path_expressions.h): a bounce goes on as diffuse with
/// the probability of that share, each colour by one number of the vertex; what a vertex shows to
/// who looks is split by the share itself. A connection is split at both of its vertices.
///
///   begin   a path starts at a light
///   shade   a vertex was shaded
///   keep    it is the one of its path that camera paths connect to
///   show    the camera sees it: the light goes to the film's sums
///   offer, link, connect   a vertex of a camera path, one from the light, and the ray between
#pragma once

#include <bit>

#include "wavecomb/core/backward_automaton.h"
#include "wavecomb/core/fields.h"
#include "wavecomb/film/film.h"
#include "wavecomb/film/splat_filter.h"
#include "wavecomb/film/splat_places.h"
#include "wavecomb/integrate/aov_tables.h"
#include "wavecomb/integrate/path_aov_rows.h"
#include "wavecomb/integrate/path_expressions.h"
#include "wavecomb/integrate/path_state.h"

namespace wavecomb {

/// How a path from a light has come.
template <typename F>
struct LightWayRow {
  UInt<F> states;  ///< of the three colours, as ExpressionRow has them
  // Of the vertex that was shaded: the states before it, and how it scatters towards who looks.
  UInt<F> shown_states, shown_event;
  Color<F> shown_diffuse;
  WAVECOMB_FIELDS(states, shown_states, shown_event, shown_diffuse)
};

/// Of a vertex from the light that is kept: the states before it, and how it scatters towards the
/// vertex of the camera path; and of that its state before, and how it scatters.
template <typename F>
struct LinkRow {
  UInt<F> states, event;
  Color<F> diffuse;
  UInt<F> seen_states, seen_event;
  Color<F> seen_diffuse;
  WAVECOMB_FIELDS(states, event, diffuse, seen_states, seen_event, seen_diffuse)
};

/// Contract: owned by one wave, or one reference integrator; slots below the capacity.
class LightPathAovs {
 public:
  LightPathAovs() = default;
  /// `tables` may be null where nothing of `layout` needs them.
  LightPathAovs(size_t capacity, const AovLayout& layout, const AovTables* tables, bool connects)
      : places_(layout), tables_(tables) {
    if (layout.expressions == 0) return;
    backward_ = &tables->backward;
    ways_ = SlotRows(capacity, kRowWords<LightWayRow>);
    if (connects) links_ = SlotRows(capacity, kRowWords<LinkRow>);
  }

  /// Whether what they bring is wanted by layer.
  explicit operator bool() const { return places_.count > 0; }
  /// Whether it is to be known how vertices scatter.
  bool wants_events() const { return backward_ != nullptr; }
  size_t bytes() const { return ways_.bytes() + links_.bytes(); }

  /// Paths have left lights `light`.
  template <typename F>
  [[gnu::noinline, gnu::cold]] void begin(const UInt<F>& slot, const UInt<F>& light,
                                          const Mask<F>& active) const {
    using U = UInt<F>;
    const Mask<U> on(active);
    const U end = gather<U>(tables_->end_of_light.data(), light, on);
    const U state = gather<U>(backward_->begin.data(), end, on);
    U states(0u);
    for (uint32_t c = 0; c < 3; ++c) states = states | (state << (ColourStates::kBits * c));
    store_row<LightWayRow, F>(ways_.rows, slot, {states, states, U(0u), Color<F>(F(0.f))}, active);
  }

  /// A vertex was shaded: `v` says how it scatters.
  template <typename F>
  [[gnu::noinline, gnu::cold]] void shade(uint32_t depth, const UInt<F>& slot,
                                          const SampleKey<F>& key, const VertexAovs<F>& v,
                                          const Mask<F>& active) const {
    using U = UInt<F>;
    const U before = load_row<LightWayRow, F>(ways_.rows, slot, active).states;
    const U path = hash_u32<U>(key.pixel_hash, key.sample);
    const F u = unit_float<F>(hash_u32<U>(path, U(0x51ed270bu + depth)));
    const U states = ColourStates::after<F>(backward_->next.data(), before, v.bounce, u, active);
    store_row<LightWayRow, F>(ways_.rows, slot, {states, before, v.lit.event, v.lit.diffuse},
                              active);
  }

  /// The vertex that was shaded is the one to connect to.
  template <typename F>
  [[gnu::noinline, gnu::cold]] void keep(const UInt<F>& slot, const Mask<F>& active) const {
    const UInt<F> states = load_row<LightWayRow, F>(ways_.rows, slot, active).shown_states;
    scatter_field<F>(links_.rows, &LinkRow<float>::states, slot, states, active);
  }

  /// Vertices of camera paths, which were in `states` before, offer a connection.
  template <typename F>
  [[gnu::noinline, gnu::cold]] void offer(const UInt<F>& slot, const UInt<F>& states,
                                          const ScatteringNote<F>& note,
                                          const Mask<F>& active) const {
    LinkRow<F> row = load_row<LinkRow, F>(links_.rows, slot, active);
    row.seen_states = states;
    row.seen_event = note.event;
    row.seen_diffuse = note.diffuse;
    store_row<LinkRow, F>(links_.rows, slot, row, active);
  }

  /// The vertices that were kept were shaded for it.
  template <typename F>
  [[gnu::noinline, gnu::cold]] void link(const UInt<F>& slot, const ScatteringNote<F>& note,
                                         const Mask<F>& active) const {
    LinkRow<F> row = load_row<LinkRow, F>(links_.rows, slot, active);
    row.event = note.event;
    row.diffuse = note.diffuse;
    store_row<LinkRow, F>(links_.rows, slot, row, active);
  }

  /// The connection has brought the camera paths `c`.
  template <typename F>
  [[gnu::noinline, gnu::cold]] void connect(const PathExpressions& to, const UInt<F>& slot,
                                            const Color<F>& c, const Mask<F>& active) const {
    using U = UInt<F>;
    if (none(active)) return;
    const LinkRow<F> row = load_row<LinkRow, F>(links_.rows, slot, active);
    const auto split = [](const Color<F>& all, const Color<F>& share, const auto& add) {
      const Color<F> diffuse = all * share;
      add(kDiffuseEvent, diffuse);
      add(kGlossyEvent, all - diffuse);
    };
    split(c, row.diffuse, [&](uint32_t lobe, const Color<F>& shown) {
      split(shown, row.seen_diffuse, [&](uint32_t seen_lobe, const Color<F>& part) {
        for_each_colour<F>(part, [&](uint32_t k, const F& value) {
          const U from =
              ColourStates::next<F>(backward_->next.data(), ColourStates::of<F>(row.states, k),
                                    row.event, U(lobe), active);
          const U seen = to.next<F>(ColourStates::of<F>(row.seen_states, k), row.seen_event,
                                    U(seen_lobe), active);
          const U matched = gather<U>(backward_->matched.data(),
                                      from * backward_->forward_states + seen, Mask<U>(active));
          to.add_matched<F>(slot, k, matched, value, active);
        });
      });
    });
  }

  /// The vertex at `depth` of the path in `slot`, which light `light` has sent, shows the camera
  /// `c` at (x, y) of the film. Integers: the order does not matter.
  void show(Film& film, const SplatFilter& filter, uint32_t slot, uint32_t depth, uint32_t light,
            float x, float y, const Color<float>& c) const;

 private:
  SplatPlaces places_;
  const AovTables* tables_ = nullptr;
  const BackwardAutomaton* backward_ = nullptr;  ///< null: there are no expressions
  SlotRows ways_, links_;
};

}  // namespace wavecomb
