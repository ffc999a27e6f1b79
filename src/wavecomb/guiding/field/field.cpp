// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/guiding/field/field.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <numeric>

#include "wavecomb/core/encoding/morton.h"
#include "wavecomb/guiding/lookup.inl"
#include "wavecomb/guiding/mixing_fractions.h"
#include "wavecomb/guiding/region_directions.h"
#include "wavecomb/guiding/sampling_table.h"

namespace wavecomb {
namespace {

/// Maximum number of training records in a cell; cells with more records are divided.
constexpr size_t kCellRecords = 2048;
/// Minimum number of training records for a region to get a separate distribution.
constexpr double kMinRegionRecords = 64;
/// Maximum number of training records from which the direction distribution of a cell is computed.
constexpr size_t kDirections = 8192;
/// Weight of the parent cell's distribution and moments, as an equivalent number of training
/// records.
constexpr double kPrior = 64;
/// Minimum number of training records at a material for computing the minimum of `bsdf_share` for
/// the material.
constexpr double kMaterialRecords = 512;
/// Factor by which the survival probability of roulette is increased. Moments from few training
/// paths miss rare light. Terminating paths too often where rare light arrives causes bright
/// pixels, while continuing paths too often costs only a few rays.
constexpr double kSafety = 1.5;
/// Fraction of bounces that the BSDF samples in the first round, before moments are known.
constexpr float kFirstShare = 0.5f;

uint32_t code_of(const GuidingGrid& grid, const float (&p)[3]) {
  uint32_t step[3];
  for (int i = 0; i < 3; ++i)
    step[i] = detail::guiding_steps<float>(p[i], grid.lo[i], grid.scale[i]);
  return morton_3(step[0], step[1], step[2]);
}

/// Extracts every third bit of a Morton code, starting with the lowest.
uint32_t compact_bits_3(uint32_t x) {
  uint32_t out = 0;
  for (uint32_t i = 0; i < kGuidingBits; ++i) out |= (x >> (3 * i) & 1u) << i;
  return out;
}

}  // namespace

GuidingGrid::GuidingGrid(const float (&low)[3], const float (&high)[3]) {
  for (int i = 0; i < 3; ++i) {
    const double size = double{high[i]} - double{low[i]};
    lo[i] = low[i];
    scale[i] =
        size > 0 && std::isfinite(size) ? static_cast<float>((1u << kGuidingBits) / size) : 0;
  }
}

/// Builds the octree from the root down and creates the regions.
class GuidingFieldBuilder {
 public:
  GuidingFieldBuilder(GuidingField& field, std::span<const TrainingRecord> records,
                      size_t materials, bool first, bool guides)
      : field_(field), parts_(field.parts_), first_(first), guides_(guides) {
    std::vector<std::pair<uint32_t, uint32_t>> order(records.size());
    for (uint32_t i = 0; i < records.size(); ++i)
      order[i] = {code_of(field.grid_, records[i].p), i};
    std::sort(order.begin(), order.end());
    records_.reserve(records.size());
    codes_.reserve(records.size());
    for (const auto& [code, i] : order) {
      records_.push_back(records[i]);
      codes_.push_back(code);
    }
    if (!first) {
      ratios_.reserve(records.size());
      for (const TrainingRecord& r : records_) ratios_.push_back(share_ratios(r));
    }
    compute_material_fractions(materials);
  }

  void build(size_t cell_records) {
    cell_records_ = cell_records;
    parts_.entries.assign(kGuidingTopCells, kGuidingCell);
    parts_.cells.clear();
    parts_.tables.clear();
    parts_.spheres.clear();
    parts_.bsdf_share.clear();
    field_.facts_ = {records_.size(), 0, 0, 0, 0, 1};
    contributing_ = off_ = on_ = 0;
    guided_ = 0;
    for (RegionPart& part : levels_[0]) part = {};
    divide(0, 0, 0, records_.size());
    GuidingFieldStatistics& facts = field_.facts_;
    facts.cells = static_cast<uint32_t>(parts_.cells.size() / kGuidingAxes);
    facts.regions = static_cast<uint32_t>(parts_.bsdf_share.size());
    for (const float a : parts_.bsdf_share) facts.guided_regions += a < 1 ? 1 : 0;
    if (contributing_ > 0) facts.guided_share = guided_ / contributing_;
    if (off_ > 0) facts.moment_ratio = on_ / off_;
  }

 private:
  /// Statistics of the training records of a cell on surfaces that face one axis direction.
  struct RegionPart {
    /// Weights of direction bins. They add up to 1, or are all 0 if there are no training records.
    DirectionBins density{};
    double count = 0;
    ParallaxSphere sphere;  ///< sphere from whose centre the directions of `density` are measured
    ShareMoments moments;
    uint32_t region = kNoGuidingRegion;  ///< index of the region in the guiding field, once created
  };
  using Cell = std::array<RegionPart, kGuidingAxes>;

  void compute_material_fractions(size_t materials) {
    parts_.material_share.assign(std::max<size_t>(materials, 1), 0.f);
    if (first_) return;
    std::vector<ShareMoments> moments(parts_.material_share.size());
    const double cut = largest(records_);
    for (size_t i = 0; i < records_.size(); ++i)
      if (const TrainingRecord& r = records_[i]; r.material < moments.size())
        moments[r.material].add(ratios_[i], std::min(double{r.value}, cut));
    for (size_t m = 0; m < moments.size(); ++m)
      if (moments[m].count >= kMaterialRecords)
        parts_.material_share[m] = kBsdfShares[moments[m].best()];
  }

  /// Returns the limit to which values are clamped, so that no single value dominates: sqrt(n)
  /// times the mean of n values.
  static double largest(std::span<const TrainingRecord> records) {
    double sum = 0;
    for (const TrainingRecord& r : records) sum += double{r.value};
    return records.empty() ? 0 : sum / std::sqrt(static_cast<double>(records.size()));
  }

  /// Computes the statistics of the training records [begin, end), blended with the statistics of
  /// the parent cell.
  void read(uint32_t depth, size_t begin, size_t end) {
    Cell& cell = levels_[depth];
    const std::span here = std::span(records_).subspan(begin, end - begin);
    for (RegionPart& part : cell) part = {};
    const double cut = largest(here);
    for (std::vector<const TrainingRecord*>& bounces : by_axis_) bounces.clear();
    for (size_t i = begin; i < end; ++i) {
      const TrainingRecord& r = records_[i];
      by_axis_[r.axis].push_back(&r);
      if (!first_) cell[r.axis].moments.add(ratios_[i], std::min(double{r.value}, cut));
    }
    for (uint32_t axis = 0; axis < kGuidingAxes; ++axis) {
      RegionPart& part = cell[axis];
      part.count = static_cast<double>(by_axis_[axis].size());
      part.sphere = fit_sphere(by_axis_[axis], cut);
      part.density =
          direction_bins(subset_of_bounces(by_axis_[axis], kDirections), part.sphere, cut);
      const RegionPart* above = depth > 0 ? &levels_[depth - 1][axis] : nullptr;
      const double sum = std::accumulate(part.density.begin(), part.density.end(), 0.0);
      const double prior = above && above->count > 0 ? kPrior : 0;
      const double n = sum > 0 ? part.count : 0;
      if (n + prior == 0) continue;
      for (uint32_t b = 0; b < kGuidingBins; ++b) {
        const double own = n > 0 ? part.density[b] / sum * n : 0;
        part.density[b] = (own + (prior > 0 ? prior * above->density[b] : 0)) / (n + prior);
      }
      if (prior > 0 && above->moments.count > 0)
        part.moments.add(above->moments, kPrior / std::max(above->moments.count, kPrior));
    }
  }

  /// Returns the region of the guiding field for a cell and an axis direction. A cell with too few
  /// records uses the region of the nearest ancestor with enough records, or kNoGuidingRegion if
  /// there is none.
  uint32_t region_of(uint32_t depth, uint32_t axis) {
    RegionPart& part = levels_[depth][axis];
    if (part.count < kMinRegionRecords)
      return depth > 0 ? region_of(depth - 1, axis) : kNoGuidingRegion;
    if (part.region != kNoGuidingRegion) return part.region;
    part.region = static_cast<uint32_t>(parts_.bsdf_share.size());
    const size_t at = parts_.tables.size();
    parts_.tables.resize(at + kGuidingWords);
    write_guiding_table(smoothed(part.density),
                        std::span(parts_.tables).subspan(at).first<kGuidingWords>());
    parts_.spheres.push_back(part.sphere);
    parts_.bsdf_share.push_back(!guides_ ? 1.f
                                : first_ ? kFirstShare
                                         : kBsdfShares[part.moments.best()]);
    return part.region;
  }

  /// Processes the octree node of `depth` whose Morton codes share the prefix of `code`. The
  /// records of the node are [begin, end).
  void divide(uint32_t depth, uint32_t code, size_t begin, size_t end) {
    read(depth, begin, end);
    if (end - begin <= cell_records_ || depth == kGuidingBits) {
      add_cell(depth, code, begin, end);
      return;
    }
    const uint32_t shift = 3 * (kGuidingBits - depth - 1);
    size_t from = begin;
    for (uint32_t child = 0; child < 8; ++child) {
      const uint32_t first = code | child << shift;
      const uint64_t limit = uint64_t{first} + (uint64_t{1} << shift);
      const auto to = static_cast<size_t>(
          std::lower_bound(codes_.begin() + static_cast<std::ptrdiff_t>(from),
                           codes_.begin() + static_cast<std::ptrdiff_t>(end), limit,
                           [](uint32_t a, uint64_t b) { return a < b; }) -
          codes_.begin());
      divide(depth + 1, first, from, to);
      from = to;
    }
  }

  void add_cell(uint32_t depth, uint32_t code, size_t begin, size_t end) {
    const auto cell = static_cast<uint32_t>(parts_.cells.size() / kGuidingAxes);
    for (uint32_t axis = 0; axis < kGuidingAxes; ++axis)
      parts_.cells.push_back(region_of(depth, axis));
    fill(depth, code, kGuidingCell | cell);
    const uint32_t* regions = parts_.cells.data() + size_t{cell} * kGuidingAxes;
    for (size_t i = begin; i < end; ++i) {
      const TrainingRecord& r = records_[i];
      const uint32_t region = regions[r.axis];
      float a = 1;
      if (region != kNoGuidingRegion)
        a = std::max(parts_.bsdf_share[region], r.material < parts_.material_share.size()
                                                    ? parts_.material_share[r.material]
                                                    : 0.f);
      const double contribution = double{r.weight} * double{r.value};
      contributing_ += contribution;
      guided_ += a < 1 ? contribution * (1 - double{a}) : 0;
      if (!(r.guiding_pdf > 0)) continue;
      const double moment = contribution * contribution * double{r.pdf};
      off_ += moment / double{r.bsdf_pdf};
      on_ += moment / (double{a} * double{r.bsdf_pdf} + (1 - double{a}) * double{r.guiding_pdf});
    }
  }

  /// Writes `entry` to all grid entries that the octree node covers.
  void fill(uint32_t depth, uint32_t code, uint32_t entry) {
    const uint32_t x = compact_bits_3(code), y = compact_bits_3(code >> 1),
                   z = compact_bits_3(code >> 2);
    std::vector<uint32_t>& entries = parts_.entries;
    uint32_t bits = kGuidingTopBits, first = 0, width = kGuidingTopBits;
    for (;;) {
      const uint32_t shift = kGuidingBits - bits, mask = (1u << width) - 1;
      const uint32_t at[3] = {x >> shift & mask, y >> shift & mask, z >> shift & mask};
      if (depth <= bits) {
        const uint32_t size = 1u << (bits - depth);
        for (uint32_t k = 0; k < size; ++k)
          for (uint32_t j = 0; j < size; ++j)
            for (uint32_t i = 0; i < size; ++i)
              entries[first + (at[0] + i) + ((at[1] + j) << width) + ((at[2] + k) << (2 * width))] =
                  entry;
        return;
      }
      uint32_t& here = entries[first + at[0] + (at[1] << width) + (at[2] << (2 * width))];
      if (here >= kGuidingCell) {
        here = static_cast<uint32_t>(entries.size());
        first = here;
        entries.resize(entries.size() + kGuidingBrickCells, kGuidingCell);
      } else {
        first = here;
      }
      bits += kGuidingBrickBits;
      width = kGuidingBrickBits;
    }
  }

  GuidingField& field_;
  GuidingFieldArrays& parts_;  ///< parts of field_
  bool first_, guides_;
  std::vector<TrainingRecord> records_;  ///< training records, sorted by Morton code
  std::vector<ShareRatios> ratios_;      ///< `share_ratios()` of each record; empty in round 1
  std::vector<uint32_t> codes_;
  size_t cell_records_ = kCellRecords;
  std::array<std::vector<const TrainingRecord*>, kGuidingAxes> by_axis_;  ///< scratch of read()
  /// Cells on the path from the root to the node that divide() processes.
  std::array<Cell, kGuidingBits + 1> levels_;
  double contributing_ = 0, guided_ = 0, off_ = 0, on_ = 0;
};

GuidingField::GuidingField(const GuidingGrid& grid, std::span<const TrainingRecord> records,
                           size_t materials, bool first, bool guides, size_t max_bytes)
    : grid_(grid) {
  const auto builder =
      std::make_unique<GuidingFieldBuilder>(*this, records, materials, first, guides);
  for (size_t cell_records = kCellRecords;; cell_records *= 2) {
    builder->build(cell_records);
    if (bytes() <= max_bytes || cell_records >= records.size()) break;
  }
  compute_survival({}, {});
}

GuidingField::GuidingField(const GuidingGrid& grid, GuidingFieldArrays parts,
                           const GuidingFieldStatistics& facts, size_t materials)
    : grid_(grid), parts_(std::move(parts)), facts_(facts) {
  check_guiding_arrays(parts_, materials);
}

uint64_t bounce_position_key(const GuidingGrid& grid, const Vec3<float>& p, uint32_t axis) {
  return uint64_t{code_of(grid, {p.x, p.y, p.z})} << 3 | axis;
}

void GuidingField::compute_survival(std::span<const BounceSample> training_samples,
                                    const PathStatistics& paths) {
  struct Sums {
    double count = 0, squared = 0, cost = 0;
  };
  const size_t regions = parts_.bsdf_share.size();
  std::vector<Sums> sums(regions + 1);  // the last element is the sum over all regions
  parts_.survival.assign(regions, 0.f);
  const auto add = [](Sums& s, const BounceSample& sample) {
    s.count += 1;
    // Do not clamp second moments, since a region whose light varies strongly should terminate few
    // paths.
    if (std::isfinite(sample.squared)) s.squared += double{sample.squared};
    s.cost += double{sample.cost};
  };
  const GuidingView v = view();
  for (const BounceSample& sample : training_samples) {
    if (!v.grid) break;
    const auto code = static_cast<uint32_t>(sample.position_key >> 3);
    const uint32_t cell = detail::guiding_cell<float>(
        v, compact_bits_3(code), compact_bits_3(code >> 1), compact_bits_3(code >> 2), true);
    const uint32_t region = parts_.cells[size_t{cell} * kGuidingAxes + (sample.position_key & 7u)];
    if (region != kNoGuidingRegion) add(sums[region], sample);
    add(sums[regions], sample);
  }
  for (size_t i = 0; i < regions; ++i) {
    const Sums& s = sums[i].count >= kMinRegionRecords ? sums[i] : sums[regions];
    if (s.cost > 0 && paths.variance > 0)
      parts_.survival[i] = static_cast<float>(
          kSafety * std::sqrt(std::max(s.squared, 0.0) / s.cost * paths.cost / paths.variance));
  }
}

GuidingView GuidingField::view() const {
  GuidingView view;
  for (int i = 0; i < 3; ++i) {
    view.lo[i] = grid_.lo[i];
    view.scale[i] = grid_.scale[i];
  }
  if (parts_.bsdf_share.empty()) return view;
  view.grid = parts_.entries.data();
  view.cells = parts_.cells.data();
  view.tables = parts_.tables.data();
  view.spheres = parts_.spheres.data();
  view.bsdf_share = parts_.bsdf_share.data();
  view.survival = parts_.survival.data();
  view.material_share = parts_.material_share.data();
  return view;
}

size_t GuidingField::bytes() const {
  return parts_.bytes();
}

}  // namespace wavecomb
