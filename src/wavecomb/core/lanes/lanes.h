// SPDX-License-Identifier: Apache-2.0
/// Lane types that all kernels are templates on, and their common operations.
///
/// A kernel takes `F`, which is `float` in the reference integrator and `FloatP<W>` in the
/// wavefront integrator. Each operation rounds the same way for both, so that a kernel gives the
/// same bits at any width. min, max and fma are therefore defined here: Dr.Jit's differ between
/// scalars and packets for NaN and contraction.
#pragma once

#include "wavecomb/core/lanes/arithmetic.h"
#include "wavecomb/core/lanes/memory.h"
#include "wavecomb/core/lanes/types.h"
