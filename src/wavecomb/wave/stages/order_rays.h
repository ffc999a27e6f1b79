// SPDX-License-Identifier: Apache-2.0
/// Wave stage 2a: sorts rays for more coherent traversal. The order depends only on the rays, so it
/// is the same under every shading policy.
#pragma once

#include "wavecomb/core/encoding/morton.h"
#include "wavecomb/wave/wave.h"

namespace wavecomb {

/// Returns the 30-bit Morton codes of points, quantised to the grid.
template <typename F>
inline UInt<F> position_key(const OrderGrid& grid, const Vec3<F>& p) {
  using U = UInt<F>;
  const auto axis = [&](const F& x, int i) {
    const F q = (x - F(grid.lo[i])) * grid.scale[i];
    return U(to_int<F>(clamp(select(is_finite(q), q, F(0.f)), F(0.f), F(1023.f))));
  };
  return morton_3<U>(axis(p.x, 0), axis(p.y, 1), axis(p.z, 2));
}

/// A component of a unit direction counts as long if its magnitude is above this threshold, which
/// is about 1 / sqrt(3).
inline constexpr float kLong = 0.6f;

/// Returns a six-bit key of a direction: three bits for its octant, and one bit for each component
/// above `kLong`.
template <typename F>
inline UInt<F> direction_key(const Vec3<F>& d) {
  using U = UInt<F>;
  const auto sign = [](const F& x) { return float_bits<F>(x) >> 31; };
  const auto is_long = [](const F& x) { return select(Mask<U>(abs(x) > kLong), U(1u), U(0u)); };
  return (sign(d.x) << 5) | (sign(d.y) << 4) | (sign(d.z) << 3) | (is_long(d.x) << 2) |
         (is_long(d.y) << 1) | is_long(d.z);
}

/// Computes the sort keys of the rays in the pool rows of `slot`: the Morton code of the origin,
/// preceded by the octant of the direction if `by_octant` is true. `rows` may hold path rows or
/// shadow ray rows, since both start with origin and direction.
template <typename F>
void ray_keys(const float* rows, const uint32_t* slot, size_t n, const OrderGrid& grid,
              bool by_octant, uint64_t* keys) {
  using U = UInt<F>;
  static_assert(kRowWords<PathRow> == kRowWords<ShadowRow>);
  alignas(64) uint32_t lanes[kWidth<F>];
  for (size_t i = 0; i < n; i += kWidth<F>) {
    const Mask<F> active = first_lanes<F>(n - i);
    const auto ray = load_head<RayHead, PathRow, F>(rows, load<U>(slot + i), active);
    U key = position_key<F>(grid, ray.o);
    // The octant needs three bits. It takes the two unused bits of the key, and replaces the lowest
    // bit of the Morton code, which matters less.
    if (by_octant) key = ((direction_key<F>(ray.d) >> 3) << 29) | (key >> 1);
    store(lanes, key);
    const size_t m = std::min(kWidth<F>, n - i);
    for (size_t k = 0; k < m; ++k) keys[i + k] = lanes[k];
  }
}

/// Order of a ray queue, with the work and time that the chooser of ray orders needs as feedback.
struct RayOrderChoice {
  bool chosen = false;
  size_t arm = 0;
  Work work;
  double prepare_ns = 0;
};

/// Sorts the slots in `queue` by the ray order `order`. If `order` is kAuto, `chooser` selects the
/// ray order. `rows` contains the rays of all slots.
template <typename F, typename Queue>
RayOrderChoice order_rays(Wave& wave, const WaveContext& context, uint32_t depth, RayOrder order,
                          Chooser& chooser, const float* rows, Queue& queue) {
  using U = UInt<F>;
  using Clock = PhaseClock::Clock;
  RayOrderChoice choice;
  if (order == RayOrder::kSlot || queue.size <= kWidth<F>) return choice;
  wave.clock.enter(Phase::kOrderRays);
  const Clock::time_point start = Clock::now();
  if (order == RayOrder::kAuto) {
    choice.chosen = true;
    choice.work = {static_cast<double>((queue.size + 15) / 16), static_cast<double>(queue.size)};
    std::array<Work, Wave::kRayOrders> work;
    work.fill(choice.work);
    choice.arm = chooser.choose(depth, work);
    order = static_cast<RayOrder>(choice.arm);
  }
  if (order == RayOrder::kDirection) {
    sort_by_direction(queue.direction, queue.slot, queue.size, queue.ordered_slot);
    std::swap(queue.slot, queue.ordered_slot);
  } else if (order != RayOrder::kSlot) {
    ray_keys<F>(rows, queue.slot, queue.size, context.grid, order == RayOrder::kMortonOctant,
                wave.ray_sorter.keys());
    uint32_t* indices = wave.ray_indices.data();
    if (wave.ray_sorter.sort(queue.size, indices)) {
      for (size_t i = 0; i < queue.size; i += kWidth<F>) {
        const Mask<U> active(first_lanes<F>(queue.size - i));
        store(queue.ordered_slot + i, gather<U>(queue.slot, load<U>(indices + i), active));
      }
      std::swap(queue.slot, queue.ordered_slot);
    }
  }
  choice.prepare_ns = std::chrono::duration<double, std::nano>(Clock::now() - start).count();
  return choice;
}

/// Reports the traversal time of a ray queue to the chooser of ray orders.
inline void learn_order(Chooser& chooser, uint32_t depth, const RayOrderChoice& choice,
                        PhaseClock::Clock::time_point start) {
  if (!choice.chosen) return;
  const double ns =
      std::chrono::duration<double, std::nano>(PhaseClock::Clock::now() - start).count();
  chooser.learn(depth, choice.arm, choice.work, ns, choice.prepare_ns);
}

}  // namespace wavecomb
