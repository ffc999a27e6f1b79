// SPDX-License-Identifier: Apache-2.0
/// Kernels for the lane widths of this build.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "wavecomb/path/integrator.h"
#include "wavecomb/wave/wave.h"

namespace wavecomb {

/// Wave kernels for one lane width.
struct LaneKernels {
  using RunWave = void (*)(Wave&, const WaveContext&, const WaveTask&);
  RunWave run = nullptr;
  RunWave run_in_volumes = nullptr;
  double (*time_material)(Wave&, const WaveContext&, const CalibrationHits&) = nullptr;
};

/// Returns the kernels for a lane width. All pointers are null if this build has no kernels for the
/// width.
LaneKernels lane_kernels(uint32_t lanes);
/// Returns the lane widths of this build in ascending order.
std::vector<uint32_t> lane_widths();
/// Returns the lane width to use, which is `wanted` or, if `wanted` is 0, the widest lane width of
/// this build. Throws Error for a width that this build does not have.
uint32_t choose_lanes(uint32_t wanted);
/// Creates the wavefront integrator with `lanes` lanes, or the scalar reference integrator.
std::unique_ptr<Integrator> make_integrator(IntegratorKind kind, const WaveContext& context,
                                            uint32_t lanes, uint32_t threads, uint32_t wave_size);
/// Returns the -march value that this library was compiled with ("native", "x86-64-v3"), or
/// "default".
const char* library_name();

}  // namespace wavecomb
