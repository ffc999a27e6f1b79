// SPDX-License-Identifier: Apache-2.0
/// Light path expressions, which are regular expressions over the events of a path and select the
/// light in a layer (docs/light-path-expressions.md). An automaton is built from all expressions of
/// a render.
///
/// A path consists of the camera, scattering events, and the emitter. A path stores an automaton
/// state, which each event changes. When a light contributes to the path, a table gives the
/// matching expressions for the state and the kind of light.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

namespace wavecomb {

/// Light path expression and the name of its layer.
struct NamedExpression {
  std::string name, text;
  bool operator==(const NamedExpression&) const = default;
};

/// Scattering event of a path: reflection or transmission by a diffuse, glossy or singular (mirror)
/// lobe, scattering in a volume, or the entry into a subsurface random walk. The exit of the walk
/// is a separate event, a diffuse reflection.
enum class PathEvent : uint32_t {
  kReflection = 0,
  kTransmission = 3,
  kVolume = 6,
  kSubsurface = 7
};
inline constexpr uint32_t kPathEvents = 8;
/// Offsets that select the lobe when added to PathEvent::kReflection or kTransmission.
inline constexpr uint32_t kDiffuseEvent = 0, kGlossyEvent = 1, kSingularEvent = 2;

/// Emitter at the end of a path: a light, a dome light, or an emissive object or volume.
enum class PathEnd : uint32_t { kLight, kBackground, kObject, kVolume };
inline constexpr uint32_t kPathEnds = 4;
/// Returns the index of a path end of kind `end` whose light belongs to the light group `key`.
constexpr uint32_t path_end(PathEnd end, uint32_t key) {
  return kPathEnds * key + static_cast<uint32_t>(end);
}

/// Minimal deterministic automaton that evaluates all expressions of a render at once.
///
/// Contract: immutable. State 0 is the state of a path that has just left the camera.
struct PathAutomaton {
  static constexpr uint32_t kMaxExpressions = 32;
  static constexpr uint32_t kMaxStates = 1024;
  /// Number of words per row of `next`.
  static constexpr uint32_t kNextWords = 8;

  PathAutomaton() = default;
  /// Builds the automaton. `keys` contains the names of the light groups. Throws an `Error` that
  /// states the position in the text if an expression is invalid or uses an unknown light group.
  PathAutomaton(std::span<const NamedExpression> expressions, std::span<const std::string> keys);

  uint32_t expressions = 0;  ///< number of expressions
  uint32_t ends = 0;         ///< number of path ends, as indexed by path_end()
  /// Transition table, indexed by state and event, with `kNextWords` words per state.
  std::vector<uint32_t> next;
  std::vector<uint32_t>
      matched;  ///< bit sets of the matched expressions, indexed by state and path end
  uint32_t states() const { return static_cast<uint32_t>(next.size() / kNextWords); }
};

/// Throws an `Error` if an expression is invalid, or if a layer name is invalid or repeated. The
/// one-line message states the position in the text. Names of light groups are not checked.
void check_expressions(std::span<const NamedExpression> expressions);

}  // namespace wavecomb
