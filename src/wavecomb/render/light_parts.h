// SPDX-License-Identifier: Apache-2.0
/// The parts among which the choice of a light is shared out, and lights with other shares.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "wavecomb/scene/scene.h"

namespace wavecomb {

inline constexpr uint32_t kNoPart = 0xffffffffu;

/// Lights that shine, divided. By power: each infinite light, each finite one, each emissive mesh
/// of an instance, and one part of the weakest where there are more than kMost. By tree: each
/// infinite light, and the tree, which is the last.
struct LightParts {
  static constexpr size_t kMost = 64;
  bool by_tree = false;
  std::vector<double> power;        ///< probability by power of each part; the sum is 1
  std::vector<std::string> names;   ///< of lights and meshes, "tree", "N others"
  std::vector<uint32_t> of_record;  ///< kNoPart: never chosen
  std::vector<std::pair<uint32_t, uint32_t>> of_mesh;  ///< first light and part, ascending

  size_t size() const { return power.size(); }
  /// The part of a light that was chosen.
  uint32_t of(uint32_t light) const;
};

/// Most lights of a table that are weighed: 8 bytes each, and some 30 more meanwhile, beside the 64
/// of the light itself. Each has one of 2^24 numbers whatever its share: half of them are left.
inline constexpr size_t kMostWeighed = size_t{1} << 23;

/// The parts of the lights of a scene, chosen by tree or by power. Empty where there is nothing to
/// share out: fewer than two parts (by power), more than kMostWeighed lights (by power), no light
/// in the tree.
LightParts divide_lights(const Scene& scene, bool by_tree);

/// A half of an upper node of the light tree: by how much its right child is more probable against
/// the left one than by importance alone, as a factor of the odds.
struct NodeTilt {
  uint32_t node;
  float odds;
};

/// What takes the place of parts of a LightView.
struct WeighedLights {
  std::vector<double> shares;   ///< of the parts, as rounding has made them; empty: nothing changes
  std::vector<float> pick_pdf;  ///< of each light, where it is not the tree that chooses
  std::vector<uint32_t> pick_bins;
  PickTable pick;  ///< without its pointer
  std::vector<uint32_t> infinite_ends;
  std::vector<float> infinite_pdf;
  uint32_t tree_numbers = 0;
  std::vector<LightTreeNode> nodes;  ///< empty: those of the tree

  /// Contract: the view then points into this object.
  void apply(LightView& view) const;
};

/// Gives the lights of a set other shares, any number of times.
///
/// Contract: what it was made of outlives it.
class LightWeigher {
 public:
  /// `tree`: of the set, with nodes where there will be tilts.
  LightWeigher(const LightSet& set, const LightTree& tree, const LightParts& parts);

  /// Lights of which part i is chosen with probability shares[i] (> 0, sum 1), to within rounding
  /// to numbers of 24 bits and the floor of build_pick_table. Within a part all is as before, but
  /// for the odds at the nodes of `tilts`.
  WeighedLights weigh(std::span<const double> shares, std::span<const NodeTilt> tilts);

 private:
  /// The lights of a part with numbers from begin to end.
  struct Range {
    size_t begin, end;
    uint32_t part;
  };
  void weigh_table(std::span<const double> shares, WeighedLights& out);

  const LightSet& set_;
  const LightTree& tree_;
  const LightParts& parts_;
  // By power alone: ranges, what each light has there, and room for a table in the making.
  std::vector<Range> ranges_;
  std::vector<float> by_power_;
  std::vector<double> weights_;
  std::vector<uint32_t> numbers_;
};

}  // namespace wavecomb
