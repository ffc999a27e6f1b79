// SPDX-License-Identifier: Apache-2.0
/// Scalar reference integrator: traces one path after the other, depth first and without queues.
/// The image of the wavefront integrator must match its image bit for bit.
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "wavecomb/wave/wave.h"

namespace wavecomb {

struct ReferenceWorker;

class ReferenceIntegrator final : public Integrator {
 public:
  ReferenceIntegrator(const WaveContext& context, uint32_t threads);
  ~ReferenceIntegrator() override;

  void run(size_t worker, const WaveTask& task) override;
  WorkerView worker(size_t i) const override;
  uint32_t lanes() const override { return 1; }

 private:
  const WaveContext& context_;
  std::vector<std::unique_ptr<ReferenceWorker>> workers_;
};

/// Result of sampling a light at a vertex.
struct LightProbe {
  uint32_t light;  ///< kNoLight if the light tree selected none
  /// `value` is the luminance of the light sample's contribution, or 0 if the shadow ray was
  /// blocked. `weight` is the MIS weight of the light sample.
  float value, weight;
  float at[3];  ///< position of the LightReceiver
  uint32_t normal;
};

/// Light samples of paths, with at most `most` samples for each path.
struct LightProbes {
  LightProbes(size_t paths, uint32_t most_)
      : most(most_), probes(paths * most_), counts(paths, 0), luminance(paths, 0.f) {}

  uint32_t most;
  std::vector<LightProbe> probes;  ///< the samples of path i start at i * most
  std::vector<uint32_t> counts;
  std::vector<float> luminance;  ///< luminance of each path's radiance
};

/// Traces paths `first` to `first + count` - 1. Path i is sample i of pixel pixels[i].
void run_light_probes(const WaveContext& context, std::span<const uint32_t> pixels, size_t first,
                      size_t count, LightProbes& out);

}  // namespace wavecomb
