// SPDX-License-Identifier: Apache-2.0
/// Selection of a lobe by one sample value.
#pragma once

#include "wavecomb/core/lanes/lanes.h"

namespace wavecomb {

/// Selects a lobe of a BSDF. The caller passes the probability of each lobe to next() in turn.
template <typename F>
struct LobeChoice {
  const F& u;   ///< sample value in [0, 1)
  F from{0.f};  ///< sum of the probabilities passed to next()
  F left{0.f};  ///< position of `u` within the selected lobe's probability, rescaled to [0, 1)
  Mask<F> open{true};  ///< lanes that have not selected a lobe yet

  /// Returns the lanes that select the next lobe, which has probability `p`.
  WAVECOMB_INLINE Mask<F> next(const F& p) {
    const F to = from + p;
    const Mask<F> here = open & (u < to) & (p > 0.f);
    left = select(here, F(F(u - from) / max(p, F(1e-20f))), left);
    open = open & not_(here);
    from = to;
    return here;
  }
};

}  // namespace wavecomb
