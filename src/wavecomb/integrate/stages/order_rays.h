// SPDX-License-Identifier: Apache-2.0
/// Stage 2a: rays in an order that traversal may like better. Made from the rays alone, so it is
/// the same under every shading policy.
#pragma once

#include "wavecomb/core/morton.h"
#include "wavecomb/integrate/wave.h"

namespace wavecomb {

/// Morton code of points on the grid, 30 bits.
template <typename F>
inline UInt<F> position_key(const OrderGrid& grid, const Vec3<F>& p) {
  using U = UInt<F>;
  const auto axis = [&](const F& x, int i) {
    const F q = (x - F(grid.lo[i])) * grid.scale[i];
    return U(to_int<F>(clamp(select(is_finite(q), q, F(0.f)), F(0.f), F(1023.f))));
  };
  return morton_3<U>(axis(p.x, 0), axis(p.y, 1), axis(p.z, 2));
}

/// Keys of rays: the Morton code of the origin, under the octant of the direction where asked for.
template <typename F, typename Queue>
void ray_keys(const Queue& q, const OrderGrid& grid, bool by_octant, uint64_t* keys) {
  using U = UInt<F>;
  alignas(64) uint32_t lanes[kWidth<F>];
  for (size_t i = 0; i < q.size; i += kWidth<F>) {
    const Vec3<F> o{load<F>(q.ox + i), load<F>(q.oy + i), load<F>(q.oz + i)};
    U key = position_key<F>(grid, o);
    if (by_octant) {
      const auto sign = [&](const float* d) { return float_bits<F>(load<F>(d + i)) >> 31; };
      // The octant takes the two spare bits and the place of the lowest: it is worth more than that
      // one
      key = (sign(q.dx) << 31) | (sign(q.dy) << 30) | (sign(q.dz) << 29) | (key >> 1);
    }
    store(lanes, key);
    const size_t n = std::min(kWidth<F>, q.size - i);
    for (size_t k = 0; k < n; ++k) keys[i + k] = lanes[k];
  }
}

/// What was done, for the chooser to learn from.
struct RayOrderChoice {
  bool chosen = false;
  size_t arm = 0;
  Work work;
  double prepare_ns = 0;
};

/// Orders the queue as `order` says; kAuto asks the chooser. `other` is where ordered rays go.
template <typename F, typename Queue>
RayOrderChoice order_rays(Wave& wave, const WaveContext& context, uint32_t depth, RayOrder order,
                          Chooser& chooser, Queue& queue, Queue& other) {
  using Clock = PhaseClock::Clock;
  RayOrderChoice choice;
  if (order == RayOrder::kSlot || queue.size <= kWidth<F>) return choice;
  wave.clock.enter(Phase::kOrderRays);
  const Clock::time_point start = Clock::now();
  if (order == RayOrder::kAuto) {
    choice.chosen = true;
    choice.work = {static_cast<double>((queue.size + 15) / 16), static_cast<double>(queue.size)};
    const std::array<Work, Wave::kRayOrders> work{choice.work, choice.work, choice.work};
    choice.arm = chooser.choose(depth, work);
    order = static_cast<RayOrder>(choice.arm);
  }
  if (order != RayOrder::kSlot) {
    ray_keys<F>(queue, context.grid, order == RayOrder::kMortonOctant, wave.ray_sorter.keys());
    if (wave.ray_sorter.sort(queue.size, wave.ray_indices.data())) {
      permute(queue, other, wave.ray_indices.data(), queue.size);
      std::swap(queue, other);
    }
  }
  choice.prepare_ns = std::chrono::duration<double, std::nano>(Clock::now() - start).count();
  return choice;
}

/// Tells the chooser how long traversal took.
inline void learn_order(Chooser& chooser, uint32_t depth, const RayOrderChoice& choice,
                        PhaseClock::Clock::time_point start) {
  if (!choice.chosen) return;
  const double ns =
      std::chrono::duration<double, std::nano>(PhaseClock::Clock::now() - start).count();
  chooser.learn(depth, choice.arm, choice.work, ns, choice.prepare_ns);
}

}  // namespace wavecomb
