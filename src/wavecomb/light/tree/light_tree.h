// SPDX-License-Identifier: Apache-2.0
/// Builds the light tree, which selects a light for a given shading point.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "wavecomb/core/settings_choices.h"
#include "wavecomb/light/description/light_records.h"

namespace wavecomb {

struct LightSet;

/// Light tree over the finite lights that emit, and the selection probabilities of infinite lights.
struct LightTree {
  /// Nodes in depth-first order; their number is one less than the number of lights in the tree.
  std::vector<LightTreeNode> nodes;
  std::vector<uint32_t> trails;  ///< trail of each light (LightTreeView::trails)
  std::vector<uint32_t> infinite_ends;
  std::vector<float> infinite_pdf;
  /// Root of the tree: 0 (the first node), kTreeLeaf | light index if the tree has a single light,
  /// or kNoLight if no light of the tree emits.
  uint32_t root = kNoLight;
  float effective_lights = 0;  ///< LightTreeView::effective_lights
  /// Number of the 2^24 random numbers that select a light of the tree.
  uint32_t numbers = 0;

  /// Returns the device view. Contract: the device view points into this tree.
  LightTreeView view() const;
};

/// Computes the members of the light tree of `set` that do not depend on its nodes: the selection
/// probabilities of infinite lights, and `effective_lights`. The result has no nodes and no trails.
LightTree outline_light_tree(const LightSet& set, std::span<const double> powers);

/// Returns whether LightSelection::kAuto uses a light tree if the effective number of lights is
/// `effective_lights`.
bool prefers_tree(float effective_lights);

/// Builds the light tree over the finite lights of `set` whose power is above 0; `powers` holds the
/// powers of all lights in W. Binned splits minimise the surface area orientation heuristic (SAOH),
/// down to single lights, after A. Conty Estevez and C. Kulla, "Importance Sampling of Many Lights
/// with Adaptive Tree Splitting", 2018, section 4. The function runs in parallel; the result does
/// not depend on the number of threads. Infinite lights are selected by power as in
/// build_power_table(), with one random number in a hundred distributed evenly among all lights.
LightTree build_light_tree(const LightSet& set, std::span<const double> powers);

/// Returns whether lights are selected by tree. A scene without finite lights has no tree. kAuto
/// uses the tree if there are many finite lights of similar power, because selection by power
/// suffices where a few strong lights dominate.
bool chooses_by_tree(LightSelection selection, const LightView& lights);

}  // namespace wavecomb
