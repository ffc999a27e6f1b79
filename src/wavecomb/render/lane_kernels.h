// SPDX-License-Identifier: Apache-2.0
/// The kernels of each lane width that this build has.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "wavecomb/integrate/integrator.h"
#include "wavecomb/integrate/wave.h"

namespace wavecomb {

/// The kernels of one width.
struct LaneKernels {
  using RunWave = void (*)(Wave&, const WaveContext&, const WaveTask&);
  RunWave run = nullptr;
  RunWave run_in_volumes = nullptr;
  double (*time_material)(Wave&, const WaveContext&, const CalibrationHits&) = nullptr;
};

/// Null pointers for a width that this build has no kernels for.
LaneKernels lane_kernels(uint32_t lanes);
/// Lane widths that this build has kernels for, ascending.
std::vector<uint32_t> lane_widths();
/// The width to use where `wanted` is asked for; 0: the widest. Throws Error for one that is not
/// there.
uint32_t choose_lanes(uint32_t wanted);
/// The integrator that the settings ask for: waves of `lanes` lanes, or the reference.
std::unique_ptr<Integrator> make_integrator(IntegratorKind kind, const WaveContext& context,
                                            uint32_t lanes, uint32_t threads, uint32_t wave_size);
/// The -march that this library is compiled with: "native", "x86-64-v3" ...; "default" without one.
const char* library_name();

}  // namespace wavecomb
