// SPDX-License-Identifier: Apache-2.0
/// Automaton that evaluates light path expressions for light paths, in reverse order.
///
/// The events between a vertex and the light act on a PathAutomaton as a function f: it maps the
/// state of a camera path before these events to the set of matched expressions. A light path
/// stores the index of f. A further event x on the camera side of these events changes f to f'(q) =
/// f(next(q, x)). The functions that are reachable from the functions of all ends form the minimal
/// automaton of the reversed expressions (J. Brzozowski, "Canonical regular expressions and minimal
/// state graphs for definite events", 1962).
#pragma once

#include <cstdint>
#include <vector>

#include "wavecomb/core/path_expressions/path_expression.h"

namespace wavecomb {

/// Automaton of the reversed expressions.
///
/// Contract: immutable.
struct BackwardAutomaton {
  static constexpr uint32_t kMaxStates = PathAutomaton::kMaxStates;

  BackwardAutomaton() = default;
  /// Throws Error if the automaton would have more than kMaxStates states.
  explicit BackwardAutomaton(const PathAutomaton& forward);

  uint32_t forward_states = 0;
  std::vector<uint32_t> begin;  ///< [end]: initial state of a light path that starts at this end
  /// Transition table [state][event], with PathAutomaton::kNextWords words per state.
  std::vector<uint32_t> next;
  /// Matched expressions [state][forward state], with one bit per expression.
  std::vector<uint32_t> matched;
  uint32_t states() const { return static_cast<uint32_t>(next.size() / PathAutomaton::kNextWords); }
};

}  // namespace wavecomb
