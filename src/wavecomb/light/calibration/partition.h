// SPDX-License-Identifier: Apache-2.0
/// Division of the lights into parts with calibrated selection probabilities.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "wavecomb/scene/scene.h"

namespace wavecomb {

inline constexpr uint32_t kNoPart = 0xffffffffu;

/// Division of the lights that emit into parts, each of which has one calibrated selection
/// probability. For selection by power, each infinite light, each finite light and each emissive
/// mesh of an instance is a part. If there would be more than `kMax` parts, the lights of lowest
/// power together form one part. For selection by tree, each infinite light is a part, and the tree
/// is the last part.
struct LightParts {
  static constexpr size_t kMax = 64;
  bool by_tree = false;
  /// Selection probability of each part in proportion to power; the sum is 1.
  std::vector<double> power;
  std::vector<std::string> names;  ///< name of each part, for reports
  /// Index of the part to which each light record belongs; kNoPart if the light is never selected.
  std::vector<uint32_t> of_record;
  /// For each emissive mesh, the index of its first light and the index of its part, in ascending
  /// order.
  std::vector<std::pair<uint32_t, uint32_t>> of_mesh;

  size_t size() const { return power.size(); }
  /// Returns the part to which a selected light belongs.
  uint32_t of(uint32_t light) const;
};

/// Largest number of lights for which selection by power is calibrated. Each calibrated light needs
/// 8 bytes in addition to its 64 bytes, and about 30 bytes more during calibration. Each light
/// keeps at least one of the 2^24 random values, and the limit leaves at least half of the values
/// for calibration.
inline constexpr size_t kMaxCalibratedLights = size_t{1} << 23;

/// Divides the lights of a scene for selection by tree or by power. For selection by power, returns
/// no parts if there would be fewer than two parts or if there are more than `kMaxCalibratedLights`
/// lights. For selection by tree, returns no parts if the tree has no lights.
LightParts divide_lights(const Scene& scene, bool by_tree);

/// Calibration of a light tree node: a factor on the odds of selecting its right child instead of
/// its left child. Without calibration, the odds are the ratio of the children's importances.
struct NodeTilt {
  uint32_t node;
  float odds;
};

/// Calibrated light tables that replace the light tables of a LightView.
struct CalibratedLights {
  /// Selection probability of each part, after rounding; empty if the view's tables are not
  /// replaced.
  std::vector<double> shares;
  /// Selection probability of each light; empty for selection by tree.
  std::vector<float> selection_pdf;
  std::vector<uint32_t> power_bins;
  PowerTable power_table;  ///< table whose bins are `power_bins`; `apply()` sets the pointer
  std::vector<uint32_t> infinite_ends;
  std::vector<float> infinite_pdf;
  uint32_t tree_numbers = 0;
  /// Calibrated nodes of the light tree; empty if the tree is not changed.
  std::vector<LightTreeNode> nodes;

  /// Replaces the tables of `view`. Contract: after the call, `view` points into this object.
  void apply(LightView& view) const;
};

/// Builds copies of the light tables with changed selection probabilities. Tables can be built any
/// number of times.
///
/// Contract: the arguments of the constructor outlive the builder.
class LightTableBuilder {
 public:
  /// `tree` is the light tree of `set`. `tree` may have no nodes if `build_tables()` is called
  /// without tilts (NodeTilt).
  LightTableBuilder(const LightSet& set, const LightTree& tree, const LightParts& parts);

  /// Builds tables in which part i has the selection probability shares[i] (> 0, sum 1).
  /// Probabilities are rounded to multiples of 2^-24, and `build_power_table()` imposes a minimum.
  /// Within a part, the relative probabilities stay the same, except for the odds at the nodes of
  /// `tilts`.
  CalibratedLights build_tables(std::span<const double> shares, std::span<const NodeTilt> tilts);

 private:
  /// Range [begin, end) of light indices in one part.
  struct Range {
    size_t begin, end;
    uint32_t part;
  };
  void build_power_tables(std::span<const double> shares, CalibratedLights& out);

  const LightSet& set_;
  const LightTree& tree_;
  const LightParts& parts_;
  // Data for selection by power: light ranges, the selection probability of each light, and
  // buffers.
  std::vector<Range> ranges_;
  std::vector<float> by_power_;
  std::vector<double> weights_;
  std::vector<uint32_t> numbers_;
};

}  // namespace wavecomb
