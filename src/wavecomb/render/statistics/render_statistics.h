// SPDX-License-Identifier: Apache-2.0
/// Statistics of a render.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "wavecomb/light_paths/render/transport_choice.h"
#include "wavecomb/path/statistics.h"
#include "wavecomb/render/passes/allotment.h"
#include "wavecomb/render/pilots/guiding_training.h"
#include "wavecomb/render/statistics/work_distribution.h"
#include "wavecomb/scene/scene.h"
#include "wavecomb/texture/tile_store.h"

namespace wavecomb {

class PassRunner;
class RenderCosts;
struct LightCalibration;
struct WaveContext;

/// Statistics of one material.
struct MaterialStatistics {
  std::string name, program;
  uint64_t records = 0;  ///< shading records
  uint64_t timed_records = 0;
  double measured_ns = 0;    ///< mean of the timed records; 0 if none was timed
  double calibrated_ns = 0;  ///< cost before the first pass
  double predicted_ns = 0;   ///< cost that would determine scheduling in the next pass
};

/// Selection probability of a light or a group of lights in the render, and the probability if
/// lights were selected by power alone.
struct LightShare {
  std::string name;
  double share, by_power;
};

/// Statistics of the light calibration.
struct LightShares {
  double seconds = 0;
  uint32_t paths = 0;         ///< number of calibration paths; 0 if there was nothing to calibrate
  bool kept = false;          ///< whether the calibration was taken over from an earlier render
  uint32_t tilted_nodes = 0;  ///< number of light tree nodes with changed selection odds
  std::vector<LightShare> parts;
};

/// Statistics of the aiming of light paths.
struct AimStatistics {
  uint32_t targets =
      0;  ///< number of spheres that light paths are aimed at; 0 if paths are not aimed
  uint64_t paths = 0;  ///< training paths; 0 if aiming was not trained
  double seconds = 0;
};

/// Statistics of a render. Phase times are sums over workers.
struct RenderStatistics {
  double build_s = 0, render_s = 0;
  double first_samples_s =
      0;  ///< time from the start of rendering until the first wave was done; included in render_s
  std::vector<std::pair<std::string, double>> phases_s;
  uint64_t samples = 0, rays = 0, shadow_rays = 0, records = 0;
  uint64_t packets = 0, packet_lanes = 0;
  VolumeCounts volume_counts;
  uint64_t walks = 0, walk_steps = 0, walk_lanes = 0;  ///< subsurface random walks; see Counts
  uint32_t threads = 0, wave_size = 0, lanes = 0;
  uint32_t passes = 0;  ///< begun
  WorkDistribution sharing;
  uint64_t resumed_samples = 0;  ///< samples from a checkpoint, which are not included in `samples`
  double error = 0;              ///< mean relative error of the image; infinite if unknown
  SceneBytes scene_bytes;
  uint64_t accelerator_bytes = 0, wave_bytes = 0, film_bytes = 0, peak_rss_bytes = 0;
  /// Whether the caller stopped the render; false if a time limit ended it.
  bool cancelled = false;
  // Counts by path depth; the last entry includes all deeper vertices.
  std::vector<uint64_t> rays_at, shadow_rays_at, records_at;
  double run_length = 0, material_homogeneity = 0, texture_homogeneity = 0;
  std::vector<MaterialStatistics> materials;
  double cost_r2 = 0,
         cost_mean_error =
             0;  ///< accuracy of cost predictions, in the last pass that had predictions
  uint64_t cost_materials = 0;  ///< number of materials with both a prediction and a measurement
  /// Number of queues that each policy ordered.
  std::vector<std::pair<std::string, uint64_t>> policy_uses;
  double calibration_s = 0;
  LightShares light_calibration;
  AllocationStatistics allotment;
  GuidingStatistics guiding;
  AimStatistics light_aiming;
  /// Names of lights that emit no light paths; empty in renders without light paths.
  std::vector<std::string> lights_without_paths;
  std::optional<TransportChoice> transport;      ///< for Transport::kAuto
  std::optional<StoreStatistics> texture_store;  ///< set if texture memory has a limit
};

/// Adds up the counters of the workers, by phase, depth, policy and material, into `statistics`.
void add_up(const PassRunner& runner, const WaveContext& context, const Scene& scene,
            const RenderCosts& costs, RenderStatistics& statistics);

/// Returns the statistics of a light calibration.
LightShares light_shares(const LightCalibration& calibration);

}  // namespace wavecomb
