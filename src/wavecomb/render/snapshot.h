// SPDX-License-Identifier: Apache-2.0
/// A render that stands still.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "wavecomb/film/aov_film.h"
#include "wavecomb/film/film.h"
#include "wavecomb/render/guide_training.h"
#include "wavecomb/render/pass_plan.h"
#include "wavecomb/render/render_statistics.h"
#include "wavecomb/render/render_status.h"

namespace wavecomb {

/// Valid while the callback that gets it runs.
struct Snapshot {
  Film& film;
  const PassState& pass;
  const GuideTraining& training;  ///< what was learned before the first pass, if anything
  RenderStatus status;
  bool finished;  ///< done, cancelled or out of time: there is no more to come
  const std::vector<std::string>& light_groups;  ///< that the film keeps
  /// What the render took so far.
  std::function<RenderStatistics()> statistics;

  /// A layer by its name in pictures (beauty, depth, error, cost, light_NAME ...), made when it is
  /// asked for; nothing where the film does not keep it. Samples are Film::samples.
  std::optional<AovLayer> layer(const std::string& name) const;
};

}  // namespace wavecomb
