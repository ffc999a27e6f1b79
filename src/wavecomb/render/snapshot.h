// SPDX-License-Identifier: Apache-2.0
/// Access to a render that is paused between waves.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "wavecomb/film/aov_film.h"
#include "wavecomb/film/film.h"
#include "wavecomb/render/passes/pass_plan.h"
#include "wavecomb/render/pilots/guiding_training.h"
#include "wavecomb/render/render_status.h"
#include "wavecomb/render/statistics/render_statistics.h"

namespace wavecomb {

/// State of a paused render. A snapshot is valid only during the callback that receives it.
struct Snapshot {
  Film& film;
  const PassState& pass;
  const GuidingTraining& training;  ///< result of the training before the first pass; may be empty
  const std::optional<TransportChoice>&
      transport;  ///< chosen transport, if the settings did not specify it
  RenderStatus status;
  /// Whether no more samples follow, since the render is done, cancelled or out of time.
  bool finished;
  const std::vector<std::string>& light_groups;  ///< light groups that the film keeps
  /// Returns the statistics of the render so far.
  std::function<RenderStatistics()> statistics;

  /// Returns a layer by its name in image files (beauty, depth, error, cost, light_NAME ...), or
  /// nothing if the film does not keep it. Sample counts are in Film::samples.
  std::optional<AovLayer> layer(const std::string& name) const;
};

}  // namespace wavecomb
