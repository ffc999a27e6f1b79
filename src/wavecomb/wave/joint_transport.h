// SPDX-License-Identifier: Apache-2.0
/// Registration of the joint transport, an algorithm that may be combined with camera paths
/// (path/joint_transport.h). Waves and the reference integrator use the joint transport only
/// through these names:
///
///   WaveContext::joint   data of the render (its Context)
///   Wave::joint          data of a worker (its Buffers)
///   JointTransport       the class, a template parameter of vertex kernels
///   WaveTask::joint      marks tasks that trace light paths instead of camera paths
///   WAVECOMB_SHARED_JOINT_TRANSPORT   functions of the joint transport that kernels
///                        do not inline (wave/kernels/shared_kernels.h)
///   JointStages          additional wave stages (wave/run_wave.h), chosen in wave/wave.lanes.cpp
///
/// The joint transport's settings are rows of core/settings_table.cpp, and its kernels are a row of
/// wave/kernels/kernel_matrix.h. Its passes and pilots are registered in render/joint_transport.h.
#pragma once

#include "wavecomb/light_paths/coupling.h"
#include "wavecomb/light_paths/shared_functions.h"

#define WAVECOMB_SHARED_JOINT_TRANSPORT WAVECOMB_SHARED_LIGHT_PATHS

namespace wavecomb {

using JointTransport = LightPaths;

}  // namespace wavecomb
