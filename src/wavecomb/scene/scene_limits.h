// SPDX-License-Identifier: Apache-2.0
/// Limits that 32-bit indices of kernels impose on the number of objects.
#pragma once

#include <cstdint>
#include <string>

namespace wavecomb {

/// Maximum size in 32-bit words of a table read by gather instructions, whose indices are signed.
inline constexpr uint64_t kGatherWords = uint64_t{1} << 31;
/// Maximum size in 32-bit words of a table whose rows are loaded whole, with unsigned indices.
inline constexpr uint64_t kMaxRowWords = uint64_t{1} << 32;

/// Maximum number of instances, including the world. A record of an instance has 16 32-bit words.
inline constexpr uint64_t kMaxInstances = kGatherWords / 16 - 1;

/// Number of objects of each kind that kernels access by index.
struct SceneCounts {
  uint64_t meshes = 0, materials = 0, instances = 0;
  uint64_t grouped = 0;           ///< number of meshes in all groups
  uint64_t instanced_meshes = 0;  ///< number of meshes in all instances, including the world
  uint64_t placements = 0;        ///< nested instances, including those that contain only groups
  uint64_t steps = 0;             ///< number of transforms of all moving instances
  uint64_t lights = 0;  ///< number of lights, including instances of mesh lights and portals
  uint64_t profile_values = 0;  ///< number of angles and candela values of all IES profiles
  /// size in 32-bit words of the table for light linking: one bit per geometry set and link class
  uint64_t link_words = 0;
};

/// Throws Error if a count exceeds its limit. The message says in one line which limit was
/// exceeded, how many objects there are, and what to do.
void check_counts(const SceneCounts& counts);

/// Formats 16777216 as "16,777,216".
std::string with_commas(uint64_t n);

}  // namespace wavecomb
