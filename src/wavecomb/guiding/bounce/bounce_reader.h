// SPDX-License-Identifier: Apache-2.0
/// Collects training samples for path guiding. The samples are in the order of the paths,
/// independently of which worker traced a path.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "wavecomb/aov/path_aovs.h"
#include "wavecomb/guiding/field/field.h"
#include "wavecomb/guiding/image_tiles.h"
#include "wavecomb/path/path_history.h"
#include "wavecomb/schedule/cost_snapshot.h"

namespace wavecomb {

/// Training samples, in path order.
struct TrainingSamples {
  std::vector<TrainingRecord> records;  ///< bounces of all rounds that contributed light
  std::vector<BounceSample> bounces;    ///< all bounces of the last training round
  // `luminances` and `paths` have one element for each path of the last training round.
  std::vector<float> luminances;
  std::vector<PathStatistics> paths;
};

/// Cost model in units of one ray traced through a BVH.
struct PathCosts {
  double ray = 1;                         ///< cost of a bounce ray or a shadow ray
  double lookup = 0;                      ///< cost of a guiding field lookup at a vertex
  const CostSnapshot* shading = nullptr;  ///< costs of materials

  /// Returns the cost of a path vertex: its shading, its guiding field lookup and the shadow ray of
  /// its light sample.
  double vertex(uint32_t material) const {
    return ray + lookup + double{shading->material(material) / kModelRayNs};
  }
};

/// Parameters of a training round.
struct TrainingPlan {
  uint32_t first, samples;  ///< first sample index and number of samples of each pixel
  uint32_t max_depth;
  const GuidingGrid& grid;
  GuidingView guide;        ///< guiding field that samples the bounces; empty if bounces are not
                            ///< guided
  const ImageTiles* tiles;  ///< brightness of the image by tile; null if unknown
  PathCosts costs;
  uint32_t roulette_depth;
};

/// Converts finished paths to training samples.
///
/// Contract: workers may call ended() concurrently for different paths.
class BounceReader final : public HistoryReader {
 public:
  /// Maximum number of vertices of a path that become training samples.
  static constexpr uint32_t kVertices = 6;

  /// `pixels` and `plan` must outlive the reader.
  BounceReader(std::span<const uint32_t> pixels, const TrainingPlan& plan);

  uint32_t most() const override { return kVertices; }
  void ended(const PathHistory& history, const float* radiance, const WaveTask& task) override;
  /// Appends all training samples to `training_samples`, in path order.
  void append_to(TrainingSamples& training_samples) const;

 private:
  /// Adds the training samples of the path in `slot`. The path has index `path` and the final
  /// radiance `end`. `inverse_scale` is one over the brightness of the image at the path's pixel.
  void read(const PathHistory& history, uint32_t slot, const Color<float>& end, size_t path,
            float inverse_scale);
  void add_record(size_t path, const HistoryRow<float>& v, const GuidingLookup<float>& guiding,
                  float inverse_distance, float value, float weight);

  std::span<const uint32_t> pixels_;
  const TrainingPlan& plan_;
  std::vector<TrainingRecord> records_;  ///< room for `kVertices` records per path
  std::vector<BounceSample> bounces_;    ///< room for `kVertices` samples per path
  std::vector<uint8_t> record_counts_, bounce_counts_;
  std::vector<float> luminance_;
  std::vector<PathStatistics> paths_;
};

}  // namespace wavecomb
