// SPDX-License-Identifier: Apache-2.0
/// The density that dome lights are sampled by.
#include <algorithm>
#include <cmath>

#include "wavecomb/scene/light_builder.h"

namespace wavecomb {

namespace {

constexpr double kPiD = 3.14159265358979323846;
constexpr uint32_t kMaxWidth = 1024, kMaxHeight = 512;
/// Least share of a lit cell in its row, and of a lit row, relative to the mean: so that float
/// cumulative values can tell it apart and no lit cell is missed.
constexpr double kFloor = 1e-3;

/// The neighbour of texel i that a bilinear tap reads, -1 or +1 away; size where it is black.
uint32_t neighbour(Wrap wrap, uint32_t i, int step, uint32_t size) {
  const bool off = step < 0 ? i == 0 : i + 1 == size;
  if (!off) return i + static_cast<uint32_t>(step);
  if (wrap == Wrap::kRepeat) return step < 0 ? size - 1 : 0;
  return wrap == Wrap::kBlack ? size : i;
}

/// Means over each texel of the function that is linear between texel centres: weights 1, 6, 1 of 8.
void smooth(Wrap wrap, std::vector<double>& line, std::vector<double>& scratch) {
  const auto n = static_cast<uint32_t>(line.size());
  scratch = line;
  const auto at = [&](uint32_t i) { return i == n ? 0.0 : scratch[i]; };
  for (uint32_t i = 0; i < n; ++i) {
    line[i] = (at(neighbour(wrap, i, -1, n)) + 6 * scratch[i] + at(neighbour(wrap, i, 1, n))) / 8;
  }
}

/// Adds `line` to `cells` cells: each gets what it overlaps, in units of texels.
void spread(const std::vector<double>& line, uint32_t cells, double weight, double* to) {
  const auto n = static_cast<uint64_t>(line.size());
  for (uint64_t i = 0; i < n; ++i) {
    // Texel i covers [i cells, (i + 1) cells) in units of 1 / (n cells).
    const uint64_t begin = i * cells, end = begin + cells;
    for (uint64_t c = begin / n; c * n < end; ++c) {
      const uint64_t covered = std::min(end, (c + 1) * n) - std::max(begin, c * n);
      to[c] += weight * line[i] * static_cast<double>(covered);
    }
  }
}

/// Cumulative floats of the given weights, 0 first and 1 last; lit entries have some floor.
/// Returns the sum of the weights.
double accumulate(std::vector<double>& weights, float* cdf) {
  double sum = 0;
  size_t lit = 0;
  for (const double w : weights) {
    sum += w;
    lit += w > 0;
  }
  const size_t n = weights.size();
  if (!(sum > 0)) {  // never chosen; some valid table
    for (size_t i = 0; i <= n; ++i) cdf[i] = static_cast<float>(static_cast<double>(i) / static_cast<double>(n));
    return 0;
  }
  const double least = kFloor * sum / static_cast<double>(n);
  double total = 0;
  for (double& w : weights) {
    if (w > 0) w = std::max(w, least);
    total += w;
  }
  double running = 0;
  size_t last = 0;
  cdf[0] = 0;
  for (size_t i = 0; i < n; ++i) {
    running += weights[i];
    cdf[i + 1] = static_cast<float>(running / total);
    if (weights[i] > 0) last = i;
  }
  for (size_t i = last + 1; i <= n; ++i) cdf[i] = 1;
  return sum;
}

}  // namespace

Distribution2D build_dome_distribution(const TextureView& texture, const Vec3<float>& color,
                                       double* mean_luminance) {
  const uint32_t width = texture.levels[0].width, height = texture.levels[0].height;
  Distribution2D d;
  d.width = std::min(width, kMaxWidth);
  d.height = std::min(height, kMaxHeight);

  // Smoothed luminance of each row of texels, spread over the cells of the rows that it and its two
  // neighbours touch.
  std::vector<double> cells(size_t{d.width} * d.height, 0.0);
  std::vector<double> line(width), scratch, row_cells(d.width), one(1);
  for (uint32_t y = 0; y < height; ++y) {
    for (uint32_t x = 0; x < width; ++x) {
      const auto t = texel_at(texture, 0, x, y);
      const auto lit = [](float texel, float scale) { return std::max(0.0, double{texel}) * double{scale}; };
      line[x] = 0.212656 * lit(t[0], color.x) + 0.715158 * lit(t[1], color.y) + 0.072186 * lit(t[2], color.z);
    }
    smooth(texture.wrap_s, line, scratch);
    std::fill(row_cells.begin(), row_cells.end(), 0.0);
    spread(line, d.width, 1, row_cells.data());
    // Row y counts in its own mean with 6/8, and in a neighbour's with 1/8 for each tap that reads it.
    const auto add = [&](uint32_t row, double weight) {
      const uint64_t begin = uint64_t{row} * d.height, end = begin + d.height;
      for (uint64_t c = begin / height; c * height < end; ++c) {
        const uint64_t covered = std::min(end, (c + 1) * height) - std::max(begin, c * height);
        for (uint32_t x = 0; x < d.width; ++x) {
          cells[size_t(c) * d.width + x] += weight * static_cast<double>(covered) * row_cells[x];
        }
      }
    };
    add(y, 6.0 / 8);
    for (const uint32_t other : {y == 0 ? height - 1 : y - 1, y + 1 == height ? 0 : y + 1, y}) {
      for (const int step : {-1, 1}) {
        if (neighbour(texture.wrap_t, other, step, height) == y && !(other == y && false)) add(other, 1.0 / 8);
      }
    }
  }
  return d;
}

}  // namespace wavecomb
