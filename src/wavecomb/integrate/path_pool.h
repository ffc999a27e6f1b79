// SPDX-License-Identifier: Apache-2.0
/// The path slots of a wave.
#pragma once

#include "wavecomb/core/soa.h"
#include "wavecomb/core/vec.h"

namespace wavecomb {

/// A slot is one (pixel, sample) for life and owns its radiance. Everything that travels with the
/// ray is in the queues; this is what stays.
///
/// Contract: owned by one wave. AOV columns are there only where asked for.
class PathPool {
 public:
  PathPool() = default;
  PathPool(size_t capacity, bool with_aovs)
      : block_(with_aovs ? 12 : 5, capacity), has_aovs(with_aovs) {
    r = block_.floats(0);
    g = block_.floats(1);
    b = block_.floats(2);
    pixel_hash = block_.uints(3);
    sample = block_.uints(4);
    if (!with_aovs) return;
    size_t c = 5;
    for (float** f : {&albedo_r, &albedo_g, &albedo_b, &normal_x, &normal_y, &normal_z, &depth})
      *f = block_.floats(c++);
  }

  float *r = nullptr, *g = nullptr, *b = nullptr;  ///< radiance so far
  uint32_t* pixel_hash = nullptr;                  ///< SampleKey of the path
  uint32_t* sample = nullptr;
  float *albedo_r = nullptr, *albedo_g = nullptr, *albedo_b = nullptr;
  float *normal_x = nullptr, *normal_y = nullptr, *normal_z = nullptr;
  size_t bytes() const { return block_.bytes(); }
  float* depth = nullptr;  ///< along the camera's axis; infinite where nothing was hit

 private:
  SoaBlock block_;

 public:
  bool has_aovs = false;
};

/// Adds c to the radiance of the active lanes' slots, which are distinct.
template <typename F>
inline void add_radiance(const PathPool& pool, const UInt<F>& slot, const Color<F>& c,
                         const Mask<F>& active) {
  const auto add = [&](float* to, const F& x) {
    scatter<F>(to, gather<F>(to, slot, active) + x, slot, active);
  };
  add(pool.r, c.x);
  add(pool.g, c.y);
  add(pool.b, c.z);
}

}  // namespace wavecomb
