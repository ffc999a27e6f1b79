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

/// Samples of light paths at the end of a pass, after `done` of them, where those of pixels go from
/// `before` to `after` and `share` is what that would be of as many light paths as pixels' paths.
///
/// A pass takes |A| (after - before) paths of active pixels' and P for each sample of light paths,
/// P their numbers. Of errors V_c / n + V_l / m the least at a cost has
///   m / n = sqrt(V_l |A| / (V_c P)),
/// with the V over the active pixels, of the halves. `share` is the most, since more of one kind
/// would do best with other weights. What earlier passes have shown decides, so no bias comes of
/// it.
uint32_t light_samples_after(const NoiseParts& noise, uint32_t done, uint32_t before,
                             uint32_t after, uint32_t share, double active_share);

}  // namespace wavecomb
