// SPDX-License-Identifier: Apache-2.0
/// Lanes: the float types that every kernel is a template on, and the few operations they share.
///
/// A kernel takes `F`, which is `float` in the reference integrator and `FloatP<W>` in the wave.
/// Each operation rounds in the same way for both, so a kernel gives the same bits at any width.
/// That is why minimum, maximum and fma are ours: Dr.Jit's differ between scalar and packet for NaN
/// and contraction.
#pragma once

#include "wavecomb/core/lane_arithmetic.h"
#include "wavecomb/core/lane_memory.h"
#include "wavecomb/core/lane_types.h"
