// SPDX-License-Identifier: Apache-2.0
/// Makes the tree by which a light is chosen for the point that it is to shine on.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "wavecomb/core/settings.h"
#include "wavecomb/scene/light_data.h"

namespace wavecomb {

struct LightSet;

/// A tree over the finite lights that shine, and the share that infinite lights have beside it.
struct LightTree {
  std::vector<LightTreeNode> nodes;  ///< depth first; one less than there are lights in the tree
  std::vector<uint32_t> trails;      ///< LightTreeView::trails, of all lights
  std::vector<uint32_t> infinite_ends;
  std::vector<float> infinite_pdf;
  uint32_t root = kNoLight;    ///< node 0, or the only light; kNoLight: none shines
  float effective_lights = 0;  ///< LightTreeView::effective_lights
  uint32_t numbers = 0;        ///< of the 2^24 that choose a light of the tree

  /// Contract: points into this tree.
  LightTreeView view() const;
};

/// What is known of the tree of `set` before there is one: the share that infinite lights have
/// beside it, and effective_lights. It has no nodes and no trails.
LightTree outline_light_tree(const LightSet& set, std::span<const double> powers);

/// Whether kAuto chooses by a tree of so many effective lights.
bool pays_as_tree(float effective_lights);

/// Builds the tree over the finite lights of `set` whose `powers` (of all lights, W) are above 0:
/// A. Conty Estevez and C. Kulla, "Importance Sampling of Many Lights with Adaptive Tree
/// Splitting", 2018, section 4: binned, by bound, orientation and power ("SAOH"), down to single
/// lights. In parallel, and the same for any number of threads. Infinite lights are chosen by power
/// as in build_pick_table, one number in a hundred by heads.
LightTree build_light_tree(const LightSet& set, std::span<const double> powers);

/// Whether lights are chosen by tree. A scene without a finite light has none. kAuto: where the
/// finite lights are many, and of like powers: few strong ones are told from the others by power.
bool chooses_by_tree(LightSelection selection, const LightView& lights);

}  // namespace wavecomb
