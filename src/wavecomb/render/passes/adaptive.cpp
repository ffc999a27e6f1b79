// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/render/passes/adaptive.h"

#include <algorithm>
#include <cmath>

namespace wavecomb {
namespace {

/// Along each line, marks all values whose distance to a marked value is at most kDilation. A line
/// has `length` values, with a stride of `step`.
void dilate_along(std::vector<uint8_t>& marks, size_t lines, size_t line_step, size_t length,
                  size_t step) {
  std::vector<uint8_t> line(length);
  for (size_t l = 0; l < lines; ++l) {
    uint8_t* at = marks.data() + l * line_step;
    for (size_t i = 0; i < length; ++i) line[i] = at[i * step];
    for (size_t i = 0; i < length; ++i) {
      if (line[i] == 0) continue;
      const size_t begin = i < kDilation ? 0 : i - kDilation;
      const size_t end = std::min(length, i + kDilation + 1);
      for (size_t k = begin; k < end; ++k) at[k * step] = 1;
    }
  }
}

}  // namespace

double error_threshold(const ErrorMap& map, const Settings& settings) {
  if (settings.adaptive > 0) return double{settings.adaptive};
  const double even = settings.noise * map.even_error;
  if (map.mean_relative <= settings.noise || map.error.empty()) return even;
  const double worst = *std::max_element(map.error.begin(), map.error.end());
  return worst > even ? even : 0.5 * worst;
}

AdaptiveCheck check_adaptive(const ErrorMap& map, const Region& window,
                             std::span<const uint32_t> samples, const Settings& settings,
                             const PassRules& rules) {
  const size_t count = samples.size(), width = window.width(), height = window.height();
  const Region region = settings.rendered();
  const auto is_rendered = [&](size_t i) {
    return region.contains(window.x0 + static_cast<uint32_t>(i % width),
                           window.y0 + static_cast<uint32_t>(i / width));
  };
  const double threshold = error_threshold(map, settings);
  const bool done = settings.noise > 0 && map.mean_relative <= settings.noise;
  AdaptiveCheck check;
  check.active.resize(count);
  if (!done) {
    for (size_t i = 0; i < count; ++i) check.active[i] = is_rendered(i) && map.error[i] > threshold;
    dilate_along(check.active, height, width, width, 1);
    dilate_along(check.active, width, 1, height, width);
  }
  for (size_t i = 0; i < count; ++i) {
    check.expected_samples += samples[i];
    if (samples[i] >= rules.spp || !is_rendered(i)) check.active[i] = 0;
    if (check.active[i] == 0) continue;
    ++check.active_count;
    const double ratio = threshold > 0 ? map.error[i] / threshold : 2.0;
    const double needed = std::isfinite(ratio) ? ratio * ratio * samples[i] : rules.spp;
    const auto next = static_cast<double>(next_check(samples[i], rules));
    check.expected_samples +=
        static_cast<uint64_t>(std::clamp(needed, next, static_cast<double>(rules.spp))) -
        samples[i];
  }
  return check;
}

}  // namespace wavecomb
