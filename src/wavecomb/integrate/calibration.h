// SPDX-License-Identifier: Apache-2.0
/// Costs of materials before anything is rendered: synthetic hits, or a fixed model.
#pragma once

#include <vector>

#include "wavecomb/scene/scene.h"
#include "wavecomb/schedule/policy.h"

namespace wavecomb {

/// A triangle that wears a material.
struct CalibrationHit {
  uint32_t inst, mesh, geom, prim;
};

/// Synthetic hits of one material: `count` records over `distinct` triangles.
struct CalibrationHits {
  static constexpr uint32_t kMost = 64;
  uint32_t material = 0;
  uint32_t count = 0;
  uint32_t distinct = 0;
  float fill = 1;  ///< share of the lanes that packets fill, on average; at least one lane
  CalibrationHit hits[kMost];
};

/// Triangles of each material that some visible mesh wears, spread over its meshes; materials that
/// nothing wears are left out.
std::vector<CalibrationHits> find_calibration_hits(const Scene& scene);

/// What policies may know of the scene's materials.
std::vector<MaterialTraits> material_traits(const Scene& scene);

/// Fixed costs: a number for each program and one for each texture read, so that renders that
/// depend on costs are reproducible. In the proportions measured at 16 lanes (docs/benchmarks.md).
CostSnapshot model_costs(const Scene& scene);

}  // namespace wavecomb
