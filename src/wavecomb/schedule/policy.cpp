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
    {{"none", "Arrival order; nothing is paid for it."}, &make_none_policy},
    {{"program", "By program, the kind of material: what lanes need and no more."},
     &make_program_policy},
    {{"code",
      "By program, then by material where textures or a graph give its inputs: what lanes run and "
      "read together."},
     &make_code_policy},
    {{"material", "By program, then by estimated cost of the material, then by material."},
     &make_material_policy},
    {{"texture", "By program, then by the size of the material's largest texture."},
     &make_texture_policy},
    {{"texture-locality",
      "By program, material and place in its texture (tile, mip level, uv), as MoonRay's shade "
      "queues."},
     &make_texture_locality_policy},
    {{"cost-benefit",
      "By program, then by throughput over cost of a material, highest first, then by place in the "
      "scene."},
     &make_cost_benefit_policy},
    {{"random-runs", "The placebo: the runs of 'material' in an order that means nothing."},
     &make_random_runs_policy},
};

constexpr PolicyInfo kAdaptive{"adaptive",
                               "Chooses among none, code, material, texture and "
                               "texture-locality, queue by queue, by the times that it learns."};

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
