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
    {{"none", "Hits are shaded in the order of their arrival, unsorted."}, &make_none_policy},
    {{"program",
      "Sorts hits by shading program, that is, kind of material, which suffices to fill SIMD "
      "lanes."},
     &make_program_policy},
    {{"code",
      "Sorts hits by program, then by material if textures or a graph drive its inputs, so that "
      "lanes run the same code and read the same data."},
     &make_code_policy},
    {{"material",
      "Sorts hits by program, then by the estimated cost of the material, then by material."},
     &make_material_policy},
    {{"texture", "Sorts hits by program, then by the size of the material's largest texture."},
     &make_texture_policy},
    {{"texture-locality",
      "Sorts hits by program, material and texture coordinates (tile, mip level, uv), as MoonRay's "
      "shade queues do."},
     &make_texture_locality_policy},
    {{"cost-benefit",
      "Sorts hits by program, then by the material's throughput / cost in descending order, then "
      "by position in the scene."},
     &make_cost_benefit_policy},
    {{"random-runs",
      "Shades the runs of equal keys of policy material in random order, as a placebo for "
      "comparisons."},
     &make_random_runs_policy},
};

constexpr PolicyInfo kAdaptive{"adaptive",
                               "Chooses one of none, code, material, texture and texture-locality "
                               "for each queue, by measured times."};

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
