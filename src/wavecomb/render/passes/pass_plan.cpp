// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/render/passes/pass_plan.h"

#include <algorithm>
#include <bit>
#include <map>
#include <utility>

namespace wavecomb {
namespace {

/// Fraction of the remaining time that a pass may take at the current speed. Passes become shorter
/// and shorter towards the time limit.
constexpr double kPassShare = 0.75;

uint32_t first_check(const PassRules& rules) {
  const uint32_t rounded = (rules.min_spp + kCheckSamples - 1) / kCheckSamples * kCheckSamples;
  return std::min(rules.spp, std::max(rounded, kCheckSamples));
}

uint32_t check_step(uint32_t n) {
  return std::max(kCheckSamples, std::bit_floor(n) / 4);
}

}  // namespace

bool is_check(uint32_t n, const PassRules& rules) {
  const uint32_t first = first_check(rules);
  return n == first || n == rules.spp || (n > first && n % check_step(n) == 0);
}

uint32_t next_check(uint32_t done, const PassRules& rules) {
  const uint32_t first = first_check(rules), step = check_step(done);
  return done < first ? first : std::min(rules.spp, (done / step + 1) * step);
}

uint32_t next_target(uint32_t done, const PassRules& rules, const TimeLeft& left, uint64_t pixels) {
  uint32_t target =
      rules.adaptive ? next_check(done, rules) : std::min(rules.spp, done + rules.step);
  if (done < rules.pilot) target = std::min(target, rules.pilot);
  if (!rules.timed && !rules.progressive) return target;
  uint32_t samples = std::min(target - done, done == 0 ? 1u : std::bit_floor(done));
  if (!rules.timed) return done + samples;
  const double affordable = kPassShare * left.seconds * left.samples_per_s /
                            static_cast<double>(std::max<uint64_t>(1, pixels));
  if (affordable < samples)
    samples = std::bit_floor(std::max(1u, static_cast<uint32_t>(std::max(0.0, affordable))));
  return done + samples;
}

uint64_t PassPlan::samples() const {
  uint64_t n = 0;
  for (const PassBatch& b : batches) n += uint64_t{b.samples} * (b.end - b.begin);
  return n;
}

PassPlan plan_pass(std::span<const uint32_t> order, const Region& window,
                   std::span<const uint32_t> samples, const PassState& pass) {
  using FromTo = std::pair<uint32_t, uint32_t>;
  std::map<FromTo, std::vector<uint32_t>> by_count;
  for (const uint32_t pixel : order) {
    const size_t i = window.index(pixel & 0xffffu, pixel >> 16);
    const uint32_t target = pass.allocation.at(i, pass.target);
    if (pass.is_active(i) && samples[i] < target) by_count[{samples[i], target}].push_back(pixel);
  }
  PassPlan plan;
  for (const auto& [counts, pixels] : by_count) {
    const auto [from, to] = counts;
    const size_t begin = plan.pixels.size();
    plan.pixels.insert(plan.pixels.end(), pixels.begin(), pixels.end());
    plan.batches.push_back({begin, plan.pixels.size(), from, to - from});
  }
  return plan;
}

}  // namespace wavecomb
