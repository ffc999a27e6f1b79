// SPDX-License-Identifier: Apache-2.0
/// Conservative test of a ray against the nearly straight sub-segments of a tube.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>

#include "wavecomb/geometry/curve/bezier.h"
#include "wavecomb/geometry/curve/capsules.h"

namespace wavecomb {

/// Maximum number of halvings for which one SIMD vector has a lane for each resulting sub-segment.
inline constexpr int kLaneHalvings = 3;

namespace detail {

/// Weights of the control points at the ends of the final sub-segments.
struct SubSegmentWeights {
  alignas(64) float at[4][16] = {};

  explicit constexpr SubSegmentWeights(int halvings) {
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

inline constexpr std::array<SubSegmentWeights, kLaneHalvings + 1> kSubSegmentWeights = {
    SubSegmentWeights(0), SubSegmentWeights(1), SubSegmentWeights(2), SubSegmentWeights(3)};

}  // namespace detail

/// Halves a sub-segment `halvings` times, and returns a bit mask of the resulting sub-segments that
/// a ray may hit with z_near <= z <= z_far. `sub_segment` is in the ray's coordinate system, `r` is
/// its maximum radius, and `bulge` is the deviation of the resulting sub-segments from straight
/// lines. The test uses single precision with a margin for rounding errors, so that it never misses
/// a hit.
inline uint32_t sub_segments_near(const curve_math::Bezier& sub_segment, int halvings, double r,
                                  double bulge, double z_near, double z_far) {
  using F = FloatP<1 << kLaneHalvings>;
  using curve_math::V;
  constexpr double kRounding = 4e-6;  // bound of the relative error of dot products in float
  const detail::SubSegmentWeights& weights =
      detail::kSubSegmentWeights[static_cast<size_t>(halvings)];
  Vec3<F> a, b;
  const auto ends = [&](double V::* axis, F& at_a, F& at_b) {
    at_a = at_b = F(0.f);
    for (int k = 0; k < 4; ++k) {
      const F p(static_cast<float>(sub_segment.p[k].*axis));
      at_a = fma(load<F>(&weights.at[k][0]), p, at_a);
      at_b = fma(load<F>(&weights.at[k][1]), p, at_b);
    }
  };
  ends(&V::x, a.x, b.x);
  ends(&V::y, a.y, b.y);
  ends(&V::z, a.z, b.z);
  double size = 0, deep = 0;
  for (const V& p : sub_segment.p) {
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
