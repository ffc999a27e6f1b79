// SPDX-License-Identifier: Apache-2.0
/// Registration of the joint transport (path/joint_transport.h) in the plan, the pilots and the
/// passes of a render, and of the pilot that chooses between joint transport and camera paths
/// alone.
#pragma once

#include "wavecomb/light_paths/render/light_aiming.h"
#include "wavecomb/light_paths/render/light_path_plan.h"
#include "wavecomb/light_paths/render/transport_choice.h"

namespace wavecomb {

using JointShare = LightPathShare;    ///< number of light paths per camera path
using JointPlan = LightPathPlan;      ///< part of a RenderPlan
using JointPilot = LightPathPilot;    ///< the joint transport's pilot in run_pilots()
using JointPasses = LightPathPasses;  ///< the joint transport's passes in a PassLoop

}  // namespace wavecomb
