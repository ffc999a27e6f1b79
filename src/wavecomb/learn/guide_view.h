// SPDX-License-Identifier: Apache-2.0
/// The field that guides bounces, as kernels read it.
///
/// Space is divided into cells, each cell by which way a surface faces into six regions, and a
/// region has the distribution of the directions where light comes from, as its surfaces reflect
/// it and as they are from its middle. Nothing of it changes while waves run.
#pragma once

#include <cstdint>

#include "wavecomb/learn/guide_sphere.h"

namespace wavecomb {

/// Bins of directions each way: 32 x 32 of equal solid angle, some 7 degrees wide.
inline constexpr uint32_t kGuideSide = 32;
inline constexpr uint32_t kGuideBins = kGuideSide * kGuideSide;
/// Words of a region's table: a row of marginals, then a row for each of them. A word is the
/// start of a bin's share of 65536 numbers in its low half, and how many it has in its high half.
inline constexpr uint32_t kGuideWords = kGuideSide + kGuideBins;
/// Ways that a surface can face: +x, -x, +y, -y, +z, -z.
inline constexpr uint32_t kGuideAxes = 6;

/// Cells lie in a grid of 2^4 each way, whose entries may be divided in 2^2 each way, three times.
inline constexpr uint32_t kGuideTopBits = 4, kGuideBrickBits = 2, kGuideLevels = 3;
inline constexpr uint32_t kGuideBits = kGuideTopBits + kGuideLevels * kGuideBrickBits;
static_assert(kGuideBits == 10, "morton_3 has ten bits for each axis");
inline constexpr uint32_t kGuideTopCells = 1u << (3 * kGuideTopBits);
inline constexpr uint32_t kGuideBrickCells = 1u << (3 * kGuideBrickBits);
/// An entry of the grid with this bit is a cell: its number is in the other bits. Without, it is
/// the first entry of the brick that divides it.
inline constexpr uint32_t kGuideCell = 0x80000000u;
inline constexpr uint32_t kNoGuideRegion = 0xffffffffu;

/// What kernels need of the field. Without a grid nothing is guided.
struct GuideView {
  const uint32_t* grid = nullptr;    ///< kGuideTopCells entries, then bricks
  const uint32_t* cells = nullptr;   ///< region, or kNoGuideRegion, of (kGuideAxes * cell + axis)
  const uint32_t* tables = nullptr;  ///< kGuideWords of each region
  const GuideSphere* spheres = nullptr;  ///< of each region: where its light lies
  const float* bsdf_share = nullptr;     ///< of each region: of bounces that the BSDF alone samples
  /// Of each region: the probability of going on of a path whose throughput over the brightness of
  /// the picture is 1, where that is a probability (learn/worth.h).
  const float* survival = nullptr;
  const float* material_share = nullptr;  ///< the least of those that a material allows
  /// One over the brightness of the picture, in tile_rows x tile_rows tiles; null: not known.
  const float* tiles = nullptr;
  uint32_t tile_rows = 0;
  float tiles_of_x = 0, tiles_of_y = 0;  ///< tiles in a pixel
  float lo[3] = {};                      ///< corner of the grid
  float scale[3] = {};                   ///< cells of 2^-kGuideBits of the grid in a unit of space
};

}  // namespace wavecomb
