// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/light/calibration/balance.h"

#include <algorithm>
#include <cmath>

namespace wavecomb {
namespace {

constexpr double kStep = 0x1p-20;  ///< resolution of sums
/// Lower limit to which selection probabilities are raised in the sums of `LightBalance::gains()`.
/// It bounds each term by 2^24, so that a sum of 2^19 terms fits in 64 bits.
constexpr double kMinShare = 0x1p-8;
constexpr double kMaxMean = 64;  ///< limit of |N - M|
constexpr int kIterations = 24;

int64_t to_steps(double value) {
  return static_cast<int64_t>(std::nearbyint(value / kStep));
}
double from_steps(int64_t steps) {
  return kStep * static_cast<double>(steps);
}

}  // namespace

LightBalance::LightBalance(std::span<const double> shares, size_t cells)
    : first_(shares.begin(), shares.end()), choices_(shares.size(), 0), vertices_(cells, 0) {}

void LightBalance::add(size_t cell, size_t part, double value, double weight) {
  ++choices_[part];
  ++vertices_[cell];
  const double share = first_[part];
  if (!std::isfinite(value) || !(value > 0) || !(weight > 0) || !(share > 0)) return;
  // Solve value = a / (share + r) and weight = share / (share + r) for a and r (see balance.h).
  const double r = std::clamp(share * (1 / weight - 1), 0.0, 1e6);
  const double at_one = std::min(kMaxValue, value * (share + r) / (1 + r));
  samples_.push_back({static_cast<uint32_t>(cell), static_cast<uint32_t>(part),
                      static_cast<float>(at_one * (1 + r)), static_cast<float>(r)});
}

std::vector<double> LightBalance::gains(std::span<const double> p) const {
  struct Term {
    double a, r, inverse;
    int64_t bounces_less_lights;  ///< estimate of N - M (balance.h) from one sample
  };
  const auto term = [&](const Sample& s) {
    const double share = std::max(p[s.part], kMinShare), a{s.a}, r{s.r};
    const double inverse = 1 / (share + r);
    return Term{a, r, inverse, to_steps(a * (r - share) * inverse / first_[s.part])};
  };
  std::vector<int64_t> cells(vertices_.size(), 0), sums(p.size(), 0);
  for (const Sample& s : samples_) cells[s.cell] += term(s).bounces_less_lights;
  for (const Sample& s : samples_) {
    const Term t = term(s);
    // Estimate N - M (balance.h) by the mean over the vertices of the cell without the sample's own
    // vertex, which would make the estimate biased.
    const uint64_t others = vertices_[s.cell] - 1;
    double mean = 0;
    if (others > 0)
      mean = std::clamp(
          from_steps(cells[s.cell] - t.bounces_less_lights) / static_cast<double>(others),
          -kMaxMean, kMaxMean);
    sums[s.part] += to_steps(t.a * (t.a - 2 * mean * t.r) * t.inverse * t.inverse);
  }
  std::vector<double> out(p.size(), 0);
  for (size_t i = 0; i < out.size(); ++i)
    if (choices_[i] > 0) out[i] = from_steps(sums[i]) / static_cast<double>(choices_[i]);
  return out;
}

std::vector<double> LightBalance::shares(std::span<const double> power) const {
  const size_t n = power.size();
  std::vector<double> p = first_;
  bool any = false;
  for (int iteration = 0; iteration < kIterations; ++iteration) {
    const std::vector<double> gain = gains(p);
    double mean = 0, sum = 0;
    for (size_t i = 0; i < n; ++i) mean += p[i] * std::max(gain[i], 0.0);
    if (!(mean > 0)) break;
    any = true;
    for (size_t i = 0; i < n; ++i) {
      p[i] *= std::clamp(std::sqrt(std::max(gain[i], 0.0) / mean), 0.25, 4.0);
      sum += p[i] = std::max(p[i], 1e-6);
    }
    for (double& share : p) share /= sum;
  }
  if (!any) return {power.begin(), power.end()};
  for (size_t i = 0; i < n; ++i)
    p[i] = (1 - kFloor) * p[i] + kFloor * (0.5 / static_cast<double>(n) + 0.5 * power[i]);
  return p;
}

void NodeBalance::add(bool right, double probability, double value, double weight) {
  if (!std::isfinite(value) || !(value > 0) || !(weight > 0) || !(probability > 0)) return;
  const double contribution = std::min(LightBalance::kMaxValue, value),
               w = std::max(weight, 0x1p-10);
  for (int i = -kSteps; i <= kSteps; ++i) {
    const double odds = std::exp2(0.5 * i), factor = right ? odds : 1 / odds;
    const double after = probability * factor / (probability * factor + 1 - probability);
    squares_[static_cast<size_t>(i + kSteps)] += static_cast<uint64_t>(
        to_steps(contribution * contribution / (w * (w * after / probability + 1 - w))));
  }
  ++count_;
}

float NodeBalance::odds() const {
  if (count_ < kLeast) return 1;
  const auto mean = static_cast<double>(squares_[kSteps]) / static_cast<double>(count_);
  double least = INFINITY;
  float best = 1;
  for (int i = -kSteps; i <= kSteps; ++i) {
    // A prior of `kPrior` samples with equal contributions from both children limits the effect of
    // a few samples on the odds.
    const double odds = std::exp2(0.5 * i);
    const double sum = static_cast<double>(squares_[static_cast<size_t>(i + kSteps)]) +
                       mean * kPrior * (2 + odds + 1 / odds) / 4;
    if (!(sum < least)) continue;
    least = sum;
    best = static_cast<float>(odds);
  }
  return best;
}

}  // namespace wavecomb
