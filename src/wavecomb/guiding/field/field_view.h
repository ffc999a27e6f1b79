// SPDX-License-Identifier: Apache-2.0
/// Device layout of the guiding field.
///
/// Space is divided into cells, and each cell into six regions by the axis direction that a surface
/// faces. A region holds the distribution of incident light times BSDF by direction, as seen from
/// the region's centre. The guiding field is constant while waves run.
#pragma once

#include <cstdint>

#include "wavecomb/guiding/parallax_sphere.h"

namespace wavecomb {

/// Number of direction bins per axis of the equal-area square. A bin is about 7 degrees wide.
inline constexpr uint32_t kGuidingSide = 32;
inline constexpr uint32_t kGuidingBins = kGuidingSide * kGuidingSide;
/// Number of 32-bit words in the table of a region, which consists of a marginal row and a
/// conditional row for each bin of the marginal row. The low half of a word is the first of the
/// 65536 sample values that select a bin, the high half is the number of these values.
inline constexpr uint32_t kGuidingWords = kGuidingSide + kGuidingBins;
/// Number of axis directions that a surface can face: +x, -x, +y, -y, +z, -z.
inline constexpr uint32_t kGuidingAxes = 6;

/// The top level of the grid has 2^4 entries per axis. An entry can be divided into a brick of 2^2
/// entries per axis, up to three times.
inline constexpr uint32_t kGuidingTopBits = 4, kGuidingBrickBits = 2, kGuidingLevels = 3;
inline constexpr uint32_t kGuidingBits = kGuidingTopBits + kGuidingLevels * kGuidingBrickBits;
static_assert(kGuidingBits == 10, "morton_3 has ten bits for each axis");
inline constexpr uint32_t kGuidingTopCells = 1u << (3 * kGuidingTopBits);
inline constexpr uint32_t kGuidingBrickCells = 1u << (3 * kGuidingBrickBits);
/// Flag of grid entries that refer to a cell; the remaining bits are the index of the cell. Without
/// the flag, an entry is the index of the first entry of a brick.
inline constexpr uint32_t kGuidingCell = 0x80000000u;
inline constexpr uint32_t kNoGuidingRegion = 0xffffffffu;

/// Pointers to the arrays of the guiding field. If `grid` is null, bounces are not guided.
struct GuidingView {
  const uint32_t* grid = nullptr;  ///< grid: kGuidingTopCells entries, followed by bricks
  /// Region, or kNoGuidingRegion, at index kGuidingAxes * cell + axis.
  const uint32_t* cells = nullptr;
  const uint32_t* tables = nullptr;  ///< kGuidingWords per region
  /// Sphere of each region on which its incident light is assumed to lie.
  const ParallaxSphere* spheres = nullptr;
  const float* bsdf_share = nullptr;  ///< probability that the BSDF samples a bounce, for each
                                      ///< region
  /// For each region, the survival probability, before clamping, of a path whose throughput equals
  /// the brightness of the image (guiding/roulette.h).
  const float* survival = nullptr;
  const float* material_share = nullptr;  ///< minimum of bsdf_share for each material
  /// One over the brightness of the image, in tile_rows x tile_rows tiles; null if the brightness
  /// is not known.
  const float* tiles = nullptr;
  uint32_t tile_rows = 0;
  float tiles_of_x = 0, tiles_of_y = 0;  ///< tiles per pixel
  float lo[3] = {};                      ///< lower corner of the grid
  float scale[3] = {};                   ///< grid steps per unit of length
};

}  // namespace wavecomb
