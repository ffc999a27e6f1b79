// SPDX-License-Identifier: Apache-2.0
/// Shares of lights out of samples: what each brings, beside what bounces find.
///
/// One light sample, of density p q over directions (p the probability of the light, q its own),
/// and a bounce of density b, by the balance heuristic, have at a vertex the variance
///
///   sum over lights of  integral g^2 / (p q + b)  -  M^2 - N^2,      g = f |cos| Le V,
///   M = sum of integral g p q / (p q + b),   N = sum of integral g b / (p q + b),
///
/// M and N being what light samples and bounces bring in the mean. For a sum of all p of 1 it is
/// least where
///
///   G = E_q[(a / (p + r))^2] - 2 (N - M) E_q[a r / (p + r)^2],   a = g / q, r = b / q,
///
/// is alike for all lights that have a share at all: p is proportional to the square root of the
/// second moment where bounces do not find a light, and 0 where they find it as well.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

namespace wavecomb {

/// Samples of the choice of a light, and the shares that follow from them. All sums over samples
/// are in integers, so that their order does not matter.
class LightBalance {
 public:
  /// Samples are taken with these `shares` of the parts (> 0), in so many cells: vertices that are
  /// alike, for which M and N are taken together.
  LightBalance(std::span<const double> shares, size_t cells);

  /// A choice of `part` in `cell`: `value` is what the light sample brought, times its MIS weight,
  /// over the scale of the picture there; `weight` that MIS weight. What is not finite counts as
  /// nothing, what is above kMostValue as that.
  void add(size_t cell, size_t part, double value, double weight);

  /// The shares of least variance, of which kFloor is given out by heads and by `power` (> 0, sum
  /// 1), half each; `power` where no part has brought anything. The sum is 1, each share above 0.
  std::vector<double> shares(std::span<const double> power) const;

  static constexpr double kFloor = 0.1;
  static constexpr double kMostValue = 16;

 private:
  struct Sample {
    uint32_t cell, part;
    float a, r;
  };
  /// G of each part at shares p.
  std::vector<double> gains(std::span<const double> p) const;

  std::vector<double> first_;
  std::vector<uint64_t> choices_;   ///< of each part
  std::vector<uint64_t> vertices_;  ///< of each cell
  std::vector<Sample> samples_;     ///< that brought something
};

/// How the odds at a node of a tree are to be changed, from samples below it.
class NodeBalance {
 public:
  /// A light sample below the node, on its right or left, whose child had the probability
  /// `probability`; value and weight as LightBalance::add.
  void add(bool right, double probability, double value, double weight);
  /// Factor of the odds of the right child, of least second moment: a power of sqrt(2) within
  /// [1/8, 8]; 1 where samples are few.
  float odds() const;

 private:
  static constexpr int kSteps = 6;  ///< to each side
  static constexpr uint64_t kLeast = 64, kPrior = 16;
  std::array<uint64_t, 2 * kSteps + 1> squares_{};
  uint64_t count_ = 0;
};

}  // namespace wavecomb
