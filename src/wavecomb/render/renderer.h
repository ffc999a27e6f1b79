// SPDX-License-Identifier: Apache-2.0
/// Renders a scene: passes of waves, progress, cancellation, statistics.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "wavecomb/core/settings.h"
#include "wavecomb/film/aov_film.h"
#include "wavecomb/integrate/ray_recorder.h"
#include "wavecomb/scene/scene.h"
#include "wavecomb/schedule/policy.h"

namespace wavecomb {

/// Names of the ids of one Cryptomatte level that a picture holds.
struct CryptoManifest {
  std::string level;  ///< name of the AOV
  std::vector<std::pair<std::string, uint32_t>> names;
};

/// A picture: means over the samples, row 0 at the top. What was not asked for is empty.
struct Picture {
  uint32_t width = 0, height = 0;
  std::vector<float> beauty;  ///< rgb, linear Rec.709
  std::vector<float> albedo;  ///< rgb
  std::vector<float> normal;  ///< xyz, world space, mean of unit vectors
  std::vector<float> depth;   ///< along the camera's axis; infinite where nothing was hit
  std::vector<uint32_t> samples;
  std::vector<AovLayer> aovs;  ///< further layers that Settings::aovs asks for
  std::vector<CryptoManifest> manifests;
};

/// What became of one material.
struct MaterialStatistics {
  std::string name, program;
  uint64_t records = 0;  ///< shading hits
  uint64_t timed_records = 0;
  double measured_ns = 0;    ///< per record, over the timed ones; 0 where none was timed
  double calibrated_ns = 0;  ///< before the first pass
  double predicted_ns = 0;   ///< by the costs that the next pass would be scheduled by
};

/// What a render took. Phase times are sums over workers.
struct RenderStatistics {
  double build_s = 0, render_s = 0;
  double first_samples_s = 0;  ///< of render_s, until the first wave was done
  std::vector<std::pair<std::string, double>> phases_s;
  uint64_t samples = 0, rays = 0, shadow_rays = 0, records = 0;
  uint64_t packets = 0, packet_lanes = 0;
  uint32_t threads = 0, wave_size = 0, lanes = 0;
  SceneBytes scene_bytes;
  uint64_t accelerator_bytes = 0, wave_bytes = 0, film_bytes = 0, peak_rss_bytes = 0;
  bool cancelled = false;
  // Per depth; the last entry holds all deeper ones.
  std::vector<uint64_t> rays_at, shadow_rays_at, records_at;
  double run_length = 0, material_homogeneity = 0, texture_homogeneity = 0;
  std::vector<MaterialStatistics> materials;
  double cost_r2 = 0, cost_mean_error = 0;  ///< of predictions for the last pass that had any
  uint64_t cost_materials = 0;              ///< how many materials that compares; 0: no prediction
  std::vector<std::pair<std::string, uint64_t>> policy_uses;  ///< queues ordered by each policy
  double calibration_s = 0;
};

/// Costs by name of material and of texture, nanoseconds a record: a profile that a later render of
/// the same stage can start from.
struct CostProfile {
  std::vector<std::pair<std::string, float>> materials, textures;
};

/// Called now and then on the thread that called render(): samples done, samples in all. False
/// stops.
using ProgressCallback = std::function<bool(uint64_t done, uint64_t total)>;

/// A scene ready to be rendered: its acceleration structure is built here, once.
///
/// Contract: render() may be called any number of times, one at a time.
class WavefrontRenderer {
 public:
  /// `threads`: for building; 0: all.
  explicit WavefrontRenderer(std::shared_ptr<const Scene> scene, uint32_t threads = 0);
  ~WavefrontRenderer();

  /// Renders with `settings`. The picture depends on the scene and the picture's settings only, not
  /// on threads, wave size, lanes or policy. Throws Error for settings that cannot be. `policy`
  /// replaces the one that the settings name. `profile` gives the costs to start from, for the
  /// order and for roulette; without one they are measured on synthetic hits or modelled.
  /// `recorder` gets the rays of the wavefront integrator; what it throws ends the render.
  Picture render(const Settings& settings, const ProgressCallback& progress = {},
                 const SchedulingPolicy* policy = nullptr, const CostProfile* profile = nullptr,
                 RayRecorder* recorder = nullptr);
  /// Costs after the last render().
  CostProfile cost_profile() const;
  /// Of the last render().
  const RenderStatistics& statistics() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// Lane widths that this build has kernels for, ascending.
std::vector<uint32_t> lane_widths();
/// The -march that this library is compiled with: "native", "x86-64-v3" ...; "default" without one.
const char* library_name();
/// The most memory this process has held, bytes.
uint64_t peak_rss_bytes();
/// Returns freed memory to the system where the C library keeps it (glibc): call after loading.
void give_back_memory();

}  // namespace wavecomb
