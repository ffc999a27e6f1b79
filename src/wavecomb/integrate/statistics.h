// SPDX-License-Identifier: Apache-2.0
/// What is counted while rendering.
#pragma once

#include <cstdint>

namespace wavecomb {

/// Counts of one worker, added up at the end.
struct Counts {
  uint64_t samples = 0;      ///< paths started
  uint64_t rays = 0;         ///< camera and bounce rays traced
  uint64_t shadow_rays = 0;
  uint64_t records = 0;      ///< hits shaded
  uint64_t packets = 0;      ///< shading packets run
  uint64_t packet_lanes = 0; ///< lanes of those packets, full or not

  void add(const Counts& o) {
    samples += o.samples;
    rays += o.rays;
    shadow_rays += o.shadow_rays;
    records += o.records;
    packets += o.packets;
    packet_lanes += o.packet_lanes;
  }
};

}  // namespace wavecomb
