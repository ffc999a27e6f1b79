// SPDX-License-Identifier: Apache-2.0
/// State that light paths keep from vertex to vertex.
#pragma once

#include <cstddef>

#include "wavecomb/core/rows/fields.h"
#include "wavecomb/path/path_pool.h"
#include "wavecomb/path/path_state.h"

namespace wavecomb {

/// State of a light path at a vertex, in addition to its PathState.
template <typename F>
struct LightPathState {
  F mis_sum{0.f};  ///< sum S of density ratios for MIS weights (light_vertex.h)
  /// Density of the previous bounce, or 0 if the vertex where this bounce started cannot be
  /// connected to camera paths.
  F bounce_pdf{0.f};
  UInt<F> light{0u};  ///< light at which the path started
};

/// Row of a light path between two vertices, in the same slots as rows of camera paths.
template <typename F>
struct LightPathRow {
  Vec3<F> o, d;         ///< origin and direction of the ray to trace
  Color<F> throughput;  ///< flux
  F mis_sum;            ///< LightPathState::mis_sum
  F eta_scale;
  F unused;
  F bounce_pdf;  ///< LightPathState::bounce_pdf
  SampleKey<F> key;
  UInt<F> light;  ///< LightPathState::light
  WAVECOMB_FIELDS(o, d, throughput, mis_sum, eta_scale, unused, bounce_pdf, key, light)

  LightPathState<F> light_state() const { return {mis_sum, bounce_pdf, light}; }
};

// Rows of light paths and camera paths have the same size and the same offsets of common fields, so
// that wave stages that trace rays or use random numbers can process both.
static_assert(kFieldWords<LightPathRow> == kFieldWords<PathRow>);
static_assert(offsetof(LightPathRow<float>, throughput) == offsetof(PathRow<float>, throughput) &&
              offsetof(LightPathRow<float>, eta_scale) == offsetof(PathRow<float>, eta_scale) &&
              offsetof(LightPathRow<float>, key) == offsetof(PathRow<float>, key));

/// Returns the row of a light path with the next ray and throughput of `next`.
template <typename F>
WAVECOMB_INLINE LightPathRow<F> light_path_row(const PathState<F>& next,
                                               const LightPathState<F>& light,
                                               const SampleKey<F>& key) {
  return {.o = next.o,
          .d = next.dir,
          .throughput = next.throughput,
          .mis_sum = light.mis_sum,
          .eta_scale = next.eta_scale,
          .unused = F(0.f),
          .bounce_pdf = light.bounce_pdf,
          .key = key,
          .light = light.light};
}

}  // namespace wavecomb
