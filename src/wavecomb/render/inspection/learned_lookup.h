// SPDX-License-Identifier: Apache-2.0
/// Lookup of learned data at a surface point: the guiding distribution and the selection
/// probabilities of lights. Lookups read the same tables as kernels.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "wavecomb/core/vec3.h"
#include "wavecomb/render/pilots/guiding_training.h"
#include "wavecomb/render/pilots/light_calibration.h"
#include "wavecomb/render/statistics/render_statistics.h"
#include "wavecomb/scene/scene.h"

namespace wavecomb {

/// Data that a render learned before its first pass. These data do not change during the passes.
struct Learned {
  std::shared_ptr<const Scene> scene;              ///< the rendered scene
  bool by_tree = false;                            ///< LightView::by_tree
  std::shared_ptr<const LightCalibration> lights;  ///< null if lights are selected by power
  std::shared_ptr<const GuidingTraining>
      training;  ///< guiding training, possibly without a guiding field
  std::optional<TransportChoice>
      transport;  ///< chosen transport, if the settings did not specify it
};

/// Surface point at which learned data is looked up.
struct LearnedQuery {
  Vec3<float> p, n;       ///< n: unit normal on the viewer's side
  uint32_t material = 0;  ///< index into the scene's materials
};

/// Learned data at a surface point.
struct LearnedData {
  /// Axis that the surface faces (one of kGuidingAxes), and whether the guiding field has a region
  /// at the point.
  uint32_t axis = 0;
  bool known = false;
  /// Density per steradian of the guiding distribution, if `known`: kGuidingSide rows of
  /// kGuidingSide bins of the square map of directions (guiding/directions.h).
  std::vector<float> density;
  float guided_share = 0;  ///< fraction of bounces that sample the guiding field
  /// Survival probability of learned roulette for a throughput equal to the brightness of the
  /// image, before clamping (guiding/roulette.h), or 0 if unknown.
  float survival = 0;
  /// Names of lights and emissive meshes with their selection probability at the point, largest
  /// first, without those of probability 0. The list is empty if there are no lights or more than
  /// kMaxCalibratedLights.
  std::vector<std::pair<std::string, float>> light_shares;
};

/// Number of light selections from which the probabilities are counted.
inline constexpr uint32_t kCountedChoices = 4096;

/// Looks up the learned data at the surface point `place`.
LearnedData look_up(const Learned& learned, const LearnedQuery& place);

}  // namespace wavecomb
