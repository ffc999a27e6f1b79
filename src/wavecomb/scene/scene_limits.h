// SPDX-License-Identifier: Apache-2.0
/// How many of each thing the 32-bit numbers of kernels reach.
#pragma once

#include <cstdint>
#include <string>

namespace wavecomb {

/// Words of a table that lanes gather from: the indices of a gather are signed.
inline constexpr uint64_t kGatherWords = uint64_t{1} << 31;
/// Words of a table whose rows lanes load: theirs are not.
inline constexpr uint64_t kMostRowWords = uint64_t{1} << 32;

/// Instances that kernels can number, of 16 words each; the first is the world.
inline constexpr uint64_t kMaxInstances = kGatherWords / 16 - 1;

/// What a scene has of what kernels index.
struct SceneCounts {
  uint64_t meshes = 0, materials = 0, instances = 0;
  uint64_t grouped = 0;         ///< meshes of all groups
  uint64_t placed = 0;          ///< meshes of all instances, the world's among them
  uint64_t placements = 0;      ///< of groups, those among them that hold groups alone
  uint64_t steps = 0;           ///< transforms of instances that move
  uint64_t lights = 0;          ///< with placed mesh lights and portals
  uint64_t profile_values = 0;  ///< angles and candela of IES profiles
  uint64_t link_words =
      0;  ///< sets of geometry that lights are linked to, a bit each, times classes
};

/// Throws Error for the first of them that is more than can be numbered: what, how many and what to
/// do, in one line.
void check_counts(const SceneCounts& counts);

/// 16777216 as "16,777,216".
std::string with_commas(uint64_t n);

}  // namespace wavecomb
