// SPDX-License-Identifier: Apache-2.0
/// What a render has learned that bears on a place: where light comes from as bounces are guided
/// there, and which lights are chosen there. For those who want to look at it; kernels read the
/// same tables.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "wavecomb/core/vec3.h"
#include "wavecomb/render/guide_training.h"
#include "wavecomb/render/light_calibration.h"
#include "wavecomb/scene/scene.h"

namespace wavecomb {

/// What a render learned before its first pass. Nothing of it changes any more.
struct Learned {
  std::shared_ptr<const Scene> scene;              ///< that was rendered
  bool by_tree = false;                            ///< LightView::by_tree
  std::shared_ptr<const LightCalibration> lights;  ///< null: shares are those of power
  std::shared_ptr<const GuideTraining> training;   ///< with or without a field
};

/// A surface, as a path meets it.
struct SeenPlace {
  Vec3<float> p, n;       ///< n: unit, on the side that it is seen from
  uint32_t material = 0;  ///< of the scene
};

/// What was learned of a place.
struct LearnedPlace {
  /// Which way the surface faces, of kGuideAxes; whether the field has a region there.
  uint32_t axis = 0;
  bool known = false;
  /// With a region: density of directions per steradian, rows of kGuideSide x kGuideSide bins of
  /// the square (learn/directions.h).
  std::vector<float> density;
  float guided_share = 0;  ///< of bounces, by region and material
  /// Probability with which roulette lets a path go on that would bring the brightness of the
  /// picture with a throughput of 1; 0: not known.
  float survival = 0;
  /// Names of lights and emissive meshes with the probability of their choice there, largest
  /// first; those of 0 are left out. Empty where there is no light, or where there are more than
  /// kMostWeighed.
  std::vector<std::pair<std::string, float>> light_shares;
};

/// Choices of lights that the shares of LearnedPlace are counted in.
inline constexpr uint32_t kCountedChoices = 4096;

/// Looks `place` up.
LearnedPlace look_up(const Learned& learned, const SeenPlace& place);

}  // namespace wavecomb
