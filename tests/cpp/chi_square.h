// SPDX-License-Identifier: Apache-2.0
/// Chi-square tests of samplers with cells of equal mass.
///
/// A sampler draws a point of a domain, which is covered by rectangles ("charts"), or an atom,
/// which has a probability (delta lobes, point lights), or nothing. A k-d tree splits the charts at
/// medians of pilot samples until each leaf has a few of them, so a lobe of a thousandth of a
/// radian gets as many leaves as one that fills the hemisphere. The density is integrated
/// adaptively over each leaf, and consecutive leaves form cells of equal mass. A separate set of
/// samples is then counted in the cells. Each atom is a cell; so is "no sample", which expects the
/// remainder to 1.
///
/// The test uses fine cells of about 1000 samples, which detect narrow faults, and 32 coarse cells,
/// which detect small faults of whole lobes. `WAVECOMB_LONG=1` draws a million samples, `make test`
/// fewer.
#pragma once

#include <cstdint>
#include <functional>
#include <random>
#include <string>
#include <vector>

namespace wavecomb::chi_square {

/// A point (x, y) of a chart.
struct Place {
  uint32_t chart = 0;
  double x = 0, y = 0;
};

/// The rectangle [x0, x1] x [y0, y1]. The density may jump at the boundaries of a regular grid of
/// columns and rows.
struct Chart {
  double x0 = 0, x1 = 1, y0 = 0, y1 = 1;
  uint32_t columns = 1, rows = 1;
};

/// Random multiples of 2^-24 in [0, 1), equal with every standard library.
class Random {
 public:
  explicit Random(uint32_t seed) : rng_(seed) {}
  float operator()() { return static_cast<float>(rng_() >> 8) * 0x1p-24f; }
  uint32_t bits() { return static_cast<uint32_t>(rng_()); }

 private:
  std::mt19937 rng_;
};

/// Result of a draw.
struct Draw {
  enum class Kind : uint8_t { kNothing, kPlace, kAtom };
  Kind kind = Kind::kNothing;
  Place place;
  uint64_t atom = 0;
  double probability = 0;
  bool agrees = true;  ///< density and weight agree with the evaluation at the sampled point

  static Draw nothing() { return {}; }
  static Draw at(const Place& place, bool agrees = true) {
    return {Kind::kPlace, place, 0, 0, agrees};
  }
  static Draw of_atom(uint64_t atom, double probability) {
    return {Kind::kAtom, {}, atom, probability, true};
  }
};

/// A sampler and the density that it should follow.
struct Case {
  std::string name;
  std::vector<Chart> charts;
  std::function<double(const Place&)> density;  ///< per dx dy
  /// Draws a sample; sets Draw::agrees if `check` is true.
  std::function<Draw(Random&, bool check)> draw;
  /// Allowed fraction of samples that do not agree, because rounding moves them across an edge.
  double odd = 1e-3;
  /// Tolerance of the integral of the density, which uses floats. The test raises the tolerance for
  /// small sample counts, for which k-d tree leaves are large.
  double slack = 5e-4;
  /// True for smooth densities, whose lobes have wide tails that pilot evaluations find; false for
  /// densities with jumps.
  bool is_smooth = true;
  /// Minimum number of integration boxes along each axis of a chart; large for densities that jump
  /// along curves.
  double boxes = 12;
};

struct Result {
  std::vector<double> p_values;
  double mass = 0;
  double slack = 0;  ///< tolerance of `mass`
  double atoms = 0;
  double nothing = 0;      ///< fraction of draws without a sample
  double disagreeing = 0;  ///< fraction of samples that do not agree
  std::string worst;       ///< fine cell with the largest deviation

  /// Describes the failure at the given level for each p-value; empty if the test passes.
  std::string fault(const Case& c, double level) const;
};

/// Number of samples of a test: 10^6 with WAVECOMB_LONG, fewer in `make test`, and fewest under
/// sanitizers.
size_t usual_samples();

/// Compares `samples` draws with the density.
Result compare(const Case& c, uint32_t seed, size_t samples = usual_samples());

/// Probability that a chi-square variable of `dof` degrees of freedom exceeds x.
double chi_square_p(double x, double dof);

/// Returns the p-value of observed counts. Cells that expect fewer than 5 are merged. Returns 0 if
/// the merged cells expect fewer than 5 but observe 25 more than that.
double p_of_counts(const std::vector<double>& observed, const std::vector<double>& expected);

/// Level of each of `tests` independent tests so that the probability of any false alarm is `level`
/// (Z. Sidak, "Rectangular Confidence Regions for the Means of Multivariate Normal Distributions",
/// 1967).
double sidak(double level, size_t tests);

/// The test cases of one chi-square battery. By Sidak's correction over all batteries and the
/// p-values of each, a correct program passes with a probability of 99 %.
class Battery {
 public:
  explicit Battery(std::string name);
  /// Compares a case, with its index as seed.
  void run(const Case& c);
  /// Adds a p-value that the caller computed.
  void add(const std::string& name, double p_value);
  /// Expects all cases to pass, and prints their number and the lowest p-value.
  void judge() const;

 private:
  struct Entry {
    Case c;
    Result result;
  };
  std::string name_;
  std::vector<Entry> entries_;
};

}  // namespace wavecomb::chi_square
