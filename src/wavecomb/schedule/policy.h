// SPDX-License-Identifier: Apache-2.0
/// Interface of scheduling policies. A policy chooses the order of a shading queue and nothing
/// else.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "wavecomb/schedule/cost_snapshot.h"

namespace wavecomb {

/// Properties of a material that scheduling may use.
struct MaterialTraits {
  static constexpr uint32_t kNone = 0xffffffffu;  ///< id that means "no texture" or "no graph"
  uint32_t program = 0;                           ///< shading program
  uint32_t texture = kNone;                       ///< largest texture
  uint64_t texture_bytes = 0;  ///< memory of the largest texture in bytes; 0 without textures
  uint32_t graph = kNone;      ///< value graph that drives inputs of the material
};

/// Columns of a ShadingQueueView that are computed only for policies that request them.
enum QueueColumn : uint32_t {
  kThroughputColumn = 1,
  kPositionColumn = 2,
  kTextureColumn = 4,
};

/// Read-only view of a shading queue for policies. Columns have one entry per record, in arrival
/// order; columns that were not requested are empty.
struct ShadingQueueView {
  std::span<const uint32_t> program;
  std::span<const uint32_t> material;
  std::span<const float> throughput;       ///< luminance of the path's throughput
  std::span<const uint32_t> position_key;  ///< Morton code of the hit, 30 bits
  /// UDIM tile (7 bits), mip level (4 bits) and Morton code of uv (14 bits)
  std::span<const uint32_t> texture_key;
  std::span<const MaterialTraits> materials;  ///< by material id
  std::span<float> scratch;  ///< buffer for the policy, with one float per material
  uint32_t depth = 0;

  size_t size() const { return material.size(); }
};

/// Scheduling policy: computes the order of a shading queue. Implementations are pure functions of
/// ids, keys and frozen costs, and cannot affect the image.
class SchedulingPolicy {
 public:
  virtual ~SchedulingPolicy() = default;
  virtual std::string_view name() const = 0;
  /// Returns whether this policy always keeps arrival order.
  virtual bool keeps_arrival_order() const { return false; }
  /// Returns the QueueColumn bits that order() reads.
  virtual uint32_t columns() const { return 0; }
  /// Computes one 64-bit sort key per record. Records are shaded in ascending key order; records
  /// with equal keys keep their arrival order. Returns false to keep arrival order without sorting.
  virtual bool order(const ShadingQueueView& queue, const CostSnapshot& costs,
                     std::span<uint64_t> keys) const = 0;
};

/// Creates a policy by name. If the name is unknown, throws Error that lists the known names.
std::unique_ptr<SchedulingPolicy> make_policy(std::string_view name);
/// Name and description of a policy, for help texts and menus.
struct PolicyInfo {
  const char* name;
  const char* help;  ///< one sentence
};
/// Returns all policies that make_policy knows, and "adaptive", which chooses among them.
std::vector<PolicyInfo> policy_table();
/// Returns the names in policy_table().
std::vector<std::string> policy_names();

}  // namespace wavecomb
