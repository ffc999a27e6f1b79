// SPDX-License-Identifier: Apache-2.0
/// Which pixels of an adaptive render go on.
#pragma once

#include <cstdint>
#include <vector>

#include "wavecomb/core/settings.h"
#include "wavecomb/film/error_map.h"
#include "wavecomb/render/pass_plan.h"

namespace wavecomb {

/// Pixels to each side that go on with one whose error is too large.
inline constexpr uint32_t kDilation = 2;

/// The error that a pixel may have: the setting, or what a picture of this light and of the mean
/// relative error that is asked for would have everywhere, were its noise spread evenly. Where no
/// pixel is above that and the picture still is (few bright pixels in the dark have most of the
/// error, which their windows spread over many): half of the largest error, so that it goes on.
double error_threshold(const ErrorMap& map, const Settings& settings);

/// What a look at the errors says.
struct AdaptiveCheck {
  std::vector<uint8_t> active;  ///< by pixel; none: the render is done
  uint64_t active_count = 0;
  /// Samples that the picture will take in all, if errors fall with the square root of samples.
  uint64_t expected_samples = 0;
};

/// Looks at the pixels of settings.rendered() only, of a film of `window`. Active are those above
/// the threshold, and those around them, that have less than the most samples. With a noise target
/// none is once the mean relative error is within it. A pixel that was done goes on again when
/// noise comes up beside it.
AdaptiveCheck check_adaptive(const ErrorMap& map, const Region& window,
                             std::span<const uint32_t> samples, const Settings& settings,
                             const PassRules& rules);

}  // namespace wavecomb
