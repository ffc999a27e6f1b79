// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/guiding/field/field_builder.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <numeric>
#include <utility>

#include "wavecomb/guiding/sampling_table.h"
#include "wavecomb/scene/parallel.h"

namespace wavecomb {
namespace {

/// Maximum number of training records that contribute to the direction distribution of a node.
constexpr size_t kDirections = 8192;
/// Weight of the parent node's distribution and moments, as an equivalent number of training
/// records.
constexpr double kPrior = 64;
/// Minimum number of a material's training records from which the minimum of `bsdf_share` for this
/// material is computed.
constexpr double kMaterialRecords = 512;
/// Fraction of bounces that the BSDF samples in the first round, before moments are known.
constexpr float kFirstShare = 0.5f;
/// Minimum number of training records of a node whose children are computed in parallel, and number
/// of records that one task converts.
constexpr size_t kParallelRecords = 4096, kBand = 8192;

/// Returns the limit to which values are clamped, so that no single value dominates: sqrt(n) times
/// the mean of n values.
double largest(std::span<const TrainingRecord> records) {
  double sum = 0;
  for (const TrainingRecord& r : records) sum += double{r.value};
  return records.empty() ? 0 : sum / std::sqrt(static_cast<double>(records.size()));
}

}  // namespace

GuidingFieldBuilder::GuidingFieldBuilder(const GuidingGrid& grid,
                                         std::span<const TrainingRecord> records, size_t materials,
                                         bool first, bool guides)
    : grid_(grid),
      first_(first),
      guides_(guides),
      records_(records.size()),
      ratios_(first ? 0 : records.size()),
      codes_(records.size()) {
  std::vector<std::pair<uint32_t, uint32_t>> order(records.size());
  parallel_bands(records.size(), kBand, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i)
      order[i] = {grid_code(grid, records[i].p), static_cast<uint32_t>(i)};
  });
  std::sort(order.begin(), order.end());
  parallel_bands(records.size(), kBand, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      codes_[i] = order[i].first;
      records_[i] = records[order[i].second];
      if (!first_) ratios_[i] = share_ratios(records_[i]);
    }
  });
  compute_material_fractions(materials);
}

void GuidingFieldBuilder::compute_material_fractions(size_t materials) {
  material_share_.assign(std::max<size_t>(materials, 1), 0.f);
  if (first_) return;
  std::vector<ShareMoments> moments(material_share_.size());
  const double cut = largest(records_);
  for (size_t i = 0; i < records_.size(); ++i)
    if (const TrainingRecord& r = records_[i]; r.material < moments.size())
      moments[r.material].add(ratios_[i], std::min(double{r.value}, cut));
  for (size_t m = 0; m < moments.size(); ++m)
    if (moments[m].count >= kMaterialRecords) material_share_[m] = kBsdfShares[moments[m].best()];
}

GuidingFieldBuilder::Field GuidingFieldBuilder::build(size_t cell_records) {
  cell_records_ = cell_records;
  nodes_.clear();
  region_count_ = 0;
  built_ = {};
  GuidingFieldArrays& parts = built_.parts;
  parts.entries.assign(kGuidingTopCells, kGuidingCell);
  parts.material_share = material_share_;
  divide(0, 0, 0, records_.size(), kNoNode);
  for (uint32_t i = 0; i < nodes_.size(); ++i)
    if (nodes_[i].is_cell) add_cell(nodes_[i], i);

  parts.tables.resize(size_t{region_count_} * kGuidingWords);
  parts.spheres.resize(region_count_);
  parts.bsdf_share.resize(region_count_);
  compute_regions(0, nullptr);

  contributing_ = guided_ = off_ = on_ = 0;
  uint32_t cell = 0;
  for (const Node& node : nodes_)
    if (node.is_cell) count_cell(node, cell++);
  GuidingFieldStatistics& facts = built_.facts;
  facts.records = records_.size();
  facts.cells = cell;
  facts.regions = region_count_;
  for (const float a : parts.bsdf_share) facts.guided_regions += a < 1 ? 1 : 0;
  if (contributing_ > 0) facts.guided_share = guided_ / contributing_;
  if (off_ > 0) facts.moment_ratio = on_ / off_;
  return std::move(built_);
}

void GuidingFieldBuilder::divide(uint32_t depth, uint32_t code, size_t begin, size_t end,
                                 uint32_t parent) {
  const auto index = static_cast<uint32_t>(nodes_.size());
  Node& added = nodes_.emplace_back(
      Node{.depth = depth, .code = code, .parent = parent, .begin = begin, .end = end});
  added.regions.fill(kNoGuidingRegion);
  for (size_t i = begin; i < end; ++i) ++added.counts[records_[i].axis];
  added.is_cell = end - begin <= cell_records_ || depth == kGuidingBits;
  if (!added.is_cell) {
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
      divide(depth + 1, first, from, to, index);
      from = to;
    }
  }
  nodes_[index].after = static_cast<uint32_t>(nodes_.size());
}

uint32_t GuidingFieldBuilder::region_of(uint32_t node, uint32_t axis) {
  while (static_cast<double>(nodes_[node].counts[axis]) < kMinRegionRecords) {
    node = nodes_[node].parent;
    if (node == kNoNode) return kNoGuidingRegion;
  }
  uint32_t& region = nodes_[node].regions[axis];
  if (region != kNoGuidingRegion) return region;
  region = region_count_++;
  for (uint32_t i = node; i != kNoNode; i = nodes_[i].parent) nodes_[i].is_used[axis] = true;
  return region;
}

void GuidingFieldBuilder::add_cell(const Node& node, uint32_t index) {
  std::vector<uint32_t>& cells = built_.parts.cells;
  const auto cell = static_cast<uint32_t>(cells.size() / kGuidingAxes);
  for (uint32_t axis = 0; axis < kGuidingAxes; ++axis) cells.push_back(region_of(index, axis));
  fill(node, kGuidingCell | cell);
}

void GuidingFieldBuilder::fill(const Node& node, uint32_t entry) {
  const auto [x, y, z] = grid_position(node.code);
  std::vector<uint32_t>& entries = built_.parts.entries;
  uint32_t bits = kGuidingTopBits, first = 0, width = kGuidingTopBits;
  for (;;) {
    const uint32_t shift = kGuidingBits - bits, mask = (1u << width) - 1;
    const uint32_t at[3] = {x >> shift & mask, y >> shift & mask, z >> shift & mask};
    if (node.depth <= bits) {
      const uint32_t size = 1u << (bits - node.depth);
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

void GuidingFieldBuilder::blend(Bounces bounces, double cut, const Distribution* above,
                                Distribution& out) {
  out.count = static_cast<double>(bounces.size());
  out.sphere = fit_sphere(bounces, cut);
  out.density = direction_bins(subset_of_bounces(bounces, kDirections), out.sphere, cut);
  const double sum = std::accumulate(out.density.begin(), out.density.end(), 0.0);
  const double prior = above && above->count > 0 ? kPrior : 0;
  const double n = sum > 0 ? out.count : 0;
  if (n + prior == 0) return;
  for (uint32_t b = 0; b < kGuidingBins; ++b) {
    const double own = n > 0 ? out.density[b] / sum * n : 0;
    out.density[b] = (own + (prior > 0 ? prior * above->density[b] : 0)) / (n + prior);
  }
  if (prior > 0 && above->moments.count > 0)
    out.moments.add(above->moments, kPrior / std::max(above->moments.count, kPrior));
}

void GuidingFieldBuilder::compute_regions(uint32_t index, const Distributions* above) {
  const Node& node = nodes_[index];
  if (std::none_of(node.is_used.begin(), node.is_used.end(), [](bool used) { return used; }))
    return;
  const double cut = largest(std::span(records_).subspan(node.begin, node.end - node.begin));
  // Allocate the distributions on the heap, since they are too large for the stack of a recursion.
  const auto own = std::make_unique<Distributions>();
  std::vector<const TrainingRecord*> bounces;
  for (uint32_t axis = 0; axis < kGuidingAxes; ++axis) {
    if (!node.is_used[axis]) continue;
    Distribution& distribution = (*own)[axis];
    bounces.clear();
    for (size_t i = node.begin; i < node.end; ++i) {
      const TrainingRecord& r = records_[i];
      if (r.axis != axis) continue;
      bounces.push_back(&r);
      if (!first_) distribution.moments.add(ratios_[i], std::min(double{r.value}, cut));
    }
    blend(bounces, cut, above ? &(*above)[axis] : nullptr, distribution);
    if (node.regions[axis] != kNoGuidingRegion) write_region(node.regions[axis], distribution);
  }
  std::vector<uint32_t> children;
  for (uint32_t child = index + 1; child < node.after; child = nodes_[child].after)
    children.push_back(child);
  const auto compute = [&](size_t i) { compute_regions(children[i], own.get()); };
  if (node.end - node.begin >= kParallelRecords)
    parallel_for(children.size(), compute);
  else
    for (size_t i = 0; i < children.size(); ++i) compute(i);
}

void GuidingFieldBuilder::write_region(uint32_t region, const Distribution& distribution) {
  GuidingFieldArrays& parts = built_.parts;
  write_guiding_table(
      smoothed(distribution.density),
      std::span(parts.tables).subspan(size_t{region} * kGuidingWords).first<kGuidingWords>());
  parts.spheres[region] = distribution.sphere;
  parts.bsdf_share[region] = !guides_ ? 1.f
                             : first_ ? kFirstShare
                                      : kBsdfShares[distribution.moments.best()];
}

void GuidingFieldBuilder::count_cell(const Node& node, uint32_t cell) {
  const GuidingFieldArrays& parts = built_.parts;
  const uint32_t* regions = parts.cells.data() + size_t{cell} * kGuidingAxes;
  for (size_t i = node.begin; i < node.end; ++i) {
    const TrainingRecord& r = records_[i];
    const uint32_t region = regions[r.axis];
    float a = 1;
    if (region != kNoGuidingRegion)
      a = std::max(parts.bsdf_share[region], r.material < parts.material_share.size()
                                                 ? parts.material_share[r.material]
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

}  // namespace wavecomb
