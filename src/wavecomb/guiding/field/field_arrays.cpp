// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/guiding/field/field_arrays.h"

#include <algorithm>
#include <cmath>
#include <span>

#include "wavecomb/core/error.h"
#include "wavecomb/guiding/field/field_view.h"

namespace wavecomb {
namespace {

/// Returns whether the grid is valid: kGuidingTopCells entries followed by bricks. No two entries
/// refer to the same brick, and bricks are nested at most kGuidingLevels deep. Every entry that is
/// not divided refers to a cell with an index below `cells`.
bool is_grid(std::span<const uint32_t> entries, size_t cells) {
  if (entries.size() < kGuidingTopCells ||
      (entries.size() - kGuidingTopCells) % kGuidingBrickCells != 0)
    return false;
  std::vector<uint32_t> bricks{0}, next;  // their first entries
  std::vector<bool> visited((entries.size() - kGuidingTopCells) / kGuidingBrickCells);
  for (uint32_t level = 0; level <= kGuidingLevels; ++level) {
    next.clear();
    for (const uint32_t first : bricks)
      for (const uint32_t e :
           entries.subspan(first, level == 0 ? kGuidingTopCells : kGuidingBrickCells)) {
        if (e >= kGuidingCell) {
          if ((e & (kGuidingCell - 1)) >= cells) return false;
          continue;
        }
        const size_t brick = (size_t{e} - kGuidingTopCells) / kGuidingBrickCells;
        if (e < kGuidingTopCells || (e - kGuidingTopCells) % kGuidingBrickCells != 0 ||
            brick >= visited.size() || visited[brick] || level == kGuidingLevels)
          return false;
        visited[brick] = true;
        next.push_back(e);
      }
    bricks.swap(next);
  }
  return true;
}

/// Returns whether a row of a sampling table is valid: it assigns each of the 65536 sample values
/// to a bin, and at least one sample value to each bin.
bool is_row(std::span<const uint32_t> words) {
  uint32_t start = 0;
  for (const uint32_t word : words) {
    if ((word & 0xffffu) != start || word >> 16 == 0) return false;
    start += word >> 16;
  }
  return start == 1u << 16;
}

bool are_rows(std::span<const uint32_t> tables) {
  for (size_t at = 0; at < tables.size(); at += kGuidingSide)
    if (!is_row(tables.subspan(at, kGuidingSide))) return false;
  return true;
}

bool are_spheres(std::span<const ParallaxSphere> spheres) {
  return std::all_of(spheres.begin(), spheres.end(), [](const ParallaxSphere& s) {
    return std::isfinite(s.centre[0]) && std::isfinite(s.centre[1]) && std::isfinite(s.centre[2]) &&
           std::isfinite(s.inverse_distance) && s.inverse_distance >= 0;
  });
}

bool are_between(std::span<const float> values, float least, float most) {
  return std::all_of(values.begin(), values.end(),
                     [=](float v) { return least <= v && v <= most; });
}

}  // namespace

void check_guiding_arrays(const GuidingFieldArrays& parts, size_t materials) {
  static_assert(kGuidingWords % kGuidingSide == 0, "a table is rows");
  const size_t regions = parts.bsdf_share.size();
  const bool is_field =
      regions > 0 && parts.tables.size() == regions * kGuidingWords &&
      parts.survival.size() == regions && parts.spheres.size() == regions &&
      are_spheres(parts.spheres) && parts.material_share.size() == std::max<size_t>(materials, 1) &&
      parts.cells.size() % kGuidingAxes == 0 &&
      std::all_of(parts.cells.begin(), parts.cells.end(),
                  [=](uint32_t r) { return r < regions || r == kNoGuidingRegion; }) &&
      is_grid(parts.entries, parts.cells.size() / kGuidingAxes) && are_rows(parts.tables) &&
      // The BSDF fraction of a region is positive; the minimum fraction of a material may be 0,
      // which means that it is unknown.
      are_between(parts.bsdf_share, 0x1p-20f, 1.f) && are_between(parts.material_share, 0.f, 1.f);
  if (!is_field)
    throw Error("the saved guiding field does not fit this scene or is damaged; train a new one");
}

}  // namespace wavecomb
