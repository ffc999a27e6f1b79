// SPDX-License-Identifier: Apache-2.0
/// Light path expressions: which paths' light a layer holds, as a regular expression over what
/// happens to a path (docs/light-path-expressions.md), and the automaton that all expressions of a
/// render are made into.
///
/// A path is the camera, a number of scatterings and what brought the light. Kernels know none of
/// the text: a path carries a state, which each scattering leads on, and light that reaches it
/// belongs to the expressions that a table has for the state and what brought it.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

namespace wavecomb {

/// An expression and the name of its layer.
struct NamedExpression {
  std::string name, text;
  bool operator==(const NamedExpression&) const = default;
};

/// What a scattering does: reflects or transmits, by a diffuse, a glossy or a singular lobe (a
/// mirror's); or is one within a volume; or leads below a surface, to walk there and leave by a
/// reflection.
enum class PathEvent : uint32_t { kReflection = 0, kTransmission = 3, kVolume = 6, kBelow = 7 };
inline constexpr uint32_t kPathEvents = 8;
/// To be added to a reflection or a transmission.
inline constexpr uint32_t kDiffuseEvent = 0, kGlossyEvent = 1, kSingularEvent = 2;

/// What brings light: a light, a dome (which is a light, too), or an object or a volume that
/// shines.
enum class PathEnd : uint32_t { kLight, kBackground, kObject, kVolume };
inline constexpr uint32_t kPathEnds = 4;
/// The number of an end whose light is of group `key`.
constexpr uint32_t path_end(PathEnd end, uint32_t key) {
  return kPathEnds * key + static_cast<uint32_t>(end);
}

/// The least automaton that follows all expressions of a render at once.
///
/// Contract: immutable. State 0 is that of a path that has left the camera.
struct PathAutomaton {
  static constexpr uint32_t kMostExpressions = 32;
  static constexpr uint32_t kMostStates = 1024;
  /// Words of a row of `next`.
  static constexpr uint32_t kNextWords = 8;

  PathAutomaton() = default;
  /// `keys`: the light groups by number. Throws Error for a text that is no expression, naming the
  /// place, and for a key that is not among them.
  PathAutomaton(std::span<const NamedExpression> expressions, std::span<const std::string> keys);

  uint32_t expressions = 0;       ///< how many
  uint32_t ends = 0;              ///< numbers of path_end
  std::vector<uint32_t> next;     ///< [state][event], kNextWords a state
  std::vector<uint32_t> matched;  ///< [state][end]: a bit for each expression
  uint32_t states() const { return static_cast<uint32_t>(next.size() / kNextWords); }
};

/// Throws Error, one line that names the place, where a text is no expression, and for names of
/// layers that are not good or there twice. Keys are not looked at.
void check_expressions(std::span<const NamedExpression> expressions);

}  // namespace wavecomb
