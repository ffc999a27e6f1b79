// SPDX-License-Identifier: Apache-2.0
/// Traversal of one volume by many ray segments. A lane takes the next segment when it has finished
/// one.
#pragma once

#include "wavecomb/core/hash.h"
#include "wavecomb/core/math.h"
#include "wavecomb/medium/volume/grid_traversal.h"
#include "wavecomb/path/media.h"
#include "wavecomb/path/statistics.h"

namespace wavecomb {

/// Ray segment in each lane: points o + x d with 0 < x < length.
template <typename F>
struct RaySegment {
  Vec3<F> o, d;
  F length;     ///< infinite if the ray leaves the scene
  F time{0.f};  ///< shutter time, if volumes move
};

/// Columns of ray segments: points o + x d with 0 < x < most.
struct Ways {
  const float *ox, *oy, *oz, *dx, *dy, *dz;
  const float* most;
  const uint32_t* seed;  ///< seed for the random numbers of each segment
  const float* first;    ///< random number in [0, 1) of the first distance in the first volume
  size_t count;
  const float* times = nullptr;  ///< shutter times; null without motion
};

/// Random number sequence of a ray segment in one volume. Each lane has a separate counter.
template <typename F>
struct CollisionNumbers {
  UInt<F> seed{0u}, count{0u};

  void start(const UInt<F>& way, uint32_t volume, const Mask<F>& lanes) {
    using U = UInt<F>;
    const Mask<U> on(lanes);
    seed = select(on, hash_u32<U>(way, U(0x9c8f2d3bu + volume)), seed);
    count = select(on, U(0u), count);
  }
  F next(const Mask<F>& lanes) {
    using U = UInt<F>;
    const F number = unit_float<F>(hash_u32<U>(seed, count));
    count = select(Mask<U>(lanes), U(count + 1u), count);
    return number;
  }
};

namespace detail {

/// Returns, for each lane, the number of set lanes before it.
template <typename F>
inline UInt<F> ranks(const Mask<F>& lanes) {
  if constexpr (kIsScalar<F>) {
    (void)lanes;
    return 0;
  } else {
    InMemory<UInt<F>> out;
    const uint32_t bits = lane_bits<F>(lanes);
    for (uint32_t i = 0; i < kWidth<F>; ++i)
      out.value[i] = static_cast<uint32_t>(std::popcount(bits & ((1u << i) - 1u)));
    return load<UInt<F>>(out.value);
  }
}

}  // namespace detail

/// Follows ray segments from one collision with the majorant to the next, real or null. Idle lanes
/// take the next segments once three eighths of the lanes are idle; with a quarter, lanes are
/// fuller but the total time is longer.
/// `Visitor` has these functions for the segments of the lanes:
///
///   start(way, lanes)    begins these segments
///   Mask<F> collide(lanes, x, p, majorant, numbers)    handles a collision at o + x d, at the
///   point
///                        p of the grid's space, and returns the lanes that end there
///   finish(way, lanes)   ends these segments
///
/// The result of a segment does not depend on other segments.
template <typename F, typename Visitor>
inline void each_collision(const PlacedGrid& placed, float scale, uint32_t volume, const Ways& ways,
                           VolumeCounts& counts, Visitor& visitor) {
  using U = UInt<F>;
  constexpr auto kWide = static_cast<uint32_t>(kWidth<F>);
  constexpr uint32_t kEnough = kWide < 4 ? 1 : 3 * kWide / 8;
  if (scale <= 0) return;
  BrickWalk<F> walk(placed);
  CollisionNumbers<F> numbers;
  F left(0.f);  // optical depth until the next collision
  U way(0u);
  Mask<F> busy(false);
  size_t next = 0;
  const auto depth = [](const F& number) { return F(-log(F(1.f - number))); };
  for (;;) {
    const Mask<F> idle = not_(walk.on());
    const uint32_t free = count<F>(idle);
    if (next < ways.count ? free >= kEnough : free == kWide) {
      visitor.finish(way, Mask<F>(busy & idle));
      if (next == ways.count) return;
      const U mine = detail::ranks<F>(idle) + static_cast<uint32_t>(next);
      const Mask<F> takes = idle & Mask<F>(mine < U(static_cast<uint32_t>(ways.count)));
      next = std::min(ways.count, next + free);
      busy = (busy & not_(idle)) | takes;
      way = select(Mask<U>(takes), mine, way);
      const auto column = [&](const float* values) { return gather<F>(values, way, takes); };
      walk.start({column(ways.ox), column(ways.oy), column(ways.oz)},
                 {column(ways.dx), column(ways.dy), column(ways.dz)}, column(ways.most), takes);
      numbers.start(gather<U>(ways.seed, way, Mask<U>(takes)), volume, takes);
      const F first = volume == 0 ? column(ways.first) : numbers.next(takes);
      left = select(takes, depth(first), left);
      visitor.start(way, takes);
      continue;
    }
    const F majorant = walk.most() * scale;
    const F leave = walk.leave();
    const F here = majorant * (leave - walk.x());
    const Mask<F> collides = walk.on() & (left < here);
    counts.lanes += kWide;
    counts.steps += kWide - free;
    const Mask<F> passes = walk.on() & not_(collides);
    if (any(collides)) {
      counts.collisions += count<F>(collides);
      const F x = min(F(walk.x() + left / select(collides, majorant, F(1.f))), leave);
      walk.move_to(x, collides);
      const F again = depth(numbers.next(collides));
      left = select(collides, again, F(left - here));
      walk.stop(visitor.collide(collides, x, walk.at(x), majorant, numbers));
    } else {
      left = left - here;
    }
    walk.next_cell(passes);
  }
}

/// Ray segments of a single packet.
template <typename F>
class PacketWays {
  using U = UInt<F>;
  static constexpr size_t kLanes = kWidth<F>;

 public:
  /// Inactive lanes have a segment of length 0.
  PacketWays(const Vec3<F>& o, const Vec3<F>& d, const F& most, const U& seed, const F& first,
             const F& time, const Mask<F>& active) {
    const F* const columns[8] = {&o.x, &o.y, &o.z, &d.x, &d.y, &d.z, &first, &time};
    for (size_t k = 0; k < 8; ++k) store(columns_[k], *columns[k]);
    store(columns_[8], select(active, most, F(0.f)));
    store(seed_, seed);
  }
  Ways ways() const {
    return {columns_[0], columns_[1], columns_[2], columns_[3], columns_[4], columns_[5],
            columns_[8], seed_,       columns_[6], kLanes,      columns_[7]};
  }

 private:
  alignas(64) float columns_[9][kLanes];
  alignas(64) uint32_t seed_[kLanes];
};

}  // namespace wavecomb
