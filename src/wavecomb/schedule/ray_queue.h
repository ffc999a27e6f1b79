// SPDX-License-Identifier: Apache-2.0
/// Queues of path rays and shadow rays of a wave, and the hits found by traversal.
#pragma once

#include "wavecomb/core/rows/soa.h"

namespace wavecomb {

/// Rays in SoA layout and in traversal order. All other state of a path stays in the path's slot of
/// the pool. The order of the rays does not depend on the scheduling policy: rays are generated in
/// slot order, and the rays of continuing paths keep their order.
///
/// Contract: owned by one wave; the first `size` entries of each array are valid; arrays are padded
/// by one packet past the end.
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
  uint32_t* ordered_slot;  ///< output buffer for reordered slots
  uint32_t* direction;     ///< direction_key() of each ray, written by shading
  size_t size = 0;

  static constexpr size_t kColumns = 9;
  size_t capacity() const { return capacity_; }
  size_t bytes() const { return block_.bytes(); }

 private:
  SoaBlock block_;
  size_t capacity_ = 0;
};

/// Traversal results for the rays of a RayQueue, at the same indices.
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

  float* t;        ///< hit distance
  float *u, *v;    ///< barycentric coordinates: p = (1 - u - v) p0 + u p1 + v p2
  uint32_t* prim;  ///< primitive index within its geometry, such as a triangle of a mesh
  /// geometry index within the instance's group, or light index if the ray hit the shape of a light
  uint32_t* geom;
  uint32_t* inst;  ///< instance index, or a marker of EmbreeAccelerator for a miss or a light
  size_t bytes() const { return block_.bytes(); }

 private:
  SoaBlock block_;
};

/// Shadow rays of one path depth, at most one per path, in the order of the ray queue.
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
  float *r, *g, *b;  ///< radiance added to the path if the ray is unoccluded
  uint32_t *slot, *ordered_slot, *direction;  ///< as in RayQueue
  uint32_t* occluded;                         ///< 1 if traversal found the ray occluded, else 0
  size_t size = 0;
  static constexpr size_t kColumns = 14;
  size_t bytes() const { return block_.bytes(); }

 private:
  SoaBlock block_;
};

}  // namespace wavecomb
