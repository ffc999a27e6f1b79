// SPDX-License-Identifier: Apache-2.0
/// Gaussian quadrature for a discrete measure.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <vector>

namespace wavecomb {

/// Point mass at x.
struct PointMass {
  double x, weight;
};

/// Returns the nodes and weights of Gauss quadrature with n nodes over the measure `points` (x in
/// [0, 1], weights >= 0), which integrates polynomials of degree below 2 n exactly. Nodes are the
/// roots of the orthogonal polynomial of degree n, built by the Stieltjes procedure (Gautschi,
/// "Orthogonal Polynomials: Computation and Approximation", 2004, section 2.2.3). If the points
/// nearly coincide, all n nodes are equal to the mean of the points.
template <size_t n>
inline std::array<PointMass, n> gauss_rule(const std::vector<PointMass>& points) {
  // Recurrence of the orthogonal polynomials: p_(k+1) = (x - a_k) p_k - b_k p_(k-1), with norm_k =
  // sum of weight p_k^2.
  std::array<double, n> a{}, b{}, norm{};
  std::vector<double> before(points.size(), 0.0), now(points.size(), 1.0);
  std::array<PointMass, n> rule{};
  for (size_t k = 0; k < n; ++k) {
    double mass = 0, first = 0;
    for (size_t i = 0; i < points.size(); ++i) {
      const double q = points[i].weight * now[i] * now[i];
      mass += q;
      first += q * points[i].x;
    }
    // Stop if the points span less than about 1e-5 of [0, 1]: the norm of the polynomial of degree
    // k falls with the power 2 k of the span.
    if (k > 0 && mass < norm[0] * std::pow(1e-10, static_cast<double>(k))) {
      rule.fill({a[0], norm[0] / n});
      return rule;
    }
    if (mass <= 0) return rule;
    norm[k] = mass;
    a[k] = first / mass;
    b[k] = k > 0 ? mass / norm[k - 1] : 0;
    for (size_t i = 0; i < points.size(); ++i) {
      const double next = (points[i].x - a[k]) * now[i] - b[k] * before[i];
      before[i] = now[i];
      now[i] = next;
    }
  }
  // Find roots by bisection: the number of negative pivots of J - x is the number of roots below x
  // (Sturm).
  const auto roots_below = [&](double x) {
    size_t count = 0;
    double pivot = 1;
    for (size_t k = 0; k < n; ++k) {
      pivot = a[k] - x - (k > 0 ? b[k] / pivot : 0);
      if (pivot == 0) pivot = 1e-300;
      count += pivot < 0;
    }
    return count;
  };
  for (size_t j = 0; j < n; ++j) {
    double low = 0, high = 1;
    for (int step = 0; step < 52; ++step) {
      const double middle = 0.5 * (low + high);
      (roots_below(middle) > j ? high : low) = middle;
    }
    const double x = 0.5 * (low + high);
    double last = 0, p = 1, sum = 1 / norm[0];
    for (size_t k = 0; k + 1 < n; ++k) {
      const double next = (x - a[k]) * p - b[k] * last;
      last = p;
      p = next;
      sum += p * p / norm[k + 1];
    }
    rule[j] = {x, 1 / sum};
  }
  return rule;
}

}  // namespace wavecomb
