// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/guiding/sampling_table.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

namespace wavecomb {
namespace {

/// Assigns 65536 sample values to kGuideSide bins by weight. Each bin gets one, and the rest
/// follows the rounded cumulative sum, so that the total is exact.
void write_row(std::span<const double, kGuideSide> weights, std::span<uint32_t, kGuideSide> words) {
  constexpr uint32_t kNumbers = 1u << 16;
  const double all = std::accumulate(weights.begin(), weights.end(), 0.0);
  const double free = kNumbers - kGuideSide;
  double running = 0;
  uint32_t start = 0;
  for (uint32_t i = 0; i < kGuideSide; ++i) {
    running += all > 0 ? weights[i] / all : 1.0 / kGuideSide;
    const bool last = i + 1 == kGuideSide;
    const uint32_t end =
        last ? kNumbers
             : i + 1 + static_cast<uint32_t>(std::nearbyint(std::min(running, 1.0) * free));
    words[i] = start | (end - start) << 16;
    start = end;
  }
}

}  // namespace

void write_guide_table(std::span<const double, kGuideBins> weights,
                       std::span<uint32_t, kGuideWords> table) {
  std::array<double, kGuideSide> rows;
  for (uint32_t r = 0; r < kGuideSide; ++r) {
    const auto row = weights.subspan(size_t{r} * kGuideSide).first<kGuideSide>();
    rows[r] = std::accumulate(row.begin(), row.end(), 0.0);
    write_row(row, table.subspan(kGuideSide + size_t{r} * kGuideSide).first<kGuideSide>());
  }
  write_row(rows, table.first<kGuideSide>());
}

}  // namespace wavecomb
