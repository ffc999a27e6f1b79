// SPDX-License-Identifier: Apache-2.0
/// What is counted while rendering.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

namespace wavecomb {

/// Depths that are counted one by one; deeper ones are added to the last.
inline constexpr uint32_t kCountedDepths = 32;

/// What ways through volumes took.
struct VolumeCounts {
  uint64_t steps = 0;       ///< cells that paths and shadow rays went through, and collisions there
  uint64_t collisions = 0;  ///< of those, collisions with the majorant, real ones and others
  uint64_t lanes = 0;       ///< lanes that took part, busy or not

  void add(const VolumeCounts& o) {
    steps += o.steps;
    collisions += o.collisions;
    lanes += o.lanes;
  }
};

/// Counts of one worker, added up at the end.
struct Counts {
  uint64_t samples = 0;  ///< paths started
  uint64_t rays = 0;     ///< camera and bounce rays traced
  uint64_t shadow_rays = 0;
  uint64_t records = 0;       ///< hits shaded
  uint64_t packets = 0;       ///< shading packets run
  uint64_t packet_lanes = 0;  ///< lanes of those packets, full or not
  VolumeCounts volumes;
  uint64_t walks = 0;       ///< ways below surfaces
  uint64_t walk_steps = 0;  ///< rays traced there, which `rays` does not count
  uint64_t walk_lanes = 0;  ///< lanes that took part, busy or not
  /// Rays, shadow rays and records of each depth (0: camera rays and what they hit).
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
