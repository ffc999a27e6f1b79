// SPDX-License-Identifier: Apache-2.0
/// Syntax trees of light path expressions.
#pragma once

#include <bitset>
#include <string>
#include <vector>

#include "wavecomb/core/path_expressions/path_expression.h"

namespace wavecomb {

/// Indices of the symbols of a path: the camera first, then the scattering events, then the path
/// ends.
inline constexpr size_t kCameraSymbol = 0, kFirstEvent = 1, kFirstEnd = kFirstEvent + kPathEvents;
inline constexpr size_t kMaxKeys = 64;
using PathSymbols = std::bitset<kFirstEnd + kPathEnds * kMaxKeys>;

/// Node of a syntax tree. A node matches one of a set of symbols, a sequence of child nodes, one of
/// several child nodes, or a repetition of a child node.
struct PathPattern {
  enum class Kind : uint8_t { kSymbols, kSequence, kChoice, kRepeat };
  static constexpr uint32_t kUnlimited = 0xffffffffu;

  Kind kind = Kind::kSequence;
  PathSymbols symbols{};
  std::vector<PathPattern> parts{};
  uint32_t least = 1, most = 1;  ///< minimum and maximum number of repetitions, for kRepeat
};

/// Parses an expression. `keys` contains the names of the light groups; null accepts any name.
/// Throws an `Error` that states the position in the text if the expression is invalid.
PathPattern parse_expression(const NamedExpression& expression,
                             const std::span<const std::string>* keys);

}  // namespace wavecomb
