// SPDX-License-Identifier: Apache-2.0
/// Cost of each path for the cost AOV. Costs are measured times or come from a model
/// (docs/aovs.md).
#pragma once

#include <chrono>

#include "wavecomb/aov/rows.h"
#include "wavecomb/path/phase_clock.h"

namespace wavecomb {

/// Modelled cost of a ray in nanoseconds. The value is close to the time that tracing a ray takes
/// in a scene of a million triangles.
inline constexpr float kModelRayNs = 250;

/// Array with the cost of each path, for the cost AOV.
///
/// Contract: the class is used only as a base class of `PathAovs`. Path slots must be below the
/// capacity, which is 0 if the render has no cost AOV.
class PathCostRows {
 public:
  PathCostRows() = default;
  PathCostRows(size_t capacity, bool models)
      : cost_ns_(capacity > 0 ? SlotRows(capacity, 1) : SlotRows()), models_(models) {}

  bool wants_cost() const { return bool(cost_ns_); }
  /// Returns whether the cost AOV contains modelled costs instead of measured times.
  bool models_cost() const { return wants_cost() && models_; }
  bool wants_time() const { return wants_cost() && !models_cost(); }
  /// Adds a modelled cost in nanoseconds to a path. The caller adds the costs of a path in the
  /// order of its vertices.
  void add_cost(size_t slot, float ns) const { cost_ns_.rows[slot] += ns; }
  /// Adds the modelled cost of a ray to each path in the slots `slot(0)` to `slot(n - 1)`. Does
  /// nothing if costs are measured.
  template <typename Slot>
  void charge_rays(size_t n, const Slot& slot) const {
    for (size_t i = 0; models_cost() && i < n; ++i) add_cost(slot(i), kModelRayNs);
  }
  PhaseClock::Clock::time_point start_time() const {
    return wants_time() ? PhaseClock::Clock::now() : PhaseClock::Clock::time_point();
  }
  /// Distributes the time since `start` equally over the paths in the slots `slot(0)` to `slot(n -
  /// 1)`. Does nothing if costs are modelled.
  template <typename Slot>
  void spread_time(size_t n, PhaseClock::Clock::time_point start, const Slot& slot) const {
    if (!wants_time() || n == 0) return;
    const double ns =
        std::chrono::duration<double, std::nano>(PhaseClock::Clock::now() - start).count();
    const auto share = static_cast<float>(ns / static_cast<double>(n));
    for (size_t i = 0; i < n; ++i) cost_ns_.rows[slot(i)] += share;
  }

 protected:
  size_t cost_bytes() const { return cost_ns_.bytes(); }
  void clear_costs(size_t slots) const { cost_ns_.zero(slots); }

  SlotRows cost_ns_;  ///< cost in nanoseconds of each path slot

 private:
  bool models_ = false;
};

}  // namespace wavecomb
