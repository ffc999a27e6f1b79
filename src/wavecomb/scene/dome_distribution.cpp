// SPDX-License-Identifier: Apache-2.0
/// The density that dome lights are sampled by.
#include <algorithm>
#include <cmath>

#include "wavecomb/scene/light_builder.h"
#include "wavecomb/scene/parallel.h"

namespace wavecomb {

namespace {

constexpr double kPiD = 3.14159265358979323846;
constexpr uint32_t kMaxWidth = 1024, kMaxHeight = 512;
/// Rows of texels that are read at once.
constexpr uint32_t kRows = 256;
/// Least share of a lit cell in its row, and of a lit row, relative to the mean: so that float
/// cumulative values can tell it apart and no lit cell is missed.
constexpr double kFloor = 1e-3;

/// Calls `add(cell, part)` for each of `cells` cells that texel i of n overlaps; parts of one cell
/// sum to 1.
template <typename Add>
void for_each_overlap(uint64_t i, uint64_t n, uint64_t cells, const Add& add) {
  const uint64_t begin = i * cells, end = begin + cells;  // in units of 1 / (n cells)
  for (uint64_t c = begin / n; c * n < end; ++c) {
    const uint64_t covered = std::min(end, (c + 1) * n) - std::max(begin, c * n);
    add(static_cast<size_t>(c), static_cast<double>(covered) / static_cast<double>(n));
  }
}

/// The neighbour of texel i that a bilinear tap reads, -1 or +1 away; size where it is black.
uint32_t neighbour(Wrap wrap, uint32_t i, int step, uint32_t size) {
  const bool off = step < 0 ? i == 0 : i + 1 == size;
  if (!off) return step < 0 ? i - 1 : i + 1;
  if (wrap == Wrap::kRepeat) return step < 0 ? size - 1 : 0;
  return wrap == Wrap::kBlack ? size : i;
}

/// Luminance of rows of an image, each averaged over columns of cells. A function that is linear
/// between texel centres has the mean (a + 6 b + c) / 8 over the texel b between a and c.
class RowMeans {
 public:
  RowMeans(const TextureView& texture, const Vec3<float>& color, uint32_t cells)
      : texture_(texture), color_(color), cells_(cells) {}

  std::vector<double> operator()(uint32_t y) const {
    const uint32_t n = texture_.levels[0].width;
    std::vector<double> line(n);
    for (uint32_t x = 0; x < n; ++x) {
      const auto t = texel_at(texture_, 0, x, y);
      const auto lit = [](float texel, float scale) {
        return std::max(0.0, double{texel}) * double{scale};
      };
      line[x] = 0.212656 * lit(t[0], color_.x) + 0.715158 * lit(t[1], color_.y) +
                0.072186 * lit(t[2], color_.z);
    }
    const auto at = [&](uint32_t i) { return i == n ? 0.0 : line[i]; };
    std::vector<double> smooth(n), cells(cells_, 0.0);
    for (uint32_t x = 0; x < n; ++x) {
      smooth[x] = (at(neighbour(texture_.wrap_s, x, -1, n)) + 6 * line[x] +
                   at(neighbour(texture_.wrap_s, x, 1, n))) /
                  8;
    }
    for (uint32_t x = 0; x < n; ++x) {
      for_each_overlap(x, n, cells_, [&](size_t c, double part) { cells[c] += part * smooth[x]; });
    }
    return cells;
  }

 private:
  const TextureView& texture_;
  Vec3<float> color_;
  uint32_t cells_;
};

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
    for (size_t i = 0; i <= n; ++i)
      cdf[i] = static_cast<float>(static_cast<double>(i) / static_cast<double>(n));
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

/// Guide entries of the cumulative values cdf[0 .. n].
void add_guide(const float* cdf, uint32_t n, std::vector<uint32_t>& guide) {
  constexpr uint32_t kEntries = Distribution2D::kGuide;
  uint32_t first = 0, last = 0;
  for (uint32_t k = 0; k < kEntries; ++k) {
    const float from = static_cast<float>(k) / kEntries, to = static_cast<float>(k + 1) / kEntries;
    while (first + 1 < n && cdf[first + 1] <= from) ++first;
    last = std::max(last, first);
    while (last + 1 < n && cdf[last + 1] < to) ++last;
    guide.push_back(first | (last << 16));
  }
}

}  // namespace

Distribution2D build_dome_distribution(const TextureView& texture, const Vec3<float>& color,
                                       double* mean_luminance) {
  const uint32_t width = texture.levels[0].width, height = texture.levels[0].height;
  Distribution2D d;
  d.width = std::min(width, kMaxWidth);
  d.height = std::min(height, kMaxHeight);

  // Means over cells; the rows above and below bleed in as in RowMeans (the poles are clamped).
  std::vector<double> cells(size_t{d.width} * d.height, 0.0);
  const RowMeans means(texture, color, d.width);
  std::vector<std::vector<double>> some(std::min(height, kRows));  // means of the next rows
  const auto mean_of = [&](uint32_t y) {
    if (y % kRows == 0)
      parallel_for(std::min(kRows, height - y),
                   [&](size_t i) { some[i] = means(y + static_cast<uint32_t>(i)); });
    return std::move(some[y % kRows]);
  };
  std::vector<double> row = mean_of(0), above = row, below;
  for (uint32_t y = 0; y < height; ++y) {
    below = y + 1 < height ? mean_of(y + 1) : row;
    for_each_overlap(y, height, d.height, [&](size_t c, double part) {
      double* to = cells.data() + c * d.width;
      for (uint32_t x = 0; x < d.width; ++x) to[x] += part * (above[x] + 6 * row[x] + below[x]) / 8;
    });
    above = std::move(row);
    row = std::move(below);
  }

  d.conditional.resize(size_t{d.height} * (d.width + 1));
  d.marginal.resize(d.height + 1);
  d.density.resize(size_t{d.width} * d.height);
  std::vector<double> rows(d.height), line(d.width);
  double mean = 0;
  for (uint32_t y = 0; y < d.height; ++y) {
    const auto from = cells.begin() + static_cast<std::ptrdiff_t>(size_t{y} * d.width);
    std::copy(from, from + d.width, line.begin());
    // The mean of the sine over the row, times its height: cos(top) - cos(bottom).
    const double ring = std::cos(kPiD * y / d.height) - std::cos(kPiD * (y + 1) / d.height);
    rows[y] = ring * accumulate(line, d.conditional.data() + size_t{y} * (d.width + 1)) / d.width;
    mean += rows[y] / 2;
  }
  if (mean_luminance) *mean_luminance = mean;
  if (!(accumulate(rows, d.marginal.data()) > 0)) return {};

  static_assert(kMaxWidth < 1u << 16 && kMaxHeight < 1u << 16);
  for (uint32_t y = 0; y < d.height; ++y)
    add_guide(d.conditional.data() + size_t{y} * (d.width + 1), d.width, d.guide);
  add_guide(d.marginal.data(), d.height, d.guide);

  // The density that the float tables really have.
  for (uint32_t y = 0; y < d.height; ++y) {
    const double row_part = (double{d.marginal[y + 1]} - double{d.marginal[y]}) * d.height;
    const float* cdf = d.conditional.data() + size_t{y} * (d.width + 1);
    for (uint32_t x = 0; x < d.width; ++x) {
      d.density[size_t{y} * d.width + x] =
          static_cast<float>(row_part * (double{cdf[x + 1]} - double{cdf[x]}) * d.width);
    }
  }
  return d;
}

}  // namespace wavecomb
