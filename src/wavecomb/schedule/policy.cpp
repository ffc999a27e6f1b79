// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/schedule/policy.h"

#include <functional>

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
};

}  // namespace

std::unique_ptr<SchedulingPolicy> make_policy(std::string_view name) {
  std::string known;
  for (const Entry& entry : kPolicies) {
    if (name == entry.name) return entry.make();
    known += (known.empty() ? "" : ", ") + std::string(entry.name);
  }
  throw Error("policy '" + std::string(name) + "' is not known; choose one of " + known);
}

std::vector<std::string> policy_names() {
  std::vector<std::string> names;
  for (const Entry& entry : kPolicies) names.emplace_back(entry.name);
  return names;
}

}  // namespace wavecomb
