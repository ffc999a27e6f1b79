// SPDX-License-Identifier: Apache-2.0
/// Axis-aligned bounding box.
#pragma once

#include "wavecomb/core/vec.h"

namespace wavecomb {

/// Axis-aligned bounding box in scene units. A new box is empty.
struct Bounds {
  Vec3<float> lo{1e30f, 1e30f, 1e30f}, hi{-1e30f, -1e30f, -1e30f};
  bool empty() const { return lo.x > hi.x; }
  void add(const Vec3<float>& p) {
    lo = {p.x < lo.x ? p.x : lo.x, p.y < lo.y ? p.y : lo.y, p.z < lo.z ? p.z : lo.z};
    hi = {p.x > hi.x ? p.x : hi.x, p.y > hi.y ? p.y : hi.y, p.z > hi.z ? p.z : hi.z};
  }
  void add(const Bounds& b) {
    if (b.empty()) return;
    add(b.lo);
    add(b.hi);
  }
};

}  // namespace wavecomb
