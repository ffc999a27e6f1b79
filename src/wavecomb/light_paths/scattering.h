// SPDX-License-Identifier: Apache-2.0
/// Classification of the scattering at vertices of light paths and of connections, for light path
/// expressions.
#pragma once

#include "wavecomb/path/steps/note_events.h"

namespace wavecomb {

/// Classifies the scattering from `l` to `w` at a vertex of a light path, or at a vertex of a
/// camera path for a connection. All lobes have weight 1, since lights that emit light paths have
/// no multipliers.
template <typename Bsdf, typename F>
[[gnu::noinline, gnu::cold]] ScatteringEvent<F> classify_event(const Bsdf bsdf, const Vec3<F> w,
                                                               const Vec3<F> l) {
  return classify_scattering<Bsdf, F>(bsdf, w, l, F(1.f), F(1.f));
}

}  // namespace wavecomb
