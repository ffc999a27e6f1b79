// SPDX-License-Identifier: Apache-2.0
/// Estimates the contribution of each light to the image before the first pass, and sets the
/// selection probabilities of lights accordingly.
///
/// Camera paths over the whole image select lights with probabilities that are half proportional to
/// power and half uniform. The contributions of the light samples with their MIS weights, relative
/// to the brightness of the image around the pixel, determine the new probabilities
/// (light/calibration/balance.h). The result does not depend on seed, sampler, samples, region,
/// threads, waves or lanes, so that crops, resumed renders and merged renders use the same
/// probabilities. The same paths estimate the brightness of the image, which determines the
/// threshold of Russian roulette for shadow rays.
#pragma once

#include <functional>
#include <memory>

#include "wavecomb/accel/embree_accelerator.h"
#include "wavecomb/core/settings.h"
#include "wavecomb/light/calibration/partition.h"

namespace wavecomb {

/// Lights calibrated for one camera, with statistics.
struct LightCalibration {
  LightParts parts;         ///< empty if there is nothing to calibrate
  CalibratedLights tables;  ///< calibrated probabilities
  /// LightView::shadow_threshold; 0 without Settings::saves_shadow_rays(), or if no path found
  /// light.
  float shadow_threshold = 0;
  uint32_t paths = 0;         ///< number of paths that calibrated the probabilities
  uint32_t tilted_nodes = 0;  ///< number of light tree nodes with changed selection odds
  double seconds = 0;
  bool kept = false;  ///< whether the calibration was taken over from an earlier render

  /// Makes `view` use the results. Contract: after the call, `view` points into this object.
  void apply(LightView& view) const;
};

/// Calibrates the lights of `scene` for the size of the whole image, the filter, max_depth and the
/// settings that change how materials scatter light. Runs on the threads of the caller's arena.
/// Gives up if `stopped` returns true; the result is then invalid.
LightCalibration calibrate_lights(const Scene& scene, const EmbreeAccelerator& accel,
                                  const SceneView& view, const Settings& settings,
                                  const std::function<bool()>& stopped);

/// Cache of the last calibration, reused by renders of the same scene with the same settings.
///
/// Contract: only one thread at a time uses the object.
class LightCalibrationCache {
 public:
  /// Returns the cached calibration, or calls calibrate_lights().
  std::shared_ptr<const LightCalibration> get(const std::shared_ptr<const Scene>& scene,
                                              const EmbreeAccelerator& accel, const SceneView& view,
                                              const Settings& settings,
                                              const std::function<bool()>& stopped);

 private:
  std::weak_ptr<const Scene> scene_;
  Settings settings_;
  std::shared_ptr<const LightCalibration> last_;
};

}  // namespace wavecomb
