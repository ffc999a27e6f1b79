// SPDX-License-Identifier: Apache-2.0
/// Estimates of material costs before the first pass, measured on synthetic hits or computed by a
/// fixed model.
#pragma once

#include <vector>

#include "wavecomb/scene/scene_view.h"
#include "wavecomb/schedule/policy.h"

namespace wavecomb {

class Scene;

/// Ids of the triangle of a synthetic hit.
struct CalibrationHit {
  uint32_t inst, mesh, geom, prim;
};

/// Synthetic hits of one material: `count` records distributed over `distinct` triangles.
struct CalibrationHits {
  static constexpr uint32_t kMax = 64;
  uint32_t material = 0;
  uint32_t count = 0;
  uint32_t distinct = 0;
  float fill = 1;  ///< average fraction of active lanes in packets; at least one lane is active
  CalibrationHit hits[kMax];
};

/// Returns synthetic hits for each material that is bound to a visible mesh. The hits of a material
/// are distributed over the meshes with this material.
std::vector<CalibrationHits> find_calibration_hits(const Scene& scene);

/// Returns the material properties that scheduling policies may use.
std::vector<MaterialTraits> material_traits(const Scene& scene);

/// Returns modelled costs: a fixed cost for each program and for each texture lookup, so that
/// renders that depend on costs are reproducible. The proportions were measured at 16 lanes
/// (docs/benchmarks.md).
CostSnapshot model_costs(const Scene& scene);

}  // namespace wavecomb
