// SPDX-License-Identifier: Apache-2.0
/// Time that a worker spends in each phase.
#pragma once

#include <array>
#include <chrono>
#include <cstdint>

namespace wavecomb {

enum class Phase : uint8_t {
  kGenerate,
  kOrderRays,
  kTrace,
  kKeys,
  kSort,
  kMaterialize,
  kShade,
  kShadow,
  kResolve,
  kMetrics,  ///< time spent on measuring statistics instead of rendering
};
inline constexpr size_t kPhaseCount = 10;
inline constexpr const char* kPhaseNames[kPhaseCount] = {
    "generate",    "order_rays", "trace",  "keys",    "sort",
    "materialize", "shade",      "shadow", "resolve", "metrics"};

/// Clock that measures the time of each phase. Entering a phase ends the previous phase, so the
/// times of all phases add up to the time between start() and stop(). The clock is read once per
/// batch of work, never per ray.
class PhaseClock {
 public:
  using Clock = std::chrono::steady_clock;

  void start(Phase phase) {
    phase_ = phase;
    last_ = Clock::now();
  }
  void enter(Phase phase) {
    stop();
    phase_ = phase;
  }
  void stop() {
    const Clock::time_point now = Clock::now();
    ns_[static_cast<size_t>(phase_)] +=
        std::chrono::duration_cast<std::chrono::nanoseconds>(now - last_).count();
    last_ = now;
  }
  const std::array<int64_t, kPhaseCount>& ns() const { return ns_; }
  void add(const PhaseClock& other) {
    for (size_t i = 0; i < kPhaseCount; ++i) ns_[i] += other.ns_[i];
  }

 private:
  std::array<int64_t, kPhaseCount> ns_{};
  Clock::time_point last_;
  Phase phase_ = Phase::kGenerate;
};

}  // namespace wavecomb
