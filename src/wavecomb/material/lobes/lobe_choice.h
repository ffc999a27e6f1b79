// SPDX-License-Identifier: Apache-2.0
/// Selection of a lobe by one sample value.
#pragma once

#include "wavecomb/core/lanes/lanes.h"

namespace wavecomb {

/// Selects among lobes whose probabilities are given one after another.
template <typename F>
struct LobeChoice {
  const F& u;          ///< sample value in [0, 1)
  F from{0.f};         ///< sum of the probabilities so far
  F left{0.f};         ///< remainder of `u` in the selected lobe, rescaled to [0, 1)
  Mask<F> open{true};  ///< lanes without a lobe so far

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
