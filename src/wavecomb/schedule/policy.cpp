// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/schedule/policy.h"

#include "wavecomb/core/error.h"
#include "wavecomb/schedule/policies/policies.h"

namespace wavecomb {
namespace {

struct Entry {
  PolicyInfo info;
  std::unique_ptr<SchedulingPolicy> (*make)();
};

constexpr Entry kPolicies[] = {
    {{"none", "Keeps arrival order; nothing is sorted."}, &make_none_policy},
    {{"program", "Sorts by program, the kind of material, which suffices to fill lanes."},
     &make_program_policy},
    {{"code",
      "Sorts by program, then by material if textures or a graph drive its inputs, so that lanes "
      "run and read the same."},
     &make_code_policy},
    {{"material", "Sorts by program, then by estimated cost of the material, then by material."},
     &make_material_policy},
    {{"texture", "Sorts by program, then by the size of the material's largest texture."},
     &make_texture_policy},
    {{"texture-locality",
      "Sorts by program, material and texture coordinates (tile, mip level, uv), as MoonRay's "
      "shade queues do."},
     &make_texture_locality_policy},
    {{"cost-benefit",
      "Sorts by program, then by the material's throughput over cost, highest first, then by "
      "position in the scene."},
     &make_cost_benefit_policy},
    {{"random-runs", "Placebo: the runs of 'material' in a random order."},
     &make_random_runs_policy},
};

constexpr PolicyInfo kAdaptive{"adaptive",
                               "Chooses among none, code, material, texture and "
                               "texture-locality for each queue, by measured times."};

}  // namespace

std::unique_ptr<SchedulingPolicy> make_policy(std::string_view name) {
  std::string known;
  for (const Entry& entry : kPolicies) {
    if (name == entry.info.name) return entry.make();
    known += std::string(entry.info.name) + ", ";
  }
  throw Error("policy is '" + std::string(name) + "'; it must be one of " + known + kAdaptive.name);
}

std::vector<PolicyInfo> policy_table() {
  std::vector<PolicyInfo> table;
  for (const Entry& entry : kPolicies) table.push_back(entry.info);
  table.push_back(kAdaptive);
  return table;
}

std::vector<std::string> policy_names() {
  std::vector<std::string> names;
  for (const PolicyInfo& policy : policy_table()) names.emplace_back(policy.name);
  return names;
}

}  // namespace wavecomb
