// SPDX-License-Identifier: Apache-2.0
/// Sampling densities of lights with textures.
#include <algorithm>
#include <cmath>
#include <numbers>
#include <span>

#include "wavecomb/light/description/light_builder.h"
#include "wavecomb/scene/parallel.h"

namespace wavecomb {

namespace {

constexpr uint32_t kMaxWidth = 1024, kMaxDomeHeight = 512, kMaxRectHeight = 1024;
/// Number of texel rows that are read in parallel.
constexpr uint32_t kRows = 256;
/// Calls `add(cell, part)` for each of `cells` cells that texel i of n overlaps; `part` is the
/// fraction of the cell that the texel covers.
template <typename Add>
void for_each_overlap(uint64_t i, uint64_t n, uint64_t cells, const Add& add) {
  // Bounds of the texel in units of 1 / (n * cells)
  const uint64_t begin = i * cells, end = begin + cells;
  for (uint64_t c = begin / n; c * n < end; ++c) {
    const uint64_t covered = std::min(end, (c + 1) * n) - std::max(begin, c * n);
    add(static_cast<size_t>(c), static_cast<double>(covered) / static_cast<double>(n));
  }
}

/// Returns the index of the texel before (`step` -1) or after (`step` +1) texel i in a bilinear
/// lookup, or `size` if the lookup uses black instead of a texel.
uint32_t neighbour(Wrap wrap, uint32_t i, int step, uint32_t size) {
  const bool off = step < 0 ? i == 0 : i + 1 == size;
  if (!off) return step < 0 ? i - 1 : i + 1;
  if (wrap == Wrap::kRepeat) return step < 0 ? size - 1 : 0;
  return wrap == Wrap::kBlack ? size : i;
}

/// Luminance of rows of an image, averaged over columns of cells. A function that is linear between
/// texel centres has the mean (a + 6 b + c) / 8 over a texel of value b between texels of values a
/// and c.
class RowMeans {
 public:
  RowMeans(const TextureView& texture, const Vec3<float>& color, uint32_t cells)
      : texture_(texture), color_(color), cells_(cells) {}

  std::vector<double> operator()(uint32_t y) const {
    const uint32_t n = texture_.levels[0].width;
    std::vector<double> line(n);
    for (uint32_t x = 0; x < n; ++x) {
      const auto t = texel_at(texture_, 0, x, y);
      const auto emitted = [](float texel, float scale) {
        return std::max(0.0, double{texel}) * double{scale};
      };
      line[x] = 0.212656 * emitted(t[0], color_.x) + 0.715158 * emitted(t[1], color_.y) +
                0.072186 * emitted(t[2], color_.z);
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

/// Writes cumulative counts of the given weights. Each entry of positive weight, and the last
/// entry, gets one count; the remaining counts are distributed by weight. Therefore, every entry of
/// positive weight can be selected, entries of weight 0 cannot be selected except for the last
/// entry, and no cumulative count reaches 65536. Returns the sum of the weights.
double accumulate(std::span<const double> weights, uint16_t* cumulative) {
  const size_t n = weights.size();
  double sum = 0;
  for (const double w : weights) sum += w;
  const auto counts = [&](size_t i) { return !(sum > 0) || weights[i] > 0 || i + 1 == n; };
  uint32_t emitted = 0;
  for (size_t i = 0; i < n; ++i) emitted += counts(i);
  const uint32_t free = Distribution2D::kCounts - emitted;
  double running = 0;
  uint32_t before = 0;
  for (size_t i = 0; i < n; ++i) {
    const double part = sum > 0 ? std::min(1.0, running / sum) : 0;
    cumulative[i] =
        static_cast<uint16_t>(before + static_cast<uint32_t>(std::nearbyint(part * free)));
    before += counts(i);
    running += weights[i];
  }
  return sum;
}

/// Mean of the bilinearly interpolated luminance over each cell of a grid; row 0 is at the top.
struct Cells {
  uint32_t width, height;
  std::vector<double> mean;

  std::span<const double> row(uint32_t y) const {
    return std::span(mean).subspan(size_t{y} * width, width);
  }
};

/// Computes the mean luminance of each cell; `wrap` determines the rows above the top and below the
/// bottom of the image.
Cells cell_means(const TextureView& texture, const Vec3<float>& color, uint32_t max_height,
                 Wrap wrap) {
  const uint32_t width = texture.levels[0].width, height = texture.levels[0].height;
  Cells cells{std::min(width, kMaxWidth), std::min(height, max_height), {}};
  cells.mean.assign(size_t{cells.width} * cells.height, 0.0);
  const RowMeans means(texture, color, cells.width);
  // Means over columns of cells for each texel row that has been read but not yet added to `cells`.
  std::vector<std::vector<double>> some(std::min(height, kRows));
  const auto mean_of = [&](uint32_t y) {
    if (y % kRows == 0)
      parallel_for(std::min(kRows, height - y),
                   [&](size_t i) { some[i] = means(y + static_cast<uint32_t>(i)); });
    return std::move(some[y % kRows]);
  };
  const auto neighbour_row = [&](int step, const std::vector<double>& edge) {
    const uint32_t y = neighbour(wrap, step < 0 ? 0 : height - 1, step, height);
    if (y == height) return std::vector<double>(cells.width, 0.0);
    return wrap == Wrap::kRepeat ? means(y) : edge;
  };
  // Bilinear lookups blend adjacent rows, so the mean over a row has the weights 1/8, 6/8, 1/8 of
  // RowMeans.
  std::vector<double> row = mean_of(0), above = neighbour_row(-1, row), below;
  for (uint32_t y = 0; y < height; ++y) {
    below = y + 1 < height ? mean_of(y + 1) : neighbour_row(1, row);
    for_each_overlap(y, height, cells.height, [&](size_t c, double part) {
      double* to = cells.mean.data() + c * cells.width;
      for (uint32_t x = 0; x < cells.width; ++x)
        to[x] += part * (above[x] + 6 * row[x] + below[x]) / 8;
    });
    above = std::move(row);
    row = std::move(below);
  }
  return cells;
}

/// Makes a density proportional to the cell means times part(y), the measure of row y. The width of
/// the density is 0 if all cells are black.
template <typename Part>
Distribution2D make_distribution(const Cells& cells, const Part& part) {
  using Line = Distribution2D::Line;
  static_assert(kMaxWidth <= Distribution2D::kMax && kMaxDomeHeight <= Distribution2D::kMax &&
                kMaxRectHeight <= Distribution2D::kMax);
  const auto lines_of = [](uint32_t n) {
    return (n + Distribution2D::kLine - 1) / Distribution2D::kLine;
  };
  Distribution2D d;
  d.width = cells.width;
  d.height = cells.height;
  Line pad;
  std::fill(std::begin(pad.value), std::end(pad.value), Distribution2D::kPad);
  d.row_lines = lines_of(d.width);
  d.cumulative.assign(size_t{d.row_lines} * d.height + lines_of(d.height), pad);
  d.coarse.assign(d.height + 1, pad);
  std::vector<uint16_t> line(std::max(d.width, d.height));
  const auto put = [&](uint32_t y, uint32_t n) {
    for (uint32_t i = 0; i < n; ++i) {
      const uint32_t at = i / Distribution2D::kLine, within = i % Distribution2D::kLine;
      d.cumulative[size_t{y} * d.row_lines + at].value[within] = line[i];
      if (within == 0) d.coarse[y].value[at] = line[i];
    }
  };
  std::vector<double> rows(d.height);
  for (uint32_t y = 0; y < d.height; ++y) {
    const double measure = part(y);
    rows[y] = measure * accumulate(cells.row(y), line.data()) / d.width;
    put(y, d.width);
    d.mean_luminance += rows[y] / 2;
  }
  if (!(accumulate(rows, line.data()) > 0)) return {};
  put(d.height, d.height);
  return d;
}

/// Returns the sum over cells of probability^2 / size(y), where size(y) is the measure of a cell in
/// row y.
template <typename Size>
double squares(const Distribution2D& d, const Size& size) {
  const auto value = [&](size_t row, uint32_t i) {
    const size_t line = row * d.row_lines + i / Distribution2D::kLine;
    return static_cast<double>(d.cumulative[line].value[i % Distribution2D::kLine]);
  };
  const auto count = [&](size_t row, uint32_t n, uint32_t i) {
    return (i + 1 == n ? static_cast<double>(Distribution2D::kCounts) : value(row, i + 1)) -
           value(row, i);
  };
  double sum = 0;
  for (uint32_t y = 0; y < d.height; ++y) {
    const double row = count(d.height, d.height, y) / Distribution2D::kCounts, one = size(y);
    for (uint32_t x = 0; x < d.width; ++x) {
      const double share = row * count(y, d.width, x) / Distribution2D::kCounts;
      sum += share * share / one;
    }
  }
  return sum;
}

}  // namespace

Distribution2D build_dome_distribution(const TextureView& texture, const Vec3<float>& color) {
  // Bilinear lookups of a dome image clamp the row at the poles.
  const Cells cells = cell_means(texture, color, kMaxDomeHeight, Wrap::kClamp);
  // The measure of a row is the integral of the sine of the polar angle over the row, cos(top) -
  // cos(bottom).
  return make_distribution(cells, [&](uint32_t y) {
    return std::cos(std::numbers::pi * y / cells.height) -
           std::cos(std::numbers::pi * (y + 1) / cells.height);
  });
}

Distribution2D build_rect_distribution(const TextureView& texture, const Vec3<float>& color) {
  const Cells cells = cell_means(texture, color, kMaxRectHeight, texture.wrap_t);
  Distribution2D d = make_distribution(cells, [&](uint32_t) { return 2.0 / cells.height; });
  const double cell = 1.0 / static_cast<double>(cells.mean.size());
  if (d.width > 0) d.spread = static_cast<float>(1 / squares(d, [&](uint32_t) { return cell; }));
  return d;
}

double image_solid_angle(const Distribution2D& d) {
  const double sum = squares(d, [&](uint32_t y) {
    return 2 * std::numbers::pi / d.width *
           (std::cos(std::numbers::pi * y / d.height) -
            std::cos(std::numbers::pi * (y + 1) / d.height));
  });
  return sum > 0 ? 1 / sum : 4 * std::numbers::pi;
}

}  // namespace wavecomb
