// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/guiding/path_moments.h"

namespace wavecomb {

void weigh_path(std::span<const PathStep> path, double ray_cost, double tail,
                std::span<BounceWorth> worth) {
  for (size_t j = path.size(); j-- > 0;) {
    const PathStep& v = path[j];
    const double value = v.value();
    worth[j] = {value * value, 0};
    if (!(v.left > 0)) continue;
    worth[j].cost = ray_cost + tail;
    if (j + 1 == path.size()) continue;
    const PathStep& next = path[j + 1];
    const double weight = next.arrived / v.arrived, next_value = next.value();
    worth[j].cost = ray_cost + next.vertex_cost + next.survival * worth[j + 1].cost;
    worth[j].squared +=
        weight * weight * (worth[j + 1].squared / next.survival - next_value * next_value);
  }
}

}  // namespace wavecomb
