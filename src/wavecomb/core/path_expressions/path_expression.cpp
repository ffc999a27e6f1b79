// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/core/path_expressions/path_expression.h"

#include <algorithm>
#include <map>
#include <utility>

#include "wavecomb/core/error.h"
#include "wavecomb/core/path_expressions/path_pattern.h"

namespace wavecomb {
namespace {

constexpr uint32_t kMaxNfaStates = 2000;
/// Maximum number of states of the deterministic automaton before minimisation.
constexpr size_t kMaxSets = 4096;
using StateSet = std::vector<uint32_t>;  ///< set of states, stored as state numbers in ascending
                                         ///< order

/// Nondeterministic automaton of all expressions (Thompson 1968).
class PathNfa {
 public:
  explicit PathNfa(std::string names) : names_(std::move(names)) {}

  void add_expression(const PathPattern& pattern) {
    const uint32_t start = add_state();
    starts_.push_back(start);
    finals_.push_back(add(pattern, start));
  }
  StateSet start() const { return closed(starts_); }
  StateSet step(const StateSet& from, size_t symbol) const {
    StateSet to;
    for (const uint32_t state : from)
      for (const Edge& edge : edges_[state])
        if (edge.symbols.test(symbol)) to.push_back(edge.to);
    return closed(std::move(to));
  }
  /// Returns a bit set of the expressions that end in one of the states.
  uint32_t matched(const StateSet& states) const {
    uint32_t bits = 0;
    for (size_t e = 0; e < finals_.size(); ++e)
      if (std::binary_search(states.begin(), states.end(), finals_[e])) bits |= 1u << e;
    return bits;
  }

 private:
  struct Edge {
    PathSymbols symbols;
    uint32_t to;
  };

  uint32_t add_state() {
    if (edges_.size() == kMaxNfaStates)
      throw Error("light path expressions " + names_ +
                  ": they are too long; use fewer expressions or less repetition");
    edges_.emplace_back();
    free_.emplace_back();
    return static_cast<uint32_t>(edges_.size() - 1);
  }
  /// Adds the states of a pattern that starts at state `from`, which must have no incoming edges
  /// from the pattern. Returns the end state of the pattern.
  uint32_t add(const PathPattern& p, uint32_t from) {
    using Kind = PathPattern::Kind;
    if (p.kind == Kind::kSequence) {
      for (const PathPattern& part : p.parts) from = add(part, from);
      return from;
    }
    if (p.kind == Kind::kRepeat) return add_repeat(p, from);
    const uint32_t to = add_state();
    if (p.kind == Kind::kSymbols) edges_[from].push_back({p.symbols, to});
    for (const PathPattern& part : p.parts) free_[add(part, from)].push_back(to);
    return to;
  }
  uint32_t add_repeat(const PathPattern& p, uint32_t from) {
    const PathPattern& part = p.parts.front();
    for (uint32_t n = 0; n < p.least; ++n) from = add(part, from);
    const uint32_t to = add_state();
    free_[from].push_back(to);
    if (p.most == PathPattern::kUnlimited) {
      free_[add(part, to)].push_back(to);
      const uint32_t after = add_state();
      free_[to].push_back(after);
      return after;
    }
    for (uint32_t n = p.least; n < p.most; ++n) {
      from = add(part, from);
      free_[from].push_back(to);
    }
    return to;
  }
  /// Returns the epsilon closure of a set: the set and all states that are reachable without a
  /// symbol.
  StateSet closed(StateSet states) const {
    std::vector<uint8_t> seen(edges_.size(), 0);
    for (const uint32_t s : states) seen[s] = 1;
    for (size_t i = 0; i < states.size(); ++i)
      for (const uint32_t to : free_[states[i]])
        if (!std::exchange(seen[to], uint8_t{1})) states.push_back(to);
    std::sort(states.begin(), states.end());
    states.erase(std::unique(states.begin(), states.end()), states.end());
    return states;
  }

  std::string names_;
  std::vector<std::vector<Edge>> edges_;
  std::vector<std::vector<uint32_t>> free_;
  StateSet starts_;
  std::vector<uint32_t> finals_;
};

/// Transitions and matched expressions of a state of the automaton before minimisation.
struct PathStateRow {
  std::vector<uint32_t> next, matched;
  auto operator<=>(const PathStateRow&) const = default;
};

/// Makes a deterministic automaton by subset construction and returns its reachable states. The
/// first state is the state after the camera event.
std::vector<PathStateRow> reached_rows(const PathNfa& nfa, uint32_t ends) {
  std::map<StateSet, uint32_t> numbers;
  std::vector<StateSet> sets;
  const auto number = [&](StateSet set) {
    const auto [at, is_new] = numbers.try_emplace(set, static_cast<uint32_t>(sets.size()));
    if (is_new) sets.push_back(std::move(set));
    return at->second;
  };
  number(nfa.step(nfa.start(), kCameraSymbol));
  std::vector<PathStateRow> rows;
  for (size_t i = 0; i < sets.size() && i <= kMaxSets; ++i) {
    PathStateRow row;
    const StateSet from = sets[i];
    for (size_t e = 0; e < kPathEvents; ++e)
      row.next.push_back(number(nfa.step(from, kFirstEvent + e)));
    for (size_t e = 0; e < ends; ++e)
      row.matched.push_back(nfa.matched(nfa.step(from, kFirstEnd + e)));
    rows.push_back(std::move(row));
  }
  return rows;
}

/// Minimises an automaton by merging equivalent states (Moore 1956). The first state remains the
/// first.
std::vector<PathStateRow> minimal_rows(const std::vector<PathStateRow>& rows) {
  std::vector<uint32_t> classes(rows.size(), 0);
  std::vector<PathStateRow> least;
  for (size_t known = 0;;) {
    std::map<PathStateRow, uint32_t> numbers;
    std::vector<uint32_t> finer;
    least.clear();
    for (const PathStateRow& row : rows) {
      PathStateRow mapped{row.next, row.matched};
      for (uint32_t& to : mapped.next) to = classes[to];
      const auto [at, is_new] = numbers.try_emplace(mapped, static_cast<uint32_t>(numbers.size()));
      if (is_new) least.push_back(std::move(mapped));
      finer.push_back(at->second);
    }
    const bool is_done = numbers.size() == known && finer == classes;
    known = numbers.size();
    classes = std::move(finer);
    if (is_done) return least;
  }
}

std::string names_of(std::span<const NamedExpression> expressions) {
  std::string names;
  for (const NamedExpression& one : expressions) names += (names.empty() ? "" : ", ") + one.name;
  return names;
}

}  // namespace

PathAutomaton::PathAutomaton(std::span<const NamedExpression> all,
                             std::span<const std::string> keys)
    : expressions(static_cast<uint32_t>(all.size())),
      ends(kPathEnds * static_cast<uint32_t>(keys.size())) {
  PathNfa nfa(names_of(all));
  for (const NamedExpression& one : all) nfa.add_expression(parse_expression(one, &keys));
  std::vector<PathStateRow> rows = reached_rows(nfa, ends);
  if (rows.size() <= kMaxSets) rows = minimal_rows(rows);
  if (rows.size() > kMaxStates)
    throw Error("light path expressions " + names_of(all) +
                ": they need too many states; use fewer expressions or less repetition");
  for (const PathStateRow& row : rows) {
    next.insert(next.end(), row.next.begin(), row.next.end());
    next.resize((next.size() + kNextWords - 1) / kNextWords * kNextWords);
    matched.insert(matched.end(), row.matched.begin(), row.matched.end());
  }
}

void check_expressions(std::span<const NamedExpression> expressions) {
  if (expressions.size() > PathAutomaton::kMaxExpressions)
    throw Error("there are " + std::to_string(expressions.size()) +
                " light path expressions; the limit is " +
                std::to_string(PathAutomaton::kMaxExpressions));
  for (size_t i = 0; i < expressions.size(); ++i) {
    const NamedExpression& one = expressions[i];
    const auto is_symbol = [](char c) {
      return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_';
    };
    if (one.name.empty() || !std::all_of(one.name.begin(), one.name.end(), is_symbol))
      throw Error("light path expression '" + one.name +
                  "': the name may contain only letters, digits and underscores");
    for (size_t j = 0; j < i; ++j)
      if (expressions[j].name == one.name)
        throw Error("light path expression " + one.name + ": the name is used twice");
    PathNfa nfa(one.name);
    nfa.add_expression(parse_expression(one, nullptr));
    if (nfa.step(nfa.start(), kCameraSymbol).empty())
      throw Error("light path expression " + one.name + "=" + one.text +
                  ": it does not begin with a camera; write C first");
  }
}

}  // namespace wavecomb
