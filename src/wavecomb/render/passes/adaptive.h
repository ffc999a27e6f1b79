// SPDX-License-Identifier: Apache-2.0
/// Selection of the pixels that an adaptive render continues to sample.
#pragma once

#include <cstdint>
#include <vector>

#include "wavecomb/core/settings.h"
#include "wavecomb/film/error/error_map.h"
#include "wavecomb/render/passes/pass_plan.h"

namespace wavecomb {

/// Width in pixels of the border around noisy pixels, which is also sampled.
inline constexpr uint32_t kDilation = 2;

/// Returns the largest allowed error of a pixel. The value is Settings::adaptive or, with a noise
/// target, the error that each pixel would have if the mean relative error Settings::noise were
/// spread evenly over the image. A few bright pixels in a dark image can hold most of the error. If
/// the image exceeds its noise target although no pixel exceeds the value, returns half of the
/// largest error, so that the render continues.
double error_threshold(const ErrorMap& map, const Settings& settings);

/// Result of the error check of an adaptive render.
struct AdaptiveCheck {
  /// For each pixel: 1 if the pixel needs more samples; all 0 if the render is done.
  std::vector<uint8_t> active;
  uint64_t active_count = 0;
  /// Expected number of samples of the finished image, if errors fall with the square root of the
  /// sample count.
  uint64_t expected_samples = 0;
};

/// Checks the pixels of settings.rendered() in a film of `window`. A pixel is active if the error
/// of the pixel, or of another pixel within kDilation, is above the threshold, and if the pixel has
/// fewer samples than the settings allow. No pixel is active once the mean relative error is within
/// the noise target. A finished pixel becomes active again if the noise of its surroundings rises.
AdaptiveCheck check_adaptive(const ErrorMap& map, const Region& window,
                             std::span<const uint32_t> samples, const Settings& settings,
                             const PassRules& rules);

}  // namespace wavecomb
