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
#include "wavecomb/scene/scene.h"

namespace wavecomb {

/// A picture: means over the samples, row 0 at the top.
struct Picture {
  uint32_t width = 0, height = 0;
  std::vector<float> beauty;   ///< rgb, linear Rec.709
  std::vector<float> albedo;   ///< rgb
  std::vector<float> normal;   ///< xyz, world space, mean of unit vectors
  std::vector<float> depth;    ///< along the camera's axis; infinite where nothing was hit
  std::vector<uint32_t> samples;
};

/// What a render took. Phase times are sums over workers.
struct RenderStatistics {
  double build_s = 0, render_s = 0;
  std::vector<std::pair<std::string, double>> phases_s;
  uint64_t samples = 0, rays = 0, shadow_rays = 0, records = 0;
  uint64_t packets = 0, packet_lanes = 0;
  uint32_t threads = 0, wave_size = 0, lanes = 0;
  uint64_t accelerator_bytes = 0, wave_bytes = 0, peak_rss_bytes = 0;
  bool cancelled = false;
};

/// Called now and then on the thread that called render(): samples done, samples in all. False stops.
using ProgressCallback = std::function<bool(uint64_t done, uint64_t total)>;

/// A scene ready to be rendered: its acceleration structure is built here, once.
///
/// Contract: render() may be called any number of times, one at a time.
class WavefrontRenderer {
 public:
  /// `threads`: for building; 0: all.
  explicit WavefrontRenderer(std::shared_ptr<const Scene> scene, uint32_t threads = 0);
  ~WavefrontRenderer();

  /// Renders with `settings`. The picture depends on the scene and the picture's settings only, not on
  /// threads, wave size, lanes or policy. Throws Error for settings that cannot be.
  Picture render(const Settings& settings, const ProgressCallback& progress = {});
  /// Of the last render().
  const RenderStatistics& statistics() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// Lane widths that this build has kernels for, ascending.
std::vector<uint32_t> lane_widths();
/// The most memory this process has held, bytes.
uint64_t peak_rss_bytes();

}  // namespace wavecomb
