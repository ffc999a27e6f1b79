// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/schedule/ray_order.h"

namespace wavecomb {
namespace {

template <typename Queue, size_t N, size_t M>
void move_columns(const Queue& from, Queue& to, const uint32_t* order, size_t n,
                  float* Queue::* const (&floats)[N], uint32_t* Queue::* const (&uints)[M]) {
  for (auto column : floats)
    for (size_t i = 0; i < n; ++i) (to.*column)[i] = (from.*column)[order[i]];
  for (auto column : uints)
    for (size_t i = 0; i < n; ++i) (to.*column)[i] = (from.*column)[order[i]];
  to.size = n;
}

}  // namespace

void permute(const RayQueue& from, RayQueue& to, const uint32_t* order, size_t n) {
  using Q = RayQueue;
  static constexpr float* Q::* kFloats[] = {
      &Q::ox,        &Q::oy,           &Q::oz,           &Q::dx,           &Q::dy,
      &Q::dz,        &Q::throughput_r, &Q::throughput_g, &Q::throughput_b, &Q::pdf,
      &Q::eta_scale, &Q::cone_width,   &Q::cone_spread};
  static constexpr uint32_t* Q::* kUints[] = {&Q::slot};
  move_columns(from, to, order, n, kFloats, kUints);
}

void permute(const ShadowQueue& from, ShadowQueue& to, const uint32_t* order, size_t n) {
  using Q = ShadowQueue;
  static constexpr float* Q::* kFloats[] = {&Q::ox, &Q::oy,   &Q::oz, &Q::dx, &Q::dy,
                                            &Q::dz, &Q::tfar, &Q::r,  &Q::g,  &Q::b};
  static constexpr uint32_t* Q::* kUints[] = {&Q::slot};
  move_columns(from, to, order, n, kFloats, kUints);
}

}  // namespace wavecomb
