// SPDX-License-Identifier: Apache-2.0
/// Factories of all policies. Each policy is defined in a separate file. docs/writing-a-policy.md
/// explains how to add one.
#pragma once

#include <bit>
#include <memory>

#include "wavecomb/schedule/policy.h"

namespace wavecomb {

std::unique_ptr<SchedulingPolicy> make_none_policy();
std::unique_ptr<SchedulingPolicy> make_program_policy();
std::unique_ptr<SchedulingPolicy> make_code_policy();
std::unique_ptr<SchedulingPolicy> make_material_policy();
std::unique_ptr<SchedulingPolicy> make_texture_policy();
std::unique_ptr<SchedulingPolicy> make_texture_locality_policy();
std::unique_ptr<SchedulingPolicy> make_cost_benefit_policy();
std::unique_ptr<SchedulingPolicy> make_random_runs_policy();

/// Returns the bits of a non-negative float. As integers, the bits have the same order as the
/// floats.
inline uint64_t ascending_bits(float x) {
  return std::bit_cast<uint32_t>(x > 0.f ? x : 0.f);
}

}  // namespace wavecomb
