// SPDX-License-Identifier: Apache-2.0
/// The scheduling contract: a policy gives a shading queue its order and nothing else.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "wavecomb/schedule/cost_snapshot.h"

namespace wavecomb {

/// What there is to know of a material without knowing what a material is.
struct MaterialTraits {
  static constexpr uint32_t kNone = 0xffffffffu;  ///< no texture, no graph
  uint32_t program = 0;                           ///< the code that shades it
  uint32_t texture = kNone;                       ///< its largest texture
  uint64_t texture_bytes = 0;                     ///< memory of that texture, 0 without one
  uint32_t graph = kNone;                         ///< the value graph that its inputs come from
};

/// Columns of a ShadingQueueView that are worked out only for policies that ask.
enum QueueColumn : uint32_t {
  kThroughputColumn = 1,
  kPositionColumn = 2,
  kTextureColumn = 4,
};

/// What a policy may know of a queue: one entry a record, in arrival order. Columns that were not
/// asked for are empty.
struct ShadingQueueView {
  std::span<const uint32_t> program;
  std::span<const uint32_t> material;
  std::span<const float> throughput;       ///< luminance of the path's throughput
  std::span<const uint32_t> position_key;  ///< Morton code of the hit, 30 bits
  std::span<const uint32_t> texture_key;   ///< UDIM tile (7 bits), mip level (4), Morton of uv (14)
  std::span<const MaterialTraits> materials;  ///< per material id
  std::span<float> scratch;                   ///< one float a material, for the policy's own sums
  uint32_t depth = 0;

  size_t size() const { return material.size(); }
};

/// Gives a shading queue its order. Pure: sees ids, keys and frozen costs; can change no result.
class SchedulingPolicy {
 public:
  virtual ~SchedulingPolicy() = default;
  virtual std::string_view name() const = 0;
  /// QueueColumns that order() reads.
  virtual uint32_t columns() const { return 0; }
  /// Writes one 64-bit key per record; records are shaded in ascending key order, ties in arrival
  /// order. Returns false to keep arrival order, and then nothing is paid for.
  virtual bool order(const ShadingQueueView& queue, const CostSnapshot& costs,
                     std::span<uint64_t> keys) const = 0;
};

/// Makes the policy of that name. Throws Error listing the names there are.
std::unique_ptr<SchedulingPolicy> make_policy(std::string_view name);
/// A policy for those who choose one.
struct PolicyInfo {
  const char* name;
  const char* help;  ///< what it does, a sentence
};
/// All policies that make_policy knows, and "adaptive", which chooses among them.
std::vector<PolicyInfo> policy_table();
/// Their names.
std::vector<std::string> policy_names();

}  // namespace wavecomb
