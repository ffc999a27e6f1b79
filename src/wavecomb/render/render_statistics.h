// SPDX-License-Identifier: Apache-2.0
/// What a render took.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "wavecomb/integrate/statistics.h"
#include "wavecomb/render/allotment.h"
#include "wavecomb/render/guide_training.h"
#include "wavecomb/render/sharing.h"
#include "wavecomb/render/transport_choice.h"
#include "wavecomb/scene/scene.h"
#include "wavecomb/texture/tile_store.h"

namespace wavecomb {

class PassRunner;
class RenderCosts;
struct LightCalibration;
struct WaveContext;

/// What became of one material.
struct MaterialStatistics {
  std::string name, program;
  uint64_t records = 0;  ///< shading hits
  uint64_t timed_records = 0;
  double measured_ns = 0;    ///< per record, over the timed ones; 0 where none was timed
  double calibrated_ns = 0;  ///< before the first pass
  double predicted_ns = 0;   ///< by the costs that the next pass would be scheduled by
};

/// The share that a part of the lights had of the choice of a light.
struct LightShare {
  std::string name;
  double share, by_power;
};

/// What the calibration of lights took and found.
struct LightShares {
  double seconds = 0;
  uint32_t paths = 0;         ///< 0: there was nothing to calibrate
  bool kept = false;          ///< from the render before
  uint32_t tilted_nodes = 0;  ///< of the light tree
  std::vector<LightShare> parts;
};

/// How paths from lights were aimed.
struct AimStatistics {
  uint32_t targets = 0;  ///< spheres; 0: nowhere
  uint64_t paths = 0;    ///< that taught; 0: none were asked to
  double seconds = 0;
};

/// What a render took. Phase times are sums over workers.
struct RenderStatistics {
  double build_s = 0, render_s = 0;
  double first_samples_s = 0;  ///< of render_s, until the first wave was done
  std::vector<std::pair<std::string, double>> phases_s;
  uint64_t samples = 0, rays = 0, shadow_rays = 0, records = 0;
  uint64_t packets = 0, packet_lanes = 0;
  VolumeCounts volume_counts;
  uint64_t walks = 0, walk_steps = 0, walk_lanes = 0;  ///< of Counts
  uint32_t threads = 0, wave_size = 0, lanes = 0;
  uint32_t passes = 0;  ///< begun
  Sharing sharing;
  uint64_t resumed_samples = 0;  ///< that a checkpoint brought; not in `samples`
  double error = 0;              ///< mean relative error of the picture; infinite: not known
  SceneBytes scene_bytes;
  uint64_t accelerator_bytes = 0, wave_bytes = 0, film_bytes = 0, peak_rss_bytes = 0;
  bool cancelled = false;  ///< by whoever watched; not by a time limit
  // Per depth; the last entry holds all deeper ones.
  std::vector<uint64_t> rays_at, shadow_rays_at, records_at;
  double run_length = 0, material_homogeneity = 0, texture_homogeneity = 0;
  std::vector<MaterialStatistics> materials;
  double cost_r2 = 0, cost_mean_error = 0;  ///< of predictions for the last pass that had any
  uint64_t cost_materials = 0;              ///< how many materials that compares; 0: no prediction
  std::vector<std::pair<std::string, uint64_t>> policy_uses;  ///< queues ordered by each policy
  double calibration_s = 0;
  LightShares light_calibration;
  AllotmentFacts allotment;
  GuideStatistics guiding;
  AimStatistics light_aiming;
  std::vector<std::string> lights_without_paths;  ///< where others send some
  std::optional<TransportChoice> transport;       ///< of Transport::kAuto
  std::optional<StoreStatistics> texture_store;   ///< where textures have a limit
};

/// Adds up what the workers counted, by phase, depth, policy and material, into `statistics`.
void add_up(const PassRunner& runner, const WaveContext& context, const Scene& scene,
            const RenderCosts& costs, RenderStatistics& statistics);

/// Of a calibration, for statistics.
LightShares light_shares(const LightCalibration& calibration);

}  // namespace wavecomb
