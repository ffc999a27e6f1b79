// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/guiding/path_moments.h"

namespace wavecomb {

void compute_path_moments(std::span<const PathStep> path, double ray_cost, double tail,
                          std::span<BounceMoments> moments) {
  for (size_t j = path.size(); j-- > 0;) {
    const PathStep& v = path[j];
    const double value = v.value();
    moments[j] = {value * value, 0};
    if (!(v.left > 0)) continue;
    moments[j].cost = ray_cost + tail;
    if (j + 1 == path.size()) continue;
    const PathStep& next = path[j + 1];
    const double weight = next.arrived / v.arrived, next_value = next.value();
    moments[j].cost = ray_cost + next.vertex_cost + next.survival * moments[j + 1].cost;
    moments[j].squared +=
        weight * weight * (moments[j + 1].squared / next.survival - next_value * next_value);
  }
}

}  // namespace wavecomb
