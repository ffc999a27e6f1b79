// SPDX-License-Identifier: Apache-2.0
/// Table of the straight transmission of thin walls of OpenPBR, in a separate source file, so
/// that an edit of the program recompiles no other source besides its kernels.
#include <algorithm>
#include <cmath>

#include "wavecomb/material/lobes/straight_transmission.h"
#include "wavecomb/material/programs/openpbr.h"

namespace wavecomb {

StraightTable wall_table(MaterialView view, uint32_t material, const Material& m) {
  view.energy = energy_tables({&m, 1});
  const auto no_graph = [](bool) { return GraphPoint<float>(); };
  const OpenPbrBsdf<float, kAllParts> wall(
      OpenPbrParams<float>::fetch<0, false>(view, material, {0, 0}, 0.f, no_graph, true), false);
  const float most = most_passing<float>(view.materials[material].flags);
  return make_straight_table([&](float z) {
    const Vec3<float> wo(std::sqrt(std::max(1 - z * z, 0.f)), 0, z);
    const Color<float> passed = wall.straight(wall.view(wo));
    return passing_probability<float>(passed, most);
  });
}

}  // namespace wavecomb
