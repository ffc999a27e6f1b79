// SPDX-License-Identifier: Apache-2.0
/// Traversal of one volume by many ray segments. When a lane has finished a segment, it continues
/// with the next unprocessed segment.
#pragma once

#include "wavecomb/core/encoding/hash.h"
#include "wavecomb/core/math.h"
#include "wavecomb/medium/volume/grid_traversal.h"
#include "wavecomb/path/media.h"
#include "wavecomb/path/statistics.h"

namespace wavecomb {

/// Packet of ray segments, one in each lane: the points o + x d with 0 < x < `length`.
template <typename F>
struct RaySegment {
  Vec3<F> o, d;
  F length;     ///< infinite if the ray leaves the scene
  F time{0.f};  ///< shutter time, if volumes move
};

/// Ray segments in columns: the points o + x d with 0 < x < `most`.
struct RaySegments {
  const float *ox, *oy, *oz, *dx, *dy, *dz;
  const float* most;
  const uint32_t* seed;  ///< seed for the random numbers of each segment
  const float* first;    ///< random number in [0, 1) for the first distance in the first volume
  size_t count;
  const float* times = nullptr;  ///< shutter times; null without motion
};

/// Sequence of random numbers for a ray segment in one volume. Each lane has a separate counter.
template <typename F>
struct CollisionSequence {
  UInt<F> seed{0u}, count{0u};

  void start(const UInt<F>& segment, uint32_t volume, const Mask<F>& lanes) {
    using U = UInt<F>;
    const Mask<U> on(lanes);
    seed = select(on, hash_u32<U>(segment, U(0x9c8f2d3bu + volume)), seed);
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

/// Returns, for each lane, how many lower lanes are set in the mask.
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

/// Follows ray segments from one tentative collision (real or null) to the next. Idle lanes take
/// new segments when three eighths of the lanes are idle. With a threshold of one quarter, more
/// lanes are busy, but the total time is longer. `Visitor` has these functions for the segments of
/// the lanes:
///
///   start(way, lanes)    begins these segments
///   Mask<F> collide(lanes, x, p, majorant, numbers)    handles a collision at o + x d, at the
///   point
///                        p of the grid's space, and returns the lanes that end there
///   finish(way, lanes)   ends these segments
///
/// The result of a ray segment does not depend on any other ray segment.
template <typename F, typename Visitor>
inline void each_collision(const TransformedGrid& transformed, float scale, uint32_t volume,
                           const RaySegments& segments, VolumeCounts& counts, Visitor& visitor) {
  using U = UInt<F>;
  constexpr auto kWide = static_cast<uint32_t>(kWidth<F>);
  constexpr uint32_t kMinFree = kWide < 4 ? 1 : 3 * kWide / 8;
  if (scale <= 0) return;
  GridTraversal<F> traversal(transformed);
  CollisionSequence<F> numbers;
  F left(0.f);  // optical depth until the next collision
  U segment(0u);
  Mask<F> busy(false);
  size_t next = 0;
  const auto depth = [](const F& number) { return F(-log(F(1.f - number))); };
  for (;;) {
    const Mask<F> idle = not_(traversal.on());
    const uint32_t free = count<F>(idle);
    if (next < segments.count ? free >= kMinFree : free == kWide) {
      visitor.finish(segment, Mask<F>(busy & idle));
      if (next == segments.count) return;
      const U next_segment = detail::ranks<F>(idle) + static_cast<uint32_t>(next);
      const Mask<F> starts =
          idle & Mask<F>(next_segment < U(static_cast<uint32_t>(segments.count)));
      next = std::min(segments.count, next + free);
      busy = (busy & not_(idle)) | starts;
      segment = select(Mask<U>(starts), next_segment, segment);
      const auto column = [&](const float* values) { return gather<F>(values, segment, starts); };
      traversal.start({column(segments.ox), column(segments.oy), column(segments.oz)},
                      {column(segments.dx), column(segments.dy), column(segments.dz)},
                      column(segments.most), starts);
      numbers.start(gather<U>(segments.seed, segment, Mask<U>(starts)), volume, starts);
      const F first = volume == 0 ? column(segments.first) : numbers.next(starts);
      left = select(starts, depth(first), left);
      visitor.start(segment, starts);
      continue;
    }
    const F majorant = traversal.most() * scale;
    const F leave = traversal.leave();
    const F here = majorant * (leave - traversal.x());
    const Mask<F> collides = traversal.on() & (left < here);
    counts.lanes += kWide;
    counts.steps += kWide - free;
    const Mask<F> passes = traversal.on() & not_(collides);
    if (any(collides)) {
      counts.collisions += count<F>(collides);
      const F x = min(F(traversal.x() + left / select(collides, majorant, F(1.f))), leave);
      traversal.move_to(x, collides);
      const F next_depth = depth(numbers.next(collides));
      left = select(collides, next_depth, F(left - here));
      traversal.stop(visitor.collide(collides, x, traversal.at(x), majorant, numbers));
    } else {
      left = left - here;
    }
    traversal.next_cell(passes);
  }
}

/// Ray segments of a single packet.
template <typename F>
class PacketSegments {
  using U = UInt<F>;
  static constexpr size_t kLanes = kWidth<F>;

 public:
  /// Inactive lanes have a segment of length 0.
  PacketSegments(const Vec3<F>& o, const Vec3<F>& d, const F& most, const U& seed, const F& first,
                 const F& time, const Mask<F>& active) {
    const F* const columns[8] = {&o.x, &o.y, &o.z, &d.x, &d.y, &d.z, &first, &time};
    for (size_t k = 0; k < 8; ++k) store(columns_[k], *columns[k]);
    store(columns_[8], select(active, most, F(0.f)));
    store(seed_, seed);
  }
  RaySegments segments() const {
    return {columns_[0], columns_[1], columns_[2], columns_[3], columns_[4], columns_[5],
            columns_[8], seed_,       columns_[6], kLanes,      columns_[7]};
  }

 private:
  alignas(64) float columns_[9][kLanes];
  alignas(64) uint32_t seed_[kLanes];
};

}  // namespace wavecomb
