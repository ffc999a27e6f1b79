// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/guiding/sampling_table.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

namespace wavecomb {
namespace {

/// Assigns 65536 sample values to kGuidingSide bins by weight. Each bin first gets one sample
/// value. The remaining values are distributed by the rounded cumulative sum of the weights, so
/// that the total is exact.
void write_row(std::span<const double, kGuidingSide> weights,
               std::span<uint32_t, kGuidingSide> words) {
  constexpr uint32_t kNumbers = 1u << 16;
  const double all = std::accumulate(weights.begin(), weights.end(), 0.0);
  const double free = kNumbers - kGuidingSide;
  double running = 0;
  uint32_t start = 0;
  for (uint32_t i = 0; i < kGuidingSide; ++i) {
    running += all > 0 ? weights[i] / all : 1.0 / kGuidingSide;
    const bool last = i + 1 == kGuidingSide;
    const uint32_t end =
        last ? kNumbers
             : i + 1 + static_cast<uint32_t>(std::nearbyint(std::min(running, 1.0) * free));
    words[i] = start | (end - start) << 16;
    start = end;
  }
}

}  // namespace

void write_guiding_table(std::span<const double, kGuidingBins> weights,
                         std::span<uint32_t, kGuidingWords> table) {
  std::array<double, kGuidingSide> rows;
  for (uint32_t r = 0; r < kGuidingSide; ++r) {
    const auto row = weights.subspan(size_t{r} * kGuidingSide).first<kGuidingSide>();
    rows[r] = std::accumulate(row.begin(), row.end(), 0.0);
    write_row(row, table.subspan(kGuidingSide + size_t{r} * kGuidingSide).first<kGuidingSide>());
  }
  write_row(rows, table.first<kGuidingSide>());
}

}  // namespace wavecomb
