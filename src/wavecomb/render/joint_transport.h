// SPDX-License-Identifier: Apache-2.0
/// Registers light paths as the joint transport (path/joint_transport.h) of renders. The types
/// below are the joint transport's parts of the plan, the pilot renders and the passes.
#pragma once

#include "wavecomb/light_paths/render/light_aiming.h"
#include "wavecomb/light_paths/render/light_path_plan.h"
#include "wavecomb/light_paths/render/transport_choice.h"

namespace wavecomb {

using JointShare = LightPathShare;    ///< number of light paths per camera path
using JointPlan = LightPathPlan;      ///< part of a RenderPlan
using JointPilot = LightPathPilot;    ///< pilot render of the joint transport, run by run_pilots()
using JointPasses = LightPathPasses;  ///< passes of the joint transport, run by a PassLoop

}  // namespace wavecomb
