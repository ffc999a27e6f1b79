// SPDX-License-Identifier: Apache-2.0
/// Syntax trees of light path expressions.
#pragma once

#include <bitset>
#include <string>
#include <vector>

#include "wavecomb/core/path_expressions/path_expression.h"

namespace wavecomb {

/// Indices of path symbols: the camera, then events, then ends.
inline constexpr size_t kCameraSymbol = 0, kFirstEvent = 1, kFirstEnd = kFirstEvent + kPathEvents;
inline constexpr size_t kMaxKeys = 64;
using PathSymbols = std::bitset<kFirstEnd + kPathEnds * kMaxKeys>;

/// Node of a syntax tree: one of a set of symbols, a sequence of parts, an alternative of parts, or
/// a repeated part.
struct PathPattern {
  enum class Kind : uint8_t { kSymbols, kSequence, kChoice, kRepeat };
  static constexpr uint32_t kUnlimited = 0xffffffffu;

  Kind kind = Kind::kSequence;
  PathSymbols symbols{};
  std::vector<PathPattern> parts{};
  uint32_t least = 1, most = 1;  ///< repetition counts of the part, for kRepeat
};

/// Parses an expression. `keys`: names of the light groups by index; null accepts any name. Throws
/// Error that gives the position of the mistake in the text.
PathPattern parse_expression(const NamedExpression& expression,
                             const std::span<const std::string>* keys);

}  // namespace wavecomb
