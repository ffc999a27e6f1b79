// SPDX-License-Identifier: Apache-2.0
/// Mean of an IES profile.
#include <cmath>
#include <numbers>

#include "wavecomb/core/error.h"
#include "wavecomb/light/description/light.h"

namespace wavecomb {
namespace {

/// Returns the integral of sin(x) f(x) dx, where f is linear from a at x0 to b at x1 (radians). The
/// antiderivatives of sin(x) and x sin(x) are -cos(x) and sin(x) - x cos(x).
double integral(double x0, double x1, double a, double b) {
  if (!(x1 > x0)) return 0;
  const double slope = (b - a) / (x1 - x0);
  const auto whole = [&](double x) {
    return -(a - slope * x0) * std::cos(x) + slope * (std::sin(x) - x * std::cos(x));
  };
  return whole(x1) - whole(x0);
}

}  // namespace

double IesProfile::mean() const {
  constexpr double kRadians = std::numbers::pi / 180;
  const size_t rows = vertical.size();
  const auto column = [&](size_t h) {
    double sum = 0;
    for (size_t v = 0; v + 1 < rows; ++v)
      sum += integral(double{vertical[v]} * kRadians, double{vertical[v + 1]} * kRadians,
                      double{candela[h * rows + v]}, double{candela[h * rows + v + 1]});
    return sum;
  };
  double sum = 0;
  if (horizontal.size() == 1) sum = 2 * std::numbers::pi * column(0);
  for (size_t h = 0; h + 1 < horizontal.size(); ++h)
    sum += (double{horizontal[h + 1]} - double{horizontal[h]}) * kRadians *
           (column(h) + column(h + 1)) / 2;
  return sum / ((covers_sphere() ? 4 : 2) * std::numbers::pi);
}

}  // namespace wavecomb
