// SPDX-License-Identifier: Apache-2.0
/// Functions of light paths that the kernels of all programs call without inlining
/// (wave/kernels/shared_kernels.h).
#pragma once

#include "wavecomb/light_paths/light_path_aovs.h"
#include "wavecomb/light_paths/light_vertices.h"

/// Instantiates or declares these functions. `KEYWORD` is empty or `extern`.
#define WAVECOMB_SHARED_LIGHT_PATHS(KEYWORD, F)                                                   \
  KEYWORD template void LightPathAovs::shade<F>(uint32_t, const UInt<F>&, const SampleKey<F>&,    \
                                                const VertexAovs<F>&, const Mask<F>&) const;      \
  KEYWORD template void LightPathAovs::mark_stored<F>(const UInt<F>&, const Mask<F>&) const;      \
  KEYWORD template void LightPathAovs::offer<F>(const UInt<F>&, const UInt<F>&,                   \
                                                const ScatteringEvent<F>&, const Mask<F>&) const; \
  KEYWORD template void LightPathAovs::record_connection<F>(                                      \
      const UInt<F>&, const ScatteringEvent<F>&, const Mask<F>&) const;                           \
  KEYWORD template Mask<F> store_light_vertex<F>(const LightVertices&, uint32_t,                  \
                                                 const LightPathRow<F>&, const ShadingRecord<F>&, \
                                                 const UInt<F>&, const Vec3<F>&, const Mask<F>&)
