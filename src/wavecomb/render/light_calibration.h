// SPDX-License-Identifier: Apache-2.0
/// Finds out, before the first pass, what each light brings to the picture.
///
/// Paths of the whole picture's camera choose lights with other shares than the picture will. What
/// light samples bring with their MIS weight, so beside what bounces find anyway, over the scale of
/// the picture around, decides over the shares (render/light_balance.h). Nothing of it depends on
/// seed, sampler, samples, region, threads, waves or lanes; so parts of a picture, a resumed one
/// and merged ones have the same shares.
#pragma once

#include <functional>
#include <memory>

#include "wavecomb/accel/embree_accelerator.h"
#include "wavecomb/core/settings.h"
#include "wavecomb/render/light_parts.h"

namespace wavecomb {

/// Lights weighed for one camera, and how that came about.
struct LightCalibration {
  LightParts parts;       ///< none: there was nothing to share out
  WeighedLights weighed;  ///< for the picture
  uint32_t paths = 0;
  uint32_t tilted_nodes = 0;  ///< of the light tree
  double seconds = 0;
  bool kept = false;  ///< of an earlier render of the same
};

/// Calibrates the lights of `scene` for `settings`, of which the size of the whole picture, the
/// filter, max_depth and what changes materials' responses count. On the threads of the caller's
/// arena. `stopped`: give up; what comes back is then of no use.
LightCalibration calibrate_lights(const Scene& scene, const EmbreeAccelerator& accel,
                                  const SceneView& view, const Settings& settings,
                                  const std::function<bool()>& stopped);

/// The last calibration, for renders of the same scene with the same settings.
///
/// Contract: one thread at a time.
class LightCalibrationCache {
 public:
  /// calibrate_lights(), or what it gave before.
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
