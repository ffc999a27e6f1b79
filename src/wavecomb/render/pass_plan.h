// SPDX-License-Identifier: Apache-2.0
/// What a pass renders: which pixels, from which sample on, how many. Pure functions of what the
/// film holds, of the settings, and of the time left where there is a limit.
#pragma once

#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "wavecomb/core/settings.h"

namespace wavecomb {

/// Adaptive renders look at errors at multiples of this many samples a pixel: two blocks of each
/// half (ErrorSums), and a net of Sobol's sequence.
inline constexpr uint32_t kCheckSamples = 16;

/// Samples that pixels are to have, where they are not all to have the same (render/allotment.h).
struct Allotment {
  uint32_t pilot = 0;            ///< samples that all have first; 0: pixels are alike
  uint32_t spp = 0;              ///< in the mean
  std::vector<uint32_t> counts;  ///< by pixel, at the end; empty until the pilot is done

  /// Samples that a pixel has when the mean is `target`.
  uint32_t at(size_t pixel, uint32_t target) const {
    if (counts.empty() || target <= pilot) return target;
    const uint64_t more = counts[pixel] - pilot;
    return pilot + static_cast<uint32_t>(more * (target - pilot) / (spp - pilot));
  }
};

/// Where a pass stands: what a checkpoint keeps beside the film.
struct PassState {
  uint32_t target = 0;        ///< samples that each pixel of the pass has at its end; or the mean
  uint32_t light_target = 0;  ///< likewise of paths from lights, where there are any
  std::vector<uint8_t> active{};  ///< by pixel, row by row: 1: of the pass. Empty: all are
  Allotment allotment{};

  bool is_active(size_t pixel) const { return active.empty() || active[pixel] != 0; }
};

/// What the settings say of passes.
struct PassRules {
  uint32_t spp = 1;      ///< samples a pixel at most
  uint32_t min_spp = 0;  ///< adaptive: before the first look at errors
  bool adaptive = false;
  bool timed = false;        ///< there is a limit: passes must fit
  uint32_t step = 16;        ///< not adaptive: samples that a pass adds
  bool progressive = false;  ///< passes double from one sample on
  uint32_t pilot = 0;        ///< a pass ends when pixels have so many; 0: they are alike
};

/// Time until the limit, and the speed so far.
struct TimeLeft {
  double seconds = std::numeric_limits<double>::infinity();
  double samples_per_s = 0;
};

/// Whether an adaptive render looks at errors when its pixels have `n` samples: at min_spp, rounded
/// up, then at steps of a quarter of the power of two below, at least kCheckSamples; and at spp.
/// So nobody gets more than a quarter beyond what is needed, and counts are sums of two or three
/// nets. Nothing else decides, so no wave size and no thread count can.
bool is_check(uint32_t n, const PassRules& rules);

/// The first check after `done` samples.
uint32_t next_check(uint32_t done, const PassRules& rules);

/// Samples that pixels have at the end of the pass that begins when they have `done` (< spp);
/// `pixels` are active. Timed and progressive: passes double from one sample on. Timed: they shrink
/// by powers of two as the limit comes near, so that the last one, which the limit cuts, is short.
uint32_t next_target(uint32_t done, const PassRules& rules, const TimeLeft& left, uint64_t pixels);

/// Pixels [begin, end) of a plan; each has samples [0, first_sample) and is to get `samples` more.
struct PassBatch {
  size_t begin, end;
  uint32_t first_sample, samples;
};

struct PassPlan {
  std::vector<uint32_t> pixels;  ///< x | y << 16, in Morton order within a batch
  std::vector<PassBatch> batches;
  uint64_t samples() const;
};

/// What is left of a pass: its pixels below the target, those of one sample count and one target
/// together, fewest samples first.
///
/// Args: `order`: the pixels that are rendered (x | y << 16); `window`: the film's; `samples` each
/// pixel of it has, row by row. Empty batches: the pass is done.
PassPlan plan_pass(std::span<const uint32_t> order, const Region& window,
                   std::span<const uint32_t> samples, const PassState& pass);

}  // namespace wavecomb
