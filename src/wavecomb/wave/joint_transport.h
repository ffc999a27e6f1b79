// SPDX-License-Identifier: Apache-2.0
/// Registration of the transport algorithm that camera paths may be combined with
/// (path/joint_transport.h). Waves and the reference integrator know it by these names only:
///
///   WaveContext::joint     its Context
///   Wave::joint            its Buffers
///   JointTransport         its class, on which vertex kernels are templates
///   WaveTask::joint        tasks that trace its paths instead of camera paths
///   JointStages            its stages in waves (wave/run_wave.h), chosen in wave/wave.lanes.cpp
///
/// Its settings are rows of core/settings_table.cpp, its kernels a row of
/// wave/kernels/kernel_matrix.h, and its passes and pilots those of render/joint_transport.h.
#pragma once

#include "wavecomb/light_paths/coupling.h"

namespace wavecomb {

using JointTransport = LightPaths;

}  // namespace wavecomb
