// SPDX-License-Identifier: Apache-2.0
/// Lookup of learned data at a surface point: the guiding distribution and the selection
/// probabilities of lights. The functions read the same tables as the rendering kernels.
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

/// Results of the pilot renders of a render. The results do not change during the passes of the
/// render.
struct Learned {
  std::shared_ptr<const Scene> scene;              ///< the rendered scene
  bool by_tree = false;                            ///< LightView::by_tree
  std::shared_ptr<const LightCalibration> lights;  ///< null if lights are selected by power
  std::shared_ptr<const GuidingTraining>
      training;  ///< result of guiding training, with or without a guiding field
  /// Transport that a pilot render chose; empty if the settings specify the transport.
  std::optional<TransportChoice> transport;
};

/// Surface point at which learned data is looked up.
struct LearnedQuery {
  Vec3<float> p, n;       ///< `n` is the unit normal on the viewer's side
  uint32_t material = 0;  ///< index into the scene's materials
};

/// Learned data at a surface point.
struct LearnedData {
  /// `axis` is the one of kGuidingAxes that the surface faces. `known` says whether the guiding
  /// field has a region at the point.
  uint32_t axis = 0;
  bool known = false;
  /// Density per steradian of the guiding distribution, empty unless `known` is set. The values are
  /// kGuidingSide rows of kGuidingSide bins of the square map of directions (guiding/directions.h).
  std::vector<float> density;
  float guided_share = 0;  ///< fraction of bounces that sample the guiding field
  /// Survival probability of learned roulette before clamping (guiding/roulette.h), for a path
  /// whose throughput equals the brightness of the image; 0 if unknown.
  float survival = 0;
  /// Names and selection probabilities of the lights and emissive meshes that can be selected at
  /// the point, the most probable light first. The list is empty if the scene has no lights or more
  /// than kMaxCalibratedLights lights.
  std::vector<std::pair<std::string, float>> light_shares;
};

/// Number of light selections from which the probabilities are counted.
inline constexpr uint32_t kCountedChoices = 4096;

/// Looks up the results of the pilot renders at the surface point `place`.
LearnedData look_up(const Learned& learned, const LearnedQuery& place);

}  // namespace wavecomb
