// SPDX-License-Identifier: Apache-2.0
/// Construction of the guiding field from training records (field.h).
///
/// 1. The octree is built. Its division depends only on numbers of records.
/// 2. Cells and regions are numbered in the order of the octree, since regions also depend on
///    numbers of records only.
/// 3. The distributions of the regions are computed, in parallel for different subtrees. Each
///    depends only on the records of its node and on the distribution of the parent node.
/// 4. Statistics are summed up in the order of the records.
/// The result is therefore the same bit for bit on any number of threads.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "wavecomb/guiding/field/field_arrays.h"
#include "wavecomb/guiding/field/field_statistics.h"
#include "wavecomb/guiding/field/grid.h"
#include "wavecomb/guiding/mixing_fractions.h"
#include "wavecomb/guiding/region_directions.h"
#include "wavecomb/guiding/training_sample.h"

namespace wavecomb {

/// Minimum number of training records for a region to get a separate distribution.
inline constexpr double kMinRegionRecords = 64;

/// Builder of the arrays of a guiding field. Runs on the threads of the caller's arena.
class GuidingFieldBuilder {
 public:
  /// Arrays and statistics of a field, without `survival`.
  struct Field {
    GuidingFieldArrays parts;
    GuidingFieldStatistics facts;
  };

  /// `materials` is the number of materials. If `first` is true, the records contain no densities
  /// of an earlier field. If `guides` is false, the BSDF samples all bounces.
  GuidingFieldBuilder(const GuidingGrid& grid, std::span<const TrainingRecord> records,
                      size_t materials, bool first, bool guides);

  /// Builds a field in which cells with more than `cell_records` records are divided.
  Field build(size_t cell_records);

 private:
  /// Index of the parent of the root.
  static constexpr uint32_t kNoNode = 0xffffffffu;

  /// Octree node. Nodes are stored in the order of a depth-first traversal.
  struct Node {
    uint32_t depth;
    uint32_t code;  ///< Morton code of the node's first grid position
    uint32_t parent;
    uint32_t after = 0;    ///< index after the last node of the subtree
    size_t begin, end;     ///< training records of the node
    bool is_cell = false;  ///< whether the node is not divided
    /// Number of training records by axis direction of the surface.
    std::array<size_t, kGuidingAxes> counts{};
    /// Region of the records of each axis direction, or kNoGuidingRegion if it was not created.
    std::array<uint32_t, kGuidingAxes> regions{};
    /// Whether this node or a node below it needs the distribution of an axis direction.
    std::array<bool, kGuidingAxes> is_used{};
  };

  /// Distribution of the training records of a node on surfaces that face one axis direction.
  struct Distribution {
    /// Weights of direction bins. They add up to 1, or are all 0 if there are no training records.
    DirectionBins density{};
    double count = 0;
    ParallaxSphere sphere;  ///< sphere from whose centre the directions of `density` are measured
    ShareMoments moments;
  };
  using Distributions = std::array<Distribution, kGuidingAxes>;

  void compute_material_fractions(size_t materials);
  /// Adds a node for the given records, and the nodes of its subtree.
  void divide(uint32_t depth, uint32_t code, size_t begin, size_t end, uint32_t parent);
  /// Returns the region of a node and an axis direction. A node with too few records uses the
  /// region of the nearest ancestor with enough records, or kNoGuidingRegion if there is none.
  uint32_t region_of(uint32_t node, uint32_t axis);
  /// Appends the cell of a node to the arrays.
  void add_cell(const Node& node, uint32_t index);
  /// Writes `entry` to all grid entries that the node covers.
  void fill(const Node& node, uint32_t entry);
  /// Computes the regions of a node and of the nodes below. `above` holds the distributions of the
  /// parent, or is null for the root.
  void compute_regions(uint32_t index, const Distributions* above);
  /// Computes the distribution of the records `bounces`, blended with the distribution `above` of
  /// the parent node, which may be null. Values are clamped to `cut`.
  static void blend(Bounces bounces, double cut, const Distribution* above, Distribution& out);
  void write_region(uint32_t region, const Distribution& distribution);
  /// Adds the records of a cell to the statistics.
  void count_cell(const Node& node, uint32_t cell);

  const GuidingGrid grid_;
  const bool first_, guides_;
  std::vector<TrainingRecord> records_;  ///< training records, sorted by Morton code
  std::vector<ShareRatios> ratios_;  ///< share_ratios() of each record; empty in the first round
  std::vector<uint32_t> codes_;
  std::vector<float> material_share_;
  size_t cell_records_ = 0;
  std::vector<Node> nodes_;
  uint32_t region_count_ = 0;
  Field built_;
  double contributing_ = 0, guided_ = 0, off_ = 0, on_ = 0;
};

}  // namespace wavecomb
