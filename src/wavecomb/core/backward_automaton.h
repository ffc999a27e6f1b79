// SPDX-License-Identifier: Apache-2.0
/// Light path expressions as paths from the lights read them: from their end.
///
/// What the scatterings between a vertex and the light mean to a PathAutomaton is a function: from
/// the state that a path from the camera would have before them to the expressions that it would
/// match. A path from a light carries the number of that function f, and a scattering x that comes
/// before makes of it
///   f'(q) = f(next(q, x)).
/// The functions that there are, from those of all ends on, are the least automaton of the
/// expressions read backwards (J. Brzozowski, "Canonical regular expressions and minimal state
/// graphs for definite events", 1962).
#pragma once

#include <cstdint>
#include <vector>

#include "wavecomb/core/path_expression.h"

namespace wavecomb {

/// Contract: immutable.
struct BackwardAutomaton {
  static constexpr uint32_t kMostStates = PathAutomaton::kMostStates;

  BackwardAutomaton() = default;
  /// Throws Error where there are more than kMostStates functions.
  explicit BackwardAutomaton(const PathAutomaton& forward);

  uint32_t forward_states = 0;
  std::vector<uint32_t> begin;    ///< [end]: state of a path that has left it
  std::vector<uint32_t> next;     ///< [state][event], PathAutomaton::kNextWords a state
  std::vector<uint32_t> matched;  ///< [state][state of the forward one]: a bit for each expression
  uint32_t states() const { return static_cast<uint32_t>(next.size() / PathAutomaton::kNextWords); }
};

}  // namespace wavecomb
