// SPDX-License-Identifier: Apache-2.0
/// Every policy's maker; one file each beside this one.
#pragma once

#include <memory>

#include "wavecomb/schedule/policy.h"

namespace wavecomb {

std::unique_ptr<SchedulingPolicy> make_none_policy();
std::unique_ptr<SchedulingPolicy> make_program_policy();

}  // namespace wavecomb
