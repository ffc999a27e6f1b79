// SPDX-License-Identifier: Apache-2.0
/// Lane types (floats and packets of floats), which are the template parameters of all kernels, and
/// operations on these types.
///
/// A kernel takes `F`, which is `float` in the reference integrator and `FloatP<W>` in the
/// wavefront integrator. Each operation rounds in the same way for scalars and packets, so that a
/// kernel gives the same bits at any lane width. Wavecomb therefore defines its own min, max and
/// fma: in Dr.Jit, min and max treat NaN differently in scalars and packets, and fma may be rounded
/// differently.
#pragma once

#include "wavecomb/core/lanes/arithmetic.h"
#include "wavecomb/core/lanes/memory.h"
#include "wavecomb/core/lanes/types.h"
