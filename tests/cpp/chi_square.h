// SPDX-License-Identifier: Apache-2.0
/// Chi-square tests of samplers over cells of equal mass.
///
/// A sampler draws places, from a domain that rectangles ("charts") cover, or atoms, which are
/// drawn with a probability of their own (delta lobes, point lights), or nothing. Pilot samples cut
/// the charts at medians (a k-d tree) until each leaf has a few of them, so that a lobe of a
/// thousandth of a radian has as many leaves as one that fills the hemisphere. The density is
/// integrated over each leaf, adaptively; leaves that follow each other make cells of equal mass.
/// Another set of samples is counted in them. Each atom is a cell, and so is nothing, which expects
/// what is left of 1.
///
/// It is done with fine cells (of some 1000 samples), which see what is narrow, and with 32 coarse
/// ones, which see small faults of a whole lobe. `WAVECOMB_LONG=1` draws a million samples,
/// `make test` fewer.
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

/// A rectangle [x0, x1] x [y0, y1]. Where so many equal columns and rows meet, the density may
/// jump.
struct Chart {
  double x0 = 0, x1 = 1, y0 = 0, y1 = 1;
  uint32_t columns = 1, rows = 1;
};

/// Numbers in [0, 1), multiples of 2^-24, alike with every standard library.
class Random {
 public:
  explicit Random(uint32_t seed) : rng_(seed) {}
  float operator()() { return static_cast<float>(rng_() >> 8) * 0x1p-24f; }
  uint32_t bits() { return static_cast<uint32_t>(rng_()); }

 private:
  std::mt19937 rng_;
};

/// What a sampler drew.
struct Draw {
  enum class Kind : uint8_t { kNothing, kPlace, kAtom };
  Kind kind = Kind::kNothing;
  Place place;
  uint64_t atom = 0;       ///< which
  double probability = 0;  ///< of the atom, as the sampler says
  bool agrees = true;      ///< density and weight of the sample are those of its place

  static Draw nothing() { return {}; }
  static Draw at(const Place& place, bool agrees = true) {
    return {Kind::kPlace, place, 0, 0, agrees};
  }
  static Draw of_atom(uint64_t atom, double probability) {
    return {Kind::kAtom, {}, atom, probability, true};
  }
};

/// A sampler and what it should follow.
struct Case {
  std::string name;
  std::vector<Chart> charts;
  std::function<double(const Place&)> density;  ///< per dx dy
  /// `check`: say whether it agrees.
  std::function<Draw(Random&, bool check)> draw;
  /// Share of the samples that need not agree: rounding carries them over an edge.
  double odd = 1e-3;
  /// What the integral of the density, which is of floats, may be off by; more where samples are so
  /// few that leaves are large.
  double slack = 5e-4;
  /// Whether the density is smooth, with lobes that are seen from afar by their tails, or else has
  /// jumps.
  bool is_smooth = true;
  /// Along each axis of a chart, boxes over which it is integrated at the least: many where it
  /// jumps along curves.
  double boxes = 12;
};

struct Result {
  std::vector<double> p_values;  ///< of fine cells, then of coarse ones
  double mass = 0;               ///< integral of the density
  double slack = 0;              ///< that it was given
  double atoms = 0;              ///< probability of atoms
  double nothing = 0;            ///< share of the samples
  double disagreeing = 0;        ///< share of the samples
  std::string worst;             ///< the fine cell that speaks most against the sampler

  /// What is wrong at a level for each p-value; empty: nothing.
  std::string fault(const Case& c, double level) const;
};

/// Samples of a test: 10^6 where WAVECOMB_LONG is set, fewer in `make test`, fewer still under
/// sanitizers.
size_t usual_samples();

/// Compares `samples` draws with the density.
Result compare(const Case& c, uint32_t seed, size_t samples = usual_samples());

/// Probability that a chi-square variable of `dof` degrees of freedom exceeds x.
double chi_square_p(double x, double dof);

/// p-value of counts against what is expected; cells that expect fewer than 5 are put together. 0
/// where these expect fewer than 5 and have 25 more.
double p_of_counts(const std::vector<double>& observed, const std::vector<double>& expected);

/// Level of each of `tests` independent tests that together err with probability `level` (Z. Sidak,
/// "Rectangular Confidence Regions for the Means of Multivariate Normal Distributions", 1967).
double sidak(double level, size_t tests);

/// The cases of one test. Each battery of the program errs at the level that Sidak's correction
/// leaves of 1 % for all of them, each p-value at what it leaves of that: a right program passes
/// with a probability of 99 % whatever its seeds.
class Battery {
 public:
  explicit Battery(std::string name);
  /// Compares a case; the seed is its number.
  void run(const Case& c);
  /// Takes the p-value of a comparison made elsewhere.
  void add(const std::string& name, double p_value);
  /// Expects all to be well, and prints how many cases there were and the least p-value.
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
