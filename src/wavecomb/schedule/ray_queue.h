// SPDX-License-Identifier: Apache-2.0
/// The rays of a wave that are to be traced next, with what their paths carry along.
#pragma once

#include "wavecomb/core/soa.h"

namespace wavecomb {

/// Rays side by side, in traversal order. That order is made from the rays alone: slot order as
/// generated, survivors keeping their places, so it is the same under every shading policy.
///
/// Contract: owned by one wave; `size` entries are valid; arrays have room for a packet past the
/// end.
class RayQueue {
 public:
  RayQueue() = default;
  explicit RayQueue(size_t capacity) : block_(kColumns, capacity), capacity_(capacity) {
    size_t c = 0;
    for (float** f : {&ox, &oy, &oz, &dx, &dy, &dz, &throughput_r, &throughput_g, &throughput_b,
                      &pdf, &eta_scale, &cone_width, &cone_spread})
      *f = block_.floats(c++);
    slot = block_.uints(c++);
    alive = block_.uints(c++);
  }

  float *ox, *oy, *oz;  ///< origin, world space
  float *dx, *dy, *dz;  ///< unit direction
  float *throughput_r, *throughput_g, *throughput_b;
  float* pdf;        ///< density of the bounce that made the ray; 0: delta or camera, no MIS
  float* eta_scale;  ///< product of eta^2 of the interfaces crossed, for roulette
  float *cone_width,
      *cone_spread;  ///< ray cone at the origin: width in scene units, angle in radians
  uint32_t* slot;    ///< path slot in the pool
  uint32_t* alive;   ///< while shading writes: nonzero where the entry holds a new ray
  size_t size = 0;

  static constexpr size_t kColumns = 15;
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
    slot = block_.uints(c++);
    alive = block_.uints(c++);
  }

  float *ox, *oy, *oz, *dx, *dy, *dz;
  float* tfar;
  float *r, *g, *b;  ///< what arrives in the slot's radiance when nothing is in the way
  uint32_t* slot;
  uint32_t* alive;
  size_t size = 0;
  static constexpr size_t kColumns = 12;
  size_t bytes() const { return block_.bytes(); }

 private:
  SoaBlock block_;
};

}  // namespace wavecomb
