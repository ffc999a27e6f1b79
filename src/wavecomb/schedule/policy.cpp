// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/schedule/policy.h"

#include "wavecomb/core/error.h"
#include "wavecomb/schedule/policies/policies.h"

namespace wavecomb {
namespace {

struct Entry {
  const char* name;
  std::unique_ptr<SchedulingPolicy> (*make)();
};

constexpr Entry kPolicies[] = {
    {"none", &make_none_policy},
    {"program", &make_program_policy},
    {"material", &make_material_policy},
    {"texture", &make_texture_policy},
    {"texture-locality", &make_texture_locality_policy},
    {"cost-benefit", &make_cost_benefit_policy},
    {"random-runs", &make_random_runs_policy},
};

}  // namespace

std::unique_ptr<SchedulingPolicy> make_policy(std::string_view name) {
  std::string known;
  for (const Entry& entry : kPolicies) {
    if (name == entry.name) return entry.make();
    known += std::string(entry.name) + ", ";
  }
  throw Error("policy is '" + std::string(name) + "'; it must be one of " + known + "adaptive");
}

std::vector<std::string> policy_names() {
  std::vector<std::string> names;
  for (const Entry& entry : kPolicies) names.emplace_back(entry.name);
  names.emplace_back("adaptive");
  return names;
}

}  // namespace wavecomb
