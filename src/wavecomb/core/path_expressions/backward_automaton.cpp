// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/core/path_expressions/backward_automaton.h"

#include <map>
#include <utility>

#include "wavecomb/core/error.h"

namespace wavecomb {
namespace {

/// For each state of the forward automaton, a bit set of the expressions that match.
using MatchedFrom = std::vector<uint32_t>;

}  // namespace

BackwardAutomaton::BackwardAutomaton(const PathAutomaton& forward)
    : forward_states(forward.states()) {
  std::map<MatchedFrom, uint32_t> numbers;
  std::vector<MatchedFrom> functions;
  const auto number = [&](MatchedFrom f) {
    const auto [at, is_new] = numbers.try_emplace(f, static_cast<uint32_t>(functions.size()));
    if (is_new) functions.push_back(std::move(f));
    if (functions.size() > kMaxStates)
      throw Error(
          "light path expressions: light paths would need too many states; use fewer "
          "expressions or less repetition, or transport path");
    return at->second;
  };
  for (uint32_t end = 0; end < forward.ends; ++end) {
    MatchedFrom f(forward_states);
    for (uint32_t q = 0; q < forward_states; ++q) f[q] = forward.matched[q * forward.ends + end];
    begin.push_back(number(std::move(f)));
  }
  for (uint32_t i = 0; i < functions.size(); ++i)
    for (uint32_t event = 0; event < PathAutomaton::kNextWords; ++event) {
      MatchedFrom f(forward_states);
      for (uint32_t q = 0; q < forward_states; ++q)
        f[q] = functions[i][forward.next[q * PathAutomaton::kNextWords + event]];
      next.push_back(number(std::move(f)));
    }
  for (const MatchedFrom& f : functions) matched.insert(matched.end(), f.begin(), f.end());
}

}  // namespace wavecomb
