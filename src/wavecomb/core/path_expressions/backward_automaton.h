// SPDX-License-Identifier: Apache-2.0
/// Automaton that evaluates light path expressions along light paths, which run from the light
/// towards the camera.
///
/// The events between a vertex and the light define a function f. It maps the `PathAutomaton` state
/// that a camera path has before these events to the set of matched expressions. A light path
/// stores the index of f. Adding an event x on the camera side changes f to f'(q) = f(next(q, x)).
/// The functions that are reachable from the functions of all path ends are the states of the
/// minimal automaton of the reversed expressions (J. Brzozowski, "Canonical regular expressions and
/// minimal state graphs for definite events", 1962).
#pragma once

#include <cstdint>
#include <vector>

#include "wavecomb/core/path_expressions/path_expression.h"

namespace wavecomb {

/// Minimal deterministic automaton of the reversed light path expressions.
///
/// Contract: immutable.
struct BackwardAutomaton {
  static constexpr uint32_t kMaxStates = PathAutomaton::kMaxStates;

  BackwardAutomaton() = default;
  /// Builds the automaton. Throws `Error` if the automaton would have more than `kMaxStates`
  /// states.
  explicit BackwardAutomaton(const PathAutomaton& forward);

  uint32_t forward_states = 0;
  std::vector<uint32_t>
      begin;  ///< initial state of a light path, indexed by the path end where it starts
  /// Transition table, indexed by state and event, with `PathAutomaton::kNextWords` words per
  /// state.
  std::vector<uint32_t> next;
  /// Bit sets of the matched expressions, indexed by the state of this automaton and the state of
  /// the forward automaton.
  std::vector<uint32_t> matched;
  uint32_t states() const { return static_cast<uint32_t>(next.size() / PathAutomaton::kNextWords); }
};

}  // namespace wavecomb
