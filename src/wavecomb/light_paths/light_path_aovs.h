// SPDX-License-Identifier: Apache-2.0
/// AOV values of light paths, and the state from which they are computed. The state consists of the
/// light that emitted the path (in the PathRow), the number of scatterings and, for light path
/// expressions, a state of BackwardAutomaton for each colour.
///
/// Lobes are classified as on camera paths (path_expressions.h). A bounce counts as diffuse with a
/// probability equal to its diffuse fraction, otherwise as glossy; all colours use the same random
/// number of the vertex. The contribution of a vertex to the camera is divided between diffuse and
/// glossy scattering, in proportion to the vertex's diffuse fraction. For a connection, the
/// scattering at both of its vertices is split in this way.
///
/// Functions, in the order in which waves call them:
///   begin              a light path starts at a light
///   shade              a vertex of the light path was shaded
///   mark_stored        the vertex was stored for connections to camera paths
///   add_to_film        the camera sees the vertex
///   offer              a vertex of a camera path offers a connection to the stored vertex
///   record_connection  the stored vertex was shaded for the connection
///   connect            the connection is unoccluded
#pragma once

#include <bit>

#include "wavecomb/aov/aov_tables.h"
#include "wavecomb/aov/path_expressions.h"
#include "wavecomb/aov/rows.h"
#include "wavecomb/core/path_expressions/backward_automaton.h"
#include "wavecomb/core/rows/fields.h"
#include "wavecomb/film/film.h"
#include "wavecomb/film/splats/light_splat_filter.h"
#include "wavecomb/film/splats/light_splat_layout.h"
#include "wavecomb/path/path_state.h"

namespace wavecomb {

/// State of a light path for light path expressions.
template <typename F>
struct LightPathStateRow {
  UInt<F> states;  ///< automaton states of the three colours, in the layout of ExpressionRow
  // Automaton states before the last shaded vertex, and the scattering event of this vertex towards
  // the camera.
  UInt<F> splat_states, splat_event;
  Color<F> splat_diffuse;
  WAVECOMB_FIELDS(states, splat_states, splat_event, splat_diffuse)
};

/// Connection of a stored vertex of a light path with a vertex of a camera path. For both vertices,
/// the row contains the automaton states before the vertex and the classification of the scattering
/// along the connection. The names of the camera path's fields start with `camera_`.
template <typename F>
struct ConnectionStateRow {
  UInt<F> states, event;
  Color<F> diffuse;
  UInt<F> camera_states, camera_event;
  Color<F> camera_diffuse;
  WAVECOMB_FIELDS(states, event, diffuse, camera_states, camera_event, camera_diffuse)
};

/// Contribution of a vertex of a light path to the film.
struct LightSplat {
  uint32_t slot;   ///< slot of the light path
  uint32_t depth;  ///< depth of the vertex
  uint32_t light;  ///< light at which the path started
  LightSplatPoint at;
  Color<float> c;
};

/// AOV values of the light paths of a wave.
///
/// Contract: each object belongs to a single wave or reference integrator. Slot indices must be
/// below `capacity`.
class LightPathAovs {
 public:
  LightPathAovs() = default;
  /// `tables` may be null if no AOV in `layout` needs tables.
  LightPathAovs(size_t capacity, const AovLayout& layout, const AovTables* tables, bool connects)
      : layout_(layout), tables_(tables) {
    if (layout.expressions == 0) return;
    backward_ = &tables->backward;
    states_ = SlotRows(capacity, kRowWords<LightPathStateRow>);
    if (connects) connections_ = SlotRows(capacity, kRowWords<ConnectionStateRow>);
  }

  /// Returns whether any AOV layer needs contributions of light paths.
  explicit operator bool() const { return layout_.count > 0; }
  /// Returns whether shading must classify the scattering events of vertices.
  bool wants_events() const { return backward_ != nullptr; }
  size_t bytes() const { return states_.bytes() + connections_.bytes(); }

  /// Initialises the AOV state of light paths that start at lights `light`.
  template <typename F>
  [[gnu::noinline, gnu::cold]] void begin(const UInt<F>& slot, const UInt<F>& light,
                                          const Mask<F>& active) const {
    using U = UInt<F>;
    const Mask<U> on(active);
    const U end = gather<U>(tables_->end_of_light.data(), light, on);
    const U state = gather<U>(backward_->begin.data(), end, on);
    U states(0u);
    for (uint32_t c = 0; c < 3; ++c) states = states | (state << (ColourStates::kBits * c));
    store_row<LightPathStateRow, F>(states_.rows, slot, {states, states, U(0u), Color<F>(F(0.f))},
                                    active);
  }

  /// Updates the AOV state of light paths after a vertex was shaded. `v` contains the
  /// classification of the scattering events at the vertex.
  template <typename F>
  [[gnu::noinline, gnu::cold]] void shade(uint32_t depth, const UInt<F>& slot,
                                          const SampleKey<F>& key, const VertexAovs<F>& v,
                                          const Mask<F>& active) const {
    using U = UInt<F>;
    const U before = load_row<LightPathStateRow, F>(states_.rows, slot, active).states;
    const U path = path_hash<F>(key);
    const F u = unit_float<F>(hash_u32<U>(path, U(0x51ed270bu + depth)));
    const U states = ColourStates::after<F>(backward_->next.data(), before, v.bounce, u, active);
    store_row<LightPathStateRow, F>(
        states_.rows, slot, {states, before, v.light_scattering.event, v.light_scattering.diffuse},
        active);
  }

  /// Stores the automaton states of the last shaded vertex of each light path, since camera paths
  /// connect to this vertex.
  template <typename F>
  [[gnu::noinline, gnu::cold]] void mark_stored(const UInt<F>& slot, const Mask<F>& active) const {
    const UInt<F> states = load_row<LightPathStateRow, F>(states_.rows, slot, active).splat_states;
    scatter_field<F>(connections_.rows, &ConnectionStateRow<float>::states, slot, states, active);
  }

  /// Stores the automaton states and scattering events of camera path vertices that offer a
  /// connection. `states` are the automaton states of the camera paths before these vertices.
  template <typename F>
  [[gnu::noinline, gnu::cold]] void offer(const UInt<F>& slot, const UInt<F>& states,
                                          const ScatteringEvent<F>& scattering,
                                          const Mask<F>& active) const {
    ConnectionStateRow<F> row = load_row<ConnectionStateRow, F>(connections_.rows, slot, active);
    row.camera_states = states;
    row.camera_event = scattering.event;
    row.camera_diffuse = scattering.diffuse;
    store_row<ConnectionStateRow, F>(connections_.rows, slot, row, active);
  }

  /// Stores the scattering events at the stored vertices of light paths, after these vertices were
  /// shaded for a connection.
  template <typename F>
  [[gnu::noinline, gnu::cold]] void record_connection(const UInt<F>& slot,
                                                      const ScatteringEvent<F>& scattering,
                                                      const Mask<F>& active) const {
    ConnectionStateRow<F> row = load_row<ConnectionStateRow, F>(connections_.rows, slot, active);
    row.event = scattering.event;
    row.diffuse = scattering.diffuse;
    store_row<ConnectionStateRow, F>(connections_.rows, slot, row, active);
  }

  /// Adds the contribution `c` of connections to the light path expressions of camera paths, if
  /// there are any.
  template <typename F>
  [[gnu::noinline, gnu::cold]] void connect(const PathExpressions& to, const UInt<F>& slot,
                                            const Color<F>& c, const Mask<F>& active) const {
    using U = UInt<F>;
    if (!connections_ || none(active)) return;
    const ConnectionStateRow<F> row =
        load_row<ConnectionStateRow, F>(connections_.rows, slot, active);
    const auto split = [](const Color<F>& all, const Color<F>& share, const auto& add) {
      const Color<F> diffuse = all * share;
      add(kDiffuseEvent, diffuse);
      add(kGlossyEvent, all - diffuse);
    };
    split(c, row.diffuse, [&](uint32_t lobe, const Color<F>& light_part) {
      split(light_part, row.camera_diffuse, [&](uint32_t camera_lobe, const Color<F>& part) {
        for_each_colour<F>(part, [&](uint32_t k, const F& value) {
          const U from =
              ColourStates::next<F>(backward_->next.data(), ColourStates::of<F>(row.states, k),
                                    row.event, U(lobe), active);
          const U camera_state = to.next<F>(ColourStates::of<F>(row.camera_states, k),
                                            row.camera_event, U(camera_lobe), active);
          const U matched =
              gather<U>(backward_->matched.data(), from * backward_->forward_states + camera_state,
                        Mask<U>(active));
          to.add_matched<F>(slot, k, matched, value, active);
        });
      });
    });
  }

  /// Adds a light splat to the layers of the film. The sums are integers, so that the order does
  /// not matter.
  void add_to_film(Film& film, const LightSplatFilter& filter, const LightSplat& splat) const;

 private:
  LightSplatLayout layout_;
  const AovTables* tables_ = nullptr;
  const BackwardAutomaton* backward_ = nullptr;  ///< null without expressions
  SlotRows states_, connections_;
};

}  // namespace wavecomb
