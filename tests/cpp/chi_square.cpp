// SPDX-License-Identifier: Apache-2.0
#include "chi_square.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <map>
#include <set>
#include <utility>

#include "chi_square_cells.h"
#include "parts.h"

namespace wavecomb::chi_square {
namespace {

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
constexpr size_t kShortSamples = 4000;
#else
constexpr size_t kShortSamples = 20000;
#endif
constexpr size_t kLongSamples = 1000000;

constexpr size_t kFineSamples = 800;
constexpr size_t kMaxFine = 1024, kMinFine = 16, kCoarse = 32;
/// Number of k-d tree leaves per cell: `kManyLeaves` for tests with many samples, `kFewLeaves` for
/// tests with few samples.
constexpr size_t kManyLeaves = 8, kFewLeaves = 3;
/// Number of test batteries in the whole program, for Sidak's correction.
constexpr size_t kBatteries = 25;

/// Observed and expected counts of cells of about equal mass.
struct Counts {
  std::vector<double> observed, expected;
  void add(double o, double e) {
    observed.push_back(o);
    expected.push_back(e);
  }
};

/// Groups consecutive leaves into cells with an expected count of at least `least` samples each.
/// Leaves with an expected count of 0 form one last cell.
struct Cells {
  Counts counts;
  std::vector<size_t> first_leaf;
};
Cells gather_cells(const Counts& leaves, double least) {
  Cells cells;
  double o = 0, e = 0, empty_o = 0, empty_e = 0;
  size_t first = 0;
  for (size_t i = 0; i < leaves.observed.size(); ++i) {
    const bool is_empty = leaves.expected[i] < 1e-3;
    (is_empty ? empty_o : o) += leaves.observed[i];
    (is_empty ? empty_e : e) += leaves.expected[i];
    const bool last = i + 1 == leaves.observed.size();
    if (e < least && !last) continue;
    if (last && e < 0.5 * least && !cells.first_leaf.empty()) {
      cells.counts.observed.back() += o;
      cells.counts.expected.back() += e;
      break;
    }
    cells.counts.add(o, e);
    cells.first_leaf.push_back(first);
    o = e = 0;
    first = i + 1;
  }
  cells.counts.add(empty_o, empty_e);
  return cells;
}

/// Identifies an atom. Draws with the same id but different probabilities count as different atoms.
using AtomKey = std::pair<uint64_t, double>;

std::string describe(const Leaves::Leaf& leaf, double observed, double expected) {
  char text[200];
  std::snprintf(text, sizeof text, "%.0f samples for %.1f in a cell from chart %u (%g, %g) on",
                observed, expected, leaf.chart, leaf.box.low[0], leaf.box.low[1]);
  return text;
}

std::set<std::string>& battery_names() {
  static std::set<std::string> names;
  return names;
}

}  // namespace

size_t usual_samples() {
  return is_long() ? kLongSamples : kShortSamples;
}

/// The regularised upper incomplete gamma function Q(dof / 2, x / 2) (Numerical Recipes,
/// section 6.2).
double chi_square_p(double x, double dof) {
  const double a = 0.5 * dof, y = 0.5 * x;
  if (y <= 0) return 1;
  const double front = std::exp(-y + a * std::log(y) - std::lgamma(a));
  if (y < a + 1) {
    double term = 1 / a, sum = term;
    for (int n = 1; n < 10000 && term > sum * 1e-15; ++n) sum += term *= y / (a + n);
    return 1 - sum * front;
  }
  double b = y + 1 - a, c = 1e300, d = 1 / b, h = d;
  for (int i = 1; i < 10000; ++i) {
    const double an = -i * (i - a);
    b += 2;
    d = 1 / (an * d + b);
    c = b + an / c;
    const double delta = d * c;
    h *= delta;
    if (std::abs(delta - 1) < 1e-14) break;
  }
  return front * h;
}

double p_of_counts(const std::vector<double>& observed, const std::vector<double>& expected) {
  double statistic = 0, rare_observed = 0, rare_expected = 0;
  int used = 0;
  const auto add = [&](double o, double e) {
    statistic += (o - e) * (o - e) / e;
    ++used;
  };
  for (size_t i = 0; i < observed.size(); ++i) {
    if (expected[i] >= 5) {
      add(observed[i], expected[i]);
    } else {
      rare_observed += observed[i];
      rare_expected += expected[i];
    }
  }
  if (rare_expected >= 5)
    add(rare_observed, rare_expected);
  else if (rare_observed > rare_expected + 25)
    return 0;
  return used > 1 ? chi_square_p(statistic, used - 1) : 1;
}

double sidak(double level, size_t tests) {
  return -std::expm1(std::log1p(-level) / static_cast<double>(tests));
}

std::string Result::fault(const Case& c, double level) const {
  std::string text;
  char line[240];
  for (size_t i = 0; i < p_values.size(); ++i)
    if (!(p_values[i] > level)) {
      std::snprintf(line, sizeof line, "p-value %.2g of %s cells below %.2g (%s). ", p_values[i],
                    i == 0 ? "fine" : "coarse", level, worst.c_str());
      text += line;
    }
  if (!(mass + atoms < 1 + slack)) {
    std::snprintf(line, sizeof line, "Densities add up to %.6f. ", mass + atoms);
    text += line;
  }
  if (!(disagreeing <= c.odd)) {
    std::snprintf(line, sizeof line, "%.3g of the samples state another density or weight. ",
                  disagreeing);
    text += line;
  }
  if (!text.empty()) {
    std::snprintf(line, sizeof line, "Mass %.6f, atoms %.6f, nothing %.6f.", mass, atoms, nothing);
    text += line;
  }
  return text;
}

Result compare(const Case& c, uint32_t seed, size_t samples) {
  Random random(seed);
  Result result;
  const size_t fine = std::clamp(samples / kFineSamples, kMinFine, kMaxFine);
  std::vector<Place> pilot;
  for (size_t i = 0; i < samples / 8; ++i) {
    const Draw d = c.draw(random, false);
    if (d.kind == Draw::Kind::kPlace) pilot.push_back(d.place);
  }
  const size_t leaf_count = fine * (samples < kLongSamples / 2 ? kFewLeaves : kManyLeaves);
  const size_t points = std::max<size_t>(samples / 8 / leaf_count, 4);
  const Leaves leaves(c, pilot, points);

  Counts of_leaves;
  of_leaves.observed.assign(leaves.all().size(), 0);
  std::map<AtomKey, double> atoms;
  size_t nothing = 0, checked = 0, disagreeing = 0;
  for (size_t i = 0; i < samples; ++i) {
    const bool check = i % 8 == 0;
    const Draw d = c.draw(random, check);
    if (d.kind == Draw::Kind::kPlace)
      of_leaves.observed[leaves.find(d.place)] += 1;
    else if (d.kind == Draw::Kind::kAtom)
      atoms[{d.atom, d.probability}] += 1;
    else
      ++nothing;
    checked += check;
    disagreeing += check && !d.agrees;
  }

  const auto n = static_cast<double>(samples);
  const double tolerance = 0.01 / static_cast<double>(leaf_count);
  std::vector<Integral> integrals;
  for (uint32_t i = 0; i < c.charts.size(); ++i) integrals.emplace_back(c, i, pilot);
  for (const Leaves::Leaf& leaf : leaves.all()) {
    const double mass = integrals[leaf.chart].over(leaf.box, leaf.first, leaf.last, tolerance);
    result.mass += mass;
    of_leaves.expected.push_back(mass * n);
  }
  for (const auto& [key, count] : atoms) result.atoms += key.second;
  result.nothing = static_cast<double>(nothing) / n;
  result.disagreeing = static_cast<double>(disagreeing) / static_cast<double>(checked);

  // The probability that the sampler returns no sample is 1 minus the integral of the density and
  // the probabilities of all atoms. Ignore deviations within the tolerance, since the integral has
  // an error.
  result.slack = std::max(c.slack, 60 / n);
  const double left = std::max(0.0, 1 - result.mass - result.atoms) * n;
  const double beyond =
      std::max(0.0, std::abs(static_cast<double>(nothing) - left) - result.slack * n);
  const double counted = static_cast<double>(nothing) > left ? left + beyond : left - beyond;
  for (const size_t number : {fine, kCoarse}) {
    if (number == kCoarse && fine <= kCoarse) break;
    Cells cells = gather_cells(of_leaves, n / static_cast<double>(number));
    if (number == fine) {
      double largest = -1;
      for (size_t i = 0; i < cells.first_leaf.size(); ++i) {
        const double o = cells.counts.observed[i], e = cells.counts.expected[i];
        const double x = (o - e) * (o - e) / std::max(e, 1.0);
        if (x <= largest) continue;
        largest = x;
        result.worst = describe(leaves.all()[cells.first_leaf[i]], o, e);
      }
    }
    for (const auto& [key, count] : atoms) cells.counts.add(count, key.second * n);
    if (left > 0 || counted > 0) cells.counts.add(counted, std::max(left, 1e-9));
    result.p_values.push_back(p_of_counts(cells.counts.observed, cells.counts.expected));
  }
  return result;
}

Battery::Battery(std::string name) : name_(std::move(name)) {
  battery_names().insert(name_);
  EXPECT_LE(battery_names().size(), kBatteries) << "kBatteries says how many there are";
}

void Battery::run(const Case& c) {
  const auto seed = static_cast<uint32_t>(entries_.size() + 1);
  const auto start = std::chrono::steady_clock::now();
  const Result result = compare(c, seed);
  if (is_long()) {
    const std::chrono::duration<double> seconds = std::chrono::steady_clock::now() - start;
    std::printf("%s: %.1f s, p %.2g\n", c.name.c_str(), seconds.count(),
                *std::min_element(result.p_values.begin(), result.p_values.end()));
    std::fflush(stdout);
  }
  // Store the case without its functions: these may refer to objects that no longer exist when
  // judge() runs.
  entries_.push_back({{c.name, {}, {}, {}, c.odd}, result});
}

void Battery::add(const std::string& name, double p_value) {
  Result result;
  result.p_values = {p_value};
  result.slack = 1;
  entries_.push_back({{name, {}, {}, {}, 1}, result});
}

void Battery::judge() const {
  size_t tests = 0;
  double least = 1;
  for (const Entry& e : entries_)
    for (const double p : e.result.p_values) {
      ++tests;
      least = std::min(least, p);
    }
  ASSERT_GT(tests, 0u);
  const double level = sidak(sidak(0.01, kBatteries), tests);
  for (const Entry& e : entries_)
    EXPECT_EQ(e.result.fault(e.c, level), "") << name_ << ": " << e.c.name;
  std::printf("%s: %zu cases of %zu samples, %zu tests, least p %.2g, level %.2g\n", name_.c_str(),
              entries_.size(), usual_samples(), tests, least, level);
}

}  // namespace wavecomb::chi_square
