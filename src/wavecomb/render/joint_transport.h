// SPDX-License-Identifier: Apache-2.0
/// Registration of the joint transport (path/joint_transport.h) in the plan, the pilots and the
/// passes of a render, and of the pilot that chooses between it and camera paths alone.
#pragma once

#include "wavecomb/light_paths/render/light_aiming.h"
#include "wavecomb/light_paths/render/light_path_plan.h"
#include "wavecomb/light_paths/render/transport_choice.h"

namespace wavecomb {

using JointShare = LightPathShare;    ///< number of its paths per camera path
using JointPlan = LightPathPlan;      ///< part of a RenderPlan
using JointPilot = LightPathPilot;    ///< its pilot, among those of run_pilots()
using JointPasses = LightPathPasses;  ///< its passes in a PassLoop

}  // namespace wavecomb
