// SPDX-License-Identifier: Apache-2.0
/// Selection of the pixels that an adaptive render continues to sample.
#pragma once

#include <cstdint>
#include <vector>

#include "wavecomb/core/settings.h"
#include "wavecomb/film/error/error_map.h"
#include "wavecomb/render/passes/pass_plan.h"

namespace wavecomb {

/// Width in pixels of the border around noisy pixels that is sampled with them.
inline constexpr uint32_t kDilation = 2;

/// Returns the largest allowed error of a pixel: Settings::adaptive, or the error that every pixel
/// would have if the image had the mean relative error Settings::noise, spread evenly. If no pixel
/// exceeds that value but the image still exceeds its noise target (a few bright pixels in the dark
/// can hold most of the error), returns half of the largest error, so that the render continues.
double error_threshold(const ErrorMap& map, const Settings& settings);

/// Result of an error check.
struct AdaptiveCheck {
  std::vector<uint8_t> active;  ///< indexed by pixel; all 0 if the render is done
  uint64_t active_count = 0;
  /// Expected number of samples of the finished image, if errors fall with the square root of the
  /// sample count.
  uint64_t expected_samples = 0;
};

/// Checks the pixels of settings.rendered() in a film of `window`. A pixel is active if it, or a
/// pixel within kDilation of it, is above the threshold and it has fewer than rules.spp samples. No
/// pixel is active once the mean relative error is within the noise target. A finished pixel
/// becomes active again if the noise around it rises.
AdaptiveCheck check_adaptive(const ErrorMap& map, const Region& window,
                             std::span<const uint32_t> samples, const Settings& settings,
                             const PassRules& rules);

}  // namespace wavecomb
