// SPDX-License-Identifier: Apache-2.0
/// Planning of a pass: which pixels it renders, from which sample on, and how many samples. Plans
/// are pure functions of the film's sample counts, the settings and, if there is a time limit, the
/// time left.
#pragma once

#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "wavecomb/core/settings.h"

namespace wavecomb {

/// Adaptive renders check errors at multiples of this many samples per pixel: two blocks of each
/// half buffer (ErrorSums), and a net of the Sobol sequence.
inline constexpr uint32_t kCheckSamples = 16;

/// Target samples of each pixel if they differ (render/passes/allotment.h).
struct SampleAllocation {
  uint32_t pilot = 0;            ///< samples of the pilot; 0 if pixels are sampled evenly
  uint32_t spp = 0;              ///< final mean per pixel
  std::vector<uint32_t> counts;  ///< final samples by pixel; empty until the pilot is done

  /// Returns the samples of a pixel when the mean is `target`.
  uint32_t at(size_t pixel, uint32_t target) const {
    if (counts.empty() || target <= pilot) return target;
    const uint64_t more = counts[pixel] - pilot;
    return pilot + static_cast<uint32_t>(more * (target - pilot) / (spp - pilot));
  }
};

/// State of a pass. A checkpoint stores this state with the film.
struct PassState {
  uint32_t target = 0;            ///< samples of each active pixel after the pass, or their mean
  uint32_t light_target = 0;      ///< samples of each light path after the pass
  std::vector<uint8_t> active{};  ///< indexed by pixel, row by row: 1 if active; empty if all are
  SampleAllocation allocation{};

  bool is_active(size_t pixel) const { return active.empty() || active[pixel] != 0; }
};

/// Settings that determine passes.
struct PassRules {
  uint32_t spp = 1;      ///< most samples per pixel
  uint32_t min_spp = 0;  ///< in adaptive renders: samples before the first error check
  bool adaptive = false;
  bool timed = false;        ///< whether the render has a time limit
  uint32_t step = 16;        ///< samples that a pass adds if the render is not adaptive
  bool progressive = false;  ///< whether sample counts double from one sample on
  uint32_t pilot = 0;        ///< sample count at which a pass ends; 0 if pixels are sampled evenly
};

/// Time until the limit, and rendering speed so far.
struct TimeLeft {
  double seconds = std::numeric_limits<double>::infinity();
  double samples_per_s = 0;
};

/// Returns whether an adaptive render checks errors when its pixels have `n` samples. The first
/// check is at min_spp, rounded up to a multiple of kCheckSamples, and the last at spp. Checks at
/// about n samples are a quarter of the largest power of two below n apart, but at least
/// kCheckSamples. A pixel therefore gets at most a quarter more samples than it needs, and sample
/// counts are sums of two or three Sobol nets. The checks depend only on n, so wave size and thread
/// count do not change the image.
bool is_check(uint32_t n, const PassRules& rules);

/// Returns the sample count of the first check after `done` samples.
uint32_t next_check(uint32_t done, const PassRules& rules);

/// Returns the sample count at the end of a pass that begins with `done` (< spp) samples in each of
/// `pixels` active pixels. Timed and progressive renders double the count from one sample on. Near
/// the time limit, passes shrink by powers of two, so that the last pass, which the limit cuts
/// short, is a short one.
uint32_t next_target(uint32_t done, const PassRules& rules, const TimeLeft& left, uint64_t pixels);

/// Pixels [begin, end) of a plan, which have the samples [0, first_sample) and get `samples` more.
struct PassBatch {
  size_t begin, end;
  uint32_t first_sample, samples;
};

struct PassPlan {
  std::vector<uint32_t> pixels;  ///< x | y << 16, in Morton order within a batch
  std::vector<PassBatch> batches;
  uint64_t samples() const;
};

/// Plans the remaining work of a pass: its active pixels below their target, grouped by sample
/// count and target, fewest samples first.
///
/// `order` holds the rendered pixels (x | y << 16), `window` the pixels of the film, and `samples`
/// the sample count of each film pixel, row by row. Returns no batches if the pass is done.
PassPlan plan_pass(std::span<const uint32_t> order, const Region& window,
                   std::span<const uint32_t> samples, const PassState& pass);

}  // namespace wavecomb
