// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/film/filter.h"

#include <algorithm>
#include <cmath>

namespace wavecomb {
namespace {

/// Returns the value of a pixel filter of half width 1 at x in [-1, 1].
double filter_value(FilterKind kind, double x) {
  constexpr double kPi = 3.14159265358979323846;
  switch (kind) {
    case FilterKind::kBox:
      return 1.0;
    case FilterKind::kGaussian:
      return std::exp(-0.5 * 9.0 * x * x) - std::exp(-0.5 * 9.0);
    case FilterKind::kBlackmanHarris: {
      const double a = kPi * (x + 1.0);
      return 0.35875 - 0.48829 * std::cos(a) + 0.14128 * std::cos(2 * a) -
             0.01168 * std::cos(3 * a);
    }
  }
  return 1.0;
}

}  // namespace

FilterTable::FilterTable(FilterKind kind, float width)
    : offsets_(kBins + 2),
      radius_(0.5f * width),
      density_scale_(float{kBins} / width),
      density_(kBins) {
  constexpr int kSteps = 1 << 16;
  std::vector<double> cdf(kSteps + 1, 0.0);
  for (int i = 0; i < kSteps; ++i)
    cdf[i + 1] = cdf[i] + filter_value(kind, 2.0 * (i + 0.5) / kSteps - 1.0);
  int step = 0;
  for (uint32_t bin = 0; bin <= kBins; ++bin) {
    const double target = cdf[kSteps] * bin / kBins;
    while (step < kSteps - 1 && cdf[step + 1] < target) ++step;
    const double mass = cdf[step + 1] - cdf[step];
    const double within = mass > 0 ? (target - cdf[step]) / mass : 0.0;
    offsets_[bin] = static_cast<float>(((step + within) / kSteps - 0.5) * width);
  }
  offsets_[kBins + 1] = offsets_[kBins];
  // Tabulate the density of offsets that are sampled by interpolation in the table. In the tails,
  // it differs from the density of the filter itself.
  uint32_t from = 0;
  const auto share_below = [&](double x) {
    while (from + 1 < kBins && double{offsets_[from + 1]} <= x) ++from;
    const double low = double{offsets_[from]}, size = double{offsets_[from + 1]} - low;
    return (from + (size > 0 ? std::clamp((x - low) / size, 0.0, 1.0) : 0.0)) / kBins;
  };
  double below = 0;
  for (uint32_t bin = 0; bin < kBins; ++bin) {
    const double next = share_below(((bin + 1.0) / kBins - 0.5) * double{width});
    density_[bin] = static_cast<float>((next - below) * kBins / double{width});
    below = next;
  }
}

}  // namespace wavecomb
