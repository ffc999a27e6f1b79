// SPDX-License-Identifier: Apache-2.0
/// The scalar integrator: one path after the other, depth first, without queues. It gives the same
/// bits as the waves do, and is what they are held to.
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "wavecomb/integrate/wave.h"

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

/// What came of choosing a light for a vertex.
struct LightProbe {
  uint32_t light;  ///< kNoLight: the tree found none
  /// Luminance that its sample brought the path, where nothing was in the way, and its MIS weight.
  float value, weight;
  float at[3];  ///< LightReceiver
  uint32_t normal;
};

/// Choices of a light along paths, at most `most` a path.
struct LightProbes {
  LightProbes(size_t paths, uint32_t most_)
      : most(most_), probes(paths * most_), counts(paths, 0), luminance(paths, 0.f) {}

  uint32_t most;
  std::vector<LightProbe> probes;  ///< of path i from i * most on
  std::vector<uint32_t> counts;
  std::vector<float> luminance;  ///< that a path brought
};

/// Traces paths `first` to `first + count` - 1: path i is sample i of pixel pixels[i].
void run_light_probes(const WaveContext& context, std::span<const uint32_t> pixels, size_t first,
                      size_t count, LightProbes& out);

}  // namespace wavecomb
