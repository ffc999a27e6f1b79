// SPDX-License-Identifier: Apache-2.0
/// The rays of a wave that are to be traced next, and what traversal finds.
#pragma once

#include "wavecomb/core/soa.h"

namespace wavecomb {

/// Rays side by side, in traversal order, as traversal reads them; the rest of a path stays in its
/// slot of the pool. The order is made from the rays alone: slot order as generated, survivors
/// keeping their places, so it is the same under every shading policy.
///
/// Contract: owned by one wave; `size` entries are valid; arrays have room for a packet past the
/// end.
class RayQueue {
 public:
  RayQueue() = default;
  explicit RayQueue(size_t capacity) : block_(kColumns, capacity), capacity_(capacity) {
    size_t c = 0;
    for (float** f : {&ox, &oy, &oz, &dx, &dy, &dz}) *f = block_.floats(c++);
    for (uint32_t** u : {&slot, &ordered_slot, &direction}) *u = block_.uints(c++);
  }

  float *ox, *oy, *oz;     ///< origin, world space
  float *dx, *dy, *dz;     ///< unit direction
  uint32_t* slot;          ///< path slot in the pool
  uint32_t* ordered_slot;  ///< where slots go when they are put in another order
  uint32_t* direction;     ///< direction_key of the rays, as shading listed them
  size_t size = 0;

  static constexpr size_t kColumns = 9;
  size_t capacity() const { return capacity_; }
  size_t bytes() const { return block_.bytes(); }

 private:
  SoaBlock block_;
  size_t capacity_ = 0;
};

/// What traversal found for the rays of a RayQueue, entry by entry.
class HitBuffer {
 public:
  HitBuffer() = default;
  explicit HitBuffer(size_t capacity) : block_(6, capacity) {
    t = block_.floats(0);
    u = block_.floats(1);
    v = block_.floats(2);
    prim = block_.uints(3);
    geom = block_.uints(4);
    inst = block_.uints(5);
  }

  float* t;        ///< distance
  float *u, *v;    ///< barycentric coordinates: p = (1 - u - v) p0 + u p1 + v p2
  uint32_t* prim;  ///< triangle within its mesh
  uint32_t* geom;  ///< geometry within the instance's group, or number of the light
  uint32_t* inst;  ///< instance, or what EmbreeAccelerator puts there for a miss or a light's shape
  size_t bytes() const { return block_.bytes(); }

 private:
  SoaBlock block_;
};

/// Shadow rays of one depth, at most one a path, in the order of the paths' rays.
class ShadowQueue {
 public:
  ShadowQueue() = default;
  explicit ShadowQueue(size_t capacity) : block_(kColumns, capacity) {
    size_t c = 0;
    for (float** f : {&ox, &oy, &oz, &dx, &dy, &dz, &tfar, &r, &g, &b}) *f = block_.floats(c++);
    for (uint32_t** u : {&slot, &ordered_slot, &direction, &occluded}) *u = block_.uints(c++);
  }

  float *ox, *oy, *oz, *dx, *dy, *dz;
  float* tfar;
  float *r, *g, *b;  ///< what arrives in the slot's radiance when nothing is in the way
  uint32_t *slot, *ordered_slot, *direction;  ///< as in RayQueue
  uint32_t* occluded;                         ///< after traversal: 1 where something is in the way
  size_t size = 0;
  static constexpr size_t kColumns = 14;
  size_t bytes() const { return block_.bytes(); }

 private:
  SoaBlock block_;
};

}  // namespace wavecomb
