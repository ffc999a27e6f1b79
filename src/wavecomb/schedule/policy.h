// SPDX-License-Identifier: Apache-2.0
/// The scheduling contract: a policy gives a shading queue its order and nothing else.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace wavecomb {

/// What a policy may know of a queue: one entry a record, in arrival order.
struct ShadingQueueView {
  std::span<const uint32_t> program;
  std::span<const uint32_t> material;
  uint32_t depth = 0;
  size_t size() const { return material.size(); }
};

/// Estimated cost of shading a record, frozen while a pass runs.
struct CostSnapshot {
  std::vector<float> material_ns;  ///< per material
};

/// Gives a shading queue its order. Pure: sees ids, keys and frozen costs; can change no result.
class SchedulingPolicy {
 public:
  virtual ~SchedulingPolicy() = default;
  virtual std::string_view name() const = 0;
  /// Writes one 64-bit key per record; records are shaded in ascending key order, ties in arrival order.
  /// Returns false to keep arrival order, and then nothing is paid for.
  virtual bool order(const ShadingQueueView& queue, const CostSnapshot& costs,
                     std::span<uint64_t> keys) const = 0;
};

/// Makes the policy of that name. Throws Error listing the names there are.
std::unique_ptr<SchedulingPolicy> make_policy(std::string_view name);
/// Names of all policies.
std::vector<std::string> policy_names();

}  // namespace wavecomb
