// SPDX-License-Identifier: Apache-2.0
/// Gathers what paths teach the field that guides bounces, each path's in its own place.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "wavecomb/integrate/path_aovs.h"
#include "wavecomb/integrate/path_history.h"
#include "wavecomb/learn/guide_field.h"
#include "wavecomb/render/picture_tiles.h"
#include "wavecomb/schedule/cost_snapshot.h"

namespace wavecomb {

/// What paths have taught, path by path.
struct Lessons {
  std::vector<TrainingRecord> records;  ///< bounces that brought light, of all rounds
  std::vector<BounceLesson> bounces;    ///< all bounces of the last round
  // Of the paths of the last round.
  std::vector<float> luminances;
  std::vector<PathLesson> paths;
};

/// Costs in rays that are traced in a hierarchy.
struct PathCosts {
  double ray = 1;                         ///< of a bounce or of a shadow
  double lookup = 0;                      ///< of the field, at a vertex
  const CostSnapshot* shading = nullptr;  ///< of materials

  /// Of a vertex and its light sample.
  double vertex(uint32_t material) const {
    return ray + lookup + double{shading->material(material) / kModelRayNs};
  }
};

/// What the reader has to know of a round.
struct LessonPlan {
  uint32_t first, samples;  ///< of each pixel
  uint32_t most_depth;
  const GuideGrid& grid;
  GuideView guide;            ///< that bounces were guided by; empty: none
  const PictureTiles* tiles;  ///< null: not known yet
  PathCosts costs;
  uint32_t roulette_depth;
};

/// Contract: all workers call ended() at once, for paths of their own.
class BounceReader final : public HistoryReader {
 public:
  /// Vertices of a path that teach.
  static constexpr uint32_t kVertices = 6;

  /// Paths of `pixels`, as `plan` says, which outlives the reader.
  BounceReader(std::span<const uint32_t> pixels, const LessonPlan& plan);

  uint32_t most() const override { return kVertices; }
  void ended(const PathHistory& history, const float* radiance, const WaveTask& task) override;
  /// Appends what they taught, path by path.
  void append_to(Lessons& lessons) const;

 private:
  /// What the path in `slot` has taught: number `path`, over a pixel of one over `inverse_scale`.
  void read(const PathHistory& history, uint32_t slot, const Color<float>& end, size_t path,
            float inverse_scale);
  void add_record(size_t path, const HistoryRow<float>& v, const GuidePlace<float>& place,
                  float nearness, float value, float weight);

  std::span<const uint32_t> pixels_;
  const LessonPlan& plan_;
  std::vector<TrainingRecord> records_;  ///< kVertices of each path
  std::vector<BounceLesson> bounces_;    ///< kVertices of each path
  std::vector<uint8_t> record_counts_, bounce_counts_;
  std::vector<float> luminance_;
  std::vector<PathLesson> paths_;
};

}  // namespace wavecomb
