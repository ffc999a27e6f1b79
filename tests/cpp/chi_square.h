// SPDX-License-Identifier: Apache-2.0
/// Chi-square tests of samplers with cells of equal mass.
///
/// A sample is a point, an atom, or nothing. Points lie in a domain that is covered by rectangles
/// ("charts"). Atoms have a probability instead of a density, such as delta lobes and point lights.
/// A k-d tree splits the charts at medians of pilot samples until each leaf has a few samples, so a
/// lobe of a thousandth of a radian gets as many leaves as a lobe that fills the hemisphere. The
/// density is integrated adaptively over each leaf, and consecutive leaves form cells of equal
/// mass. A separate set of samples is then counted in the cells. Each atom is a separate cell, and
/// so is the outcome "no sample", whose expected probability is 1 minus the sum of all other
/// probabilities.
///
/// The test uses fine cells of about 1000 samples, which detect narrow faults, and 32 coarse cells,
/// which detect small faults of whole lobes. Tests draw a million samples with `WAVECOMB_LONG=1`,
/// and fewer in `make test`.
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
  /// whether the density and weight of the sample equal those of an evaluation at the sampled point
  bool agrees = true;

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
  /// Allowed fraction of samples with Draw::agrees false, since rounding may move a sample across
  /// an edge.
  double odd = 1e-3;
  /// Tolerance of the integral of the density, since densities are computed in float. The test
  /// raises the tolerance for small sample counts, for which k-d tree leaves are large.
  double slack = 5e-4;
  /// Whether the density is smooth, so that pilot evaluations find the wide tails of its lobes.
  /// False for densities with jumps.
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

  /// Returns a description of the failure, or an empty string if the test passes. `level` is the
  /// significance level of each p-value.
  std::string fault(const Case& c, double level) const;
};

/// Returns the number of samples of a test: 10^6 with WAVECOMB_LONG, fewer in `make test`, and
/// fewest under sanitizers.
size_t usual_samples();

/// Draws `samples` samples and compares their counts with the density.
Result compare(const Case& c, uint32_t seed, size_t samples = usual_samples());

/// Returns the probability that a chi-square variable with `dof` degrees of freedom exceeds x.
double chi_square_p(double x, double dof);

/// Returns the p-value of observed counts. Cells with an expected count below 5 are merged into one
/// cell. Returns 0 if the expected count of the merged cell is still below 5 but its observed count
/// is larger by 25 or more.
double p_of_counts(const std::vector<double>& observed, const std::vector<double>& expected);

/// Returns the significance level for each of `tests` independent tests such that the probability
/// of any false alarm is `level` (Z. Sidak, "Rectangular Confidence Regions for the Means of
/// Multivariate Normal Distributions", 1967).
double sidak(double level, size_t tests);

/// The test cases of one chi-square battery. By Sidak's correction over all batteries and the
/// p-values of each, a correct program passes with a probability of 99 %.
class Battery {
 public:
  explicit Battery(std::string name);
  /// Runs the chi-square test of a case. The seed is the index of the case in the battery.
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
