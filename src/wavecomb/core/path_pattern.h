// SPDX-License-Identifier: Apache-2.0
/// A light path expression as a tree: what is between its text and the automaton.
#pragma once

#include <bitset>
#include <string>
#include <vector>

#include "wavecomb/core/path_expression.h"

namespace wavecomb {

/// Symbols of a path: the camera, then events, then ends.
inline constexpr size_t kCameraSymbol = 0, kFirstEvent = 1, kFirstEnd = kFirstEvent + kPathEvents;
inline constexpr size_t kMostKeys = 64;
using PathSymbols = std::bitset<kFirstEnd + kPathEnds * kMostKeys>;

/// One of some symbols; parts one after the other; one of some parts; or a part several times.
struct PathPattern {
  enum class Kind : uint8_t { kSymbols, kSequence, kChoice, kRepeat };
  static constexpr uint32_t kUnlimited = 0xffffffffu;

  Kind kind = Kind::kSequence;
  PathSymbols symbols{};
  std::vector<PathPattern> parts{};
  uint32_t least = 1, most = 1;  ///< of kRepeat
};

/// Reads an expression. `keys`: the light groups by number; null: any will do. Throws Error that
/// names the place.
PathPattern parse_expression(const NamedExpression& expression,
                             const std::span<const std::string>* keys);

}  // namespace wavecomb
