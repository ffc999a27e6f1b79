// SPDX-License-Identifier: Apache-2.0
/// Which leaves of a piece of a tube a ray may meet.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>

#include "wavecomb/curve/bezier.h"
#include "wavecomb/curve/capsules.h"

namespace wavecomb {

/// A piece is halved so often at the most, so that its leaves are side by side in lanes.
inline constexpr int kLeafHalvings = 3;

namespace detail {

/// What the control points of a piece weigh at its leaves' ends.
struct LeafWeights {
  alignas(64) float at[4][16] = {};

  explicit constexpr LeafWeights(int halvings) {
    const int n = 1 << halvings;
    for (int i = 0; i <= n; ++i) {
      const float u = static_cast<float>(i) / static_cast<float>(n), w = 1 - u;
      at[0][i] = w * w * w;
      at[1][i] = 3 * w * w * u;
      at[2][i] = 3 * w * u * u;
      at[3][i] = u * u * u;
    }
  }
};

inline constexpr std::array<LeafWeights, kLeafHalvings + 1> kLeafWeights = {
    LeafWeights(0), LeafWeights(1), LeafWeights(2), LeafWeights(3)};

}  // namespace detail

/// A bit for each leaf of a piece in the space of a ray, which is halved `halvings` times, that may
/// be met with z_near <= z <= z_far; `r`: the most radius, `bulge`: how far a leaf is from
/// straight. In float: what is left out is certain, by a margin for rounding.
inline uint32_t leaves_near(const curve_math::Bezier& piece, int halvings, double r, double bulge,
                            double z_near, double z_far) {
  using F = FloatP<1 << kLeafHalvings>;
  using curve_math::V;
  constexpr double kRounding = 4e-6;  // of sums of products in float, over their terms
  const detail::LeafWeights& weights = detail::kLeafWeights[static_cast<size_t>(halvings)];
  Vec3<F> a, b;
  const auto ends = [&](double V::* axis, F& at_a, F& at_b) {
    at_a = at_b = F(0.f);
    for (int k = 0; k < 4; ++k) {
      const F p(static_cast<float>(piece.p[k].*axis));
      at_a = fma(load<F>(&weights.at[k][0]), p, at_a);
      at_b = fma(load<F>(&weights.at[k][1]), p, at_b);
    }
  };
  ends(&V::x, a.x, b.x);
  ends(&V::y, a.y, b.y);
  ends(&V::z, a.z, b.z);
  double size = 0, deep = 0;
  for (const V& p : piece.p) {
    size = std::max(size, std::abs(p.x) + std::abs(p.y));
    deep = std::max(deep, std::abs(p.z));
  }
  const auto lanes = [](double x) { return F(static_cast<float>(x)); };
  const double far = kRounding * (deep + r);
  const Mask<F> passed =
      passes_capsules<F>(a, b, lanes((1 + kRounding) * (r + bulge)), lanes(kRounding * (size + r)),
                         lanes(z_near - far), lanes(z_far * 1.00001 + far));
  return lane_bits<F>(not_(passed)) & ((1u << (1 << halvings)) - 1);
}

}  // namespace wavecomb
