// SPDX-License-Identifier: Apache-2.0
/// Planning of a pass: its pixels, and the first sample and the number of samples of each pixel.
/// Plans are pure functions of the film's sample counts, the settings and, if there is a time
/// limit, the time left.
#pragma once

#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "wavecomb/core/settings.h"

namespace wavecomb {

/// Adaptive renders check errors at sample counts that are multiples of this number. This many
/// samples fill two blocks of each half buffer (ErrorSums), and form a net of the Sobol sequence.
inline constexpr uint32_t kCheckSamples = 16;

/// Target sample counts of pixels, which may differ between pixels (render/passes/allotment.h).
struct SampleAllocation {
  /// Samples per pixel of the pilot render; 0 if all pixels get the same number.
  uint32_t pilot = 0;
  uint32_t spp = 0;  ///< mean sample count per pixel at the end
  /// Sample count of each pixel at the end; empty until the pilot render is done.
  std::vector<uint32_t> counts;

  /// Returns the sample count of a pixel when the mean sample count is `target`.
  uint32_t at(size_t pixel, uint32_t target) const {
    if (counts.empty() || target <= pilot) return target;
    const uint64_t more = counts[pixel] - pilot;
    return pilot + static_cast<uint32_t>(more * (target - pilot) / (spp - pilot));
  }
};

/// State of a pass. A checkpoint stores this state with the film.
struct PassState {
  /// Sample count of each active pixel after the pass, or the mean if the counts differ.
  uint32_t target = 0;
  uint32_t light_target = 0;  ///< number of samples of light paths after the pass
  /// 1 for each active pixel, else 0, row by row; empty if all pixels are active.
  std::vector<uint8_t> active{};
  SampleAllocation allocation{};

  bool is_active(size_t pixel) const { return active.empty() || active[pixel] != 0; }
};

/// Settings that determine passes.
struct PassRules {
  uint32_t spp = 1;      ///< maximum number of samples per pixel
  uint32_t min_spp = 0;  ///< number of samples before the first error check of an adaptive render
  bool adaptive = false;
  bool timed = false;  ///< whether the render has a time limit
  uint32_t step = 16;  ///< samples that a pass adds if the render is not adaptive
  /// Whether sample counts double from pass to pass, starting with one sample.
  bool progressive = false;
  /// Sample count at which the pilot render ends; 0 if all pixels get the same number.
  uint32_t pilot = 0;
};

/// Time left until the time limit, and rendering speed so far.
struct TimeLeft {
  double seconds = std::numeric_limits<double>::infinity();
  double samples_per_s = 0;
};

/// Returns whether an adaptive render checks errors when the pixels have `n` samples. The first
/// check is at min_spp, rounded up to a multiple of kCheckSamples, and the last at spp. Near n
/// samples, the distance between two checks is a quarter of the largest power of two below n, but
/// at least kCheckSamples. A pixel therefore gets at most a quarter more samples than it needs, and
/// sample counts are sums of two or three Sobol nets. The checks depend only on n, so wave size and
/// thread count do not change the image.
bool is_check(uint32_t n, const PassRules& rules);

/// Returns the sample count of the first check after `done` samples.
uint32_t next_check(uint32_t done, const PassRules& rules);

/// Returns the sample count at the end of a pass that begins with `done` (< spp) samples in each of
/// `pixels` active pixels. In timed and progressive renders, the passes end at 1, 2, 4, 8, ...
/// samples. Near the time limit, passes shrink by powers of two. The last pass, which the limit may
/// interrupt, is therefore short.
uint32_t next_target(uint32_t done, const PassRules& rules, const TimeLeft& left, uint64_t pixels);

/// Batch of a plan: the pixels [begin, end) have the samples [0, first_sample) and get `samples`
/// further samples.
struct PassBatch {
  size_t begin, end;
  uint32_t first_sample, samples;
};

struct PassPlan {
  std::vector<uint32_t> pixels;  ///< x | y << 16, in Morton order within a batch
  std::vector<PassBatch> batches;
  uint64_t samples() const;
};

/// Plans the remaining work of a pass. The plan contains all active pixels below their target,
/// grouped by sample count and target. Pixels with the fewest samples come first.
///
/// `order` holds the rendered pixels (x | y << 16), `window` the pixels of the film, and `samples`
/// the sample count of each film pixel, row by row. Returns no batches if the pass is done.
PassPlan plan_pass(std::span<const uint32_t> order, const Region& window,
                   std::span<const uint32_t> samples, const PassState& pass);

}  // namespace wavecomb
