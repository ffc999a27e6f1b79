// SPDX-License-Identifier: Apache-2.0
/// Counters of a render.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

namespace wavecomb {

/// Number of depths with a separate counter. Deeper vertices are added to the last counter.
inline constexpr uint32_t kCountedDepths = 32;

/// Counters of ray segments in volumes.
struct VolumeCounts {
  uint64_t steps = 0;       ///< grid cells visited by paths and shadow rays, plus collisions
  uint64_t collisions = 0;  ///< tentative collisions, which are real or null collisions
  uint64_t lanes = 0;       ///< SIMD lanes of all processed packets, both active and inactive

  void add(const VolumeCounts& o) {
    steps += o.steps;
    collisions += o.collisions;
    lanes += o.lanes;
  }
};

/// Counters of one worker, added up at the end of the render.
struct Counts {
  uint64_t samples = 0;  ///< paths started
  uint64_t rays = 0;     ///< camera and bounce rays traced
  uint64_t shadow_rays = 0;
  uint64_t records = 0;       ///< hits shaded
  uint64_t packets = 0;       ///< shading packets run
  uint64_t packet_lanes = 0;  ///< lanes of shading packets, both active and inactive
  VolumeCounts volumes;
  uint64_t walks = 0;       ///< subsurface random walks
  uint64_t walk_steps = 0;  ///< rays traced by subsurface random walks, not included in `rays`
  uint64_t walk_lanes = 0;  ///< lanes of the walks' packets, both active and inactive
  /// Rays, shadow rays and records at each depth. Depth 0 counts camera rays and their hits.
  std::array<uint64_t, kCountedDepths> rays_at{}, shadow_rays_at{}, records_at{};

  static uint32_t bucket(uint32_t depth) {
    return depth < kCountedDepths ? depth : kCountedDepths - 1;
  }
  void add_rays(uint32_t depth, uint64_t n) {
    rays += n;
    rays_at[bucket(depth)] += n;
  }
  void add_shadow_rays(uint32_t depth, uint64_t n) {
    shadow_rays += n;
    shadow_rays_at[bucket(depth)] += n;
  }
  void add_records(uint32_t depth, uint64_t n) {
    records += n;
    records_at[bucket(depth)] += n;
  }

  void add(const Counts& o) {
    samples += o.samples;
    rays += o.rays;
    shadow_rays += o.shadow_rays;
    records += o.records;
    packets += o.packets;
    packet_lanes += o.packet_lanes;
    volumes.add(o.volumes);
    walks += o.walks;
    walk_steps += o.walk_steps;
    walk_lanes += o.walk_lanes;
    for (size_t d = 0; d < kCountedDepths; ++d) {
      rays_at[d] += o.rays_at[d];
      shadow_rays_at[d] += o.shadow_rays_at[d];
      records_at[d] += o.records_at[d];
    }
  }
};

}  // namespace wavecomb
