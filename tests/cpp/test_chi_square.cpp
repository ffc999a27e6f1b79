// SPDX-License-Identifier: Apache-2.0
/// Tests of the chi-square test: correct samplers pass at the expected rate, and samplers with
/// faults of 1 and 2 % fail.
#include "chi_square.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "bsdf_testing.h"
#include "parts.h"
#include "wavecomb/core/warp.h"
#include "wavecomb/material/lobes/microfacet_reflection.h"
#include "wavecomb/material/program_table.h"

namespace wavecomb {
namespace {

using bsdf_testing::direction;
using bsdf_testing::kPiD;
using chi_square::Case;
using chi_square::Draw;
using chi_square::Place;
using chi_square::Random;
using chi_square::Result;
using Vec = Vec3<float>;

constexpr double kLevel = 1e-7;
/// `make test-long` uses as many samples as the chi-square batteries of other tests; with fewer
/// samples, only larger faults are detected.
const size_t kSamples = is_long() ? 1000000 : 4 * chi_square::usual_samples();
const double kFault = std::sqrt(1e6 / static_cast<double>(kSamples));

/// Chi-square case of cosine-weighted sampling of the hemisphere.
Case cosine_case() {
  Case c{"cosine",
         bsdf_testing::direction_charts(),
         [](const Place& p) { return p.chart == 0 ? (1 - p.x) / kPiD : 0; },
         {}};
  c.draw = [](Random& random, bool) {
    const float u = random(), v = random();
    return Draw::at(bsdf_testing::place_of(square_to_cosine_hemisphere(u, v)));
  };
  return c;
}

/// Principled material with a narrow lobe, a wide lobe and a delta lobe. The random numbers of its
/// samples can be modified to simulate faults.
struct Principled {
  OpenPbrParams<float> params = bsdf_testing::plain_params();
  Vec wo = direction(0.3, 0.4);

  Principled() {
    params.roughness = 0.1f;
    params.clearcoat = 0.5f;
  }
  /// Makes a chi-square case. `change` modifies the random number that selects the lobe.
  Case make(const std::function<float(float)>& change = [](float l) { return l; }) const {
    const PrincipledBsdf<float> bsdf(params, false);
    Case c{"principled", bsdf_testing::direction_charts(), {}, {}};
    c.density = [bsdf, from = wo](const Place& p) {
      return double{bsdf.eval(from, bsdf_testing::direction_at(p)).pdf};
    };
    c.draw = [bsdf, change, from = wo](Random& random, bool) {
      const float l = change(random()), u = random(), v = random();
      const auto s = bsdf.sample(from, l, u, v);
      if (!(s.pdf > 0)) return Draw::nothing();
      if (s.is_delta) return Draw::of_atom(0, double{s.pdf});
      return Draw::at(bsdf_testing::place_of(s.wi));
    };
    return c;
  }
};

std::string fault(const Case& c, uint32_t seed = 1) {
  return chi_square::compare(c, seed, kSamples).fault(c, kLevel);
}

TEST(ChiSquare, PValuesOfKnownStatistics) {
  // Abramowitz and Stegun, table 26.8.
  EXPECT_NEAR(chi_square::chi_square_p(3.84146, 1), 0.05, 1e-5);
  EXPECT_NEAR(chi_square::chi_square_p(18.3070, 10), 0.05, 1e-5);
  EXPECT_NEAR(chi_square::chi_square_p(149.449, 100), 0.001, 1e-6);
  EXPECT_NEAR(chi_square::chi_square_p(70.0649, 100), 0.99, 1e-5);
  EXPECT_NEAR(chi_square::sidak(0.01, 1), 0.01, 1e-15);
  EXPECT_NEAR(std::pow(1 - chi_square::sidak(0.01, 500), 500), 0.99, 1e-12);
}

TEST(ChiSquare, RightSamplersPassAsOftenAsTheLevelSays) {
  // Test that p-values are uniformly distributed. The Kolmogorov-Smirnov statistic exceeds 1.95 /
  // sqrt(n) with a probability of 0.1 %.
  std::vector<double> fine;
  for (uint32_t seed = 1; seed <= (is_long() ? 400u : 60u); ++seed) {
    const Result r = chi_square::compare(cosine_case(), seed, 4000);
    fine.push_back(r.p_values.at(0));
    EXPECT_NEAR(r.mass, 1, 1e-6);
    EXPECT_EQ(r.nothing, 0);
  }
  std::sort(fine.begin(), fine.end());
  double furthest = 0;
  const auto n = static_cast<double>(fine.size());
  for (size_t i = 0; i < fine.size(); ++i)
    furthest = std::max({furthest, (static_cast<double>(i) + 1) / n - fine[i],
                         fine[i] - static_cast<double>(i) / n});
  EXPECT_LT(furthest, 1.95 / std::sqrt(n));
  EXPECT_EQ(fault(cosine_case()), "");
  EXPECT_EQ(fault(Principled().make()), "");
}

TEST(ChiSquare, FindsDensitiesThatAreOffByOnePercent) {
  for (const double factor : {1 + 0.01 * kFault, 1 - 0.01 * kFault}) {
    Case c = cosine_case();
    c.density = [d = c.density, factor](const Place& p) { return factor * d(p); };
    EXPECT_NE(fault(c), "") << factor;
    c = Principled().make();
    c.density = [d = c.density, factor](const Place& p) { return factor * d(p); };
    EXPECT_NE(fault(c), "") << factor;
  }
}

TEST(ChiSquare, FindsDensitiesThatLeanByTwoPercent) {
  Case c = cosine_case();
  c.density = [d = c.density](const Place& p) {
    return d(p) * (1 + 0.02 * kFault * std::sin(p.y));
  };
  EXPECT_NE(fault(c), "");
  c = cosine_case();
  c.density = [](const Place& p) {
    const double power = 1 + 0.05 * kFault;
    return p.chart == 0 ? (power + 1) / (2 * kPiD) * std::pow(1 - p.x, power) : 0;
  };
  EXPECT_NE(fault(c), "");
}

TEST(ChiSquare, FindsLobesOfAnotherWidth) {
  for (const float alpha : {0.001024f, 0.09f}) {
    const Vec wo = direction(0.05, 0.4);
    const auto make = [&](double factor) {
      const Ggx<float> stated{alpha}, drawn{alpha * static_cast<float>(factor)};
      Case c{"GGX", bsdf_testing::direction_charts(), {}, {}};
      c.density = [=](const Place& p) {
        return double{eval_microfacet(stated, wo, bsdf_testing::direction_at(p)).pdf};
      };
      c.draw = [=](Random& random, bool) {
        const float u = random(), v = random();
        const Vec wi = sample_microfacet(drawn, wo, u, v);
        return wi.z > 0 ? Draw::at(bsdf_testing::place_of(wi)) : Draw::nothing();
      };
      return c;
    };
    EXPECT_EQ(fault(make(1)), "") << alpha;
    EXPECT_NE(fault(make(1 + 0.02 * kFault)), "") << alpha;
    EXPECT_NE(fault(make(1 - 0.02 * kFault)), "") << alpha;
  }
}

TEST(ChiSquare, FindsLobesThatAreChosenTooOften) {
  const Principled material;
  // Tests samplers that select lobes with probabilities that are wrong by about one per cent.
  for (const double percent : {1.0, -1.0}) {
    const auto change = [=](float l) {
      return std::clamp(static_cast<float>(l + 0.01 * kFault * percent * (l < 0.5f ? -1 : 1) *
                                                   std::min(l, 1 - l) * 4),
                        0.f, kOneMinusEpsilon);
    };
    EXPECT_NE(fault(material.make(change)), "") << percent;
  }
}

TEST(ChiSquare, FindsDeltaLobesAndNothingMoreOftenThanStated) {
  Case c = Principled().make();
  c.draw = [draw = c.draw](Random& random, bool check) {
    Draw d = draw(random, check);
    if (d.kind == Draw::Kind::kAtom) d.probability *= 1 - 0.02 * kFault;
    return d;
  };
  EXPECT_NE(fault(c), "");
  c = cosine_case();
  c.draw = [draw = c.draw](Random& random, bool check) {
    const Draw d = draw(random, check);
    return random() < 0.002 * kFault ? Draw::nothing() : d;
  };
  EXPECT_NE(fault(c), "");
  c = cosine_case();
  c.draw = [draw = c.draw](Random& random, bool check) {
    Draw d = draw(random, check);
    d.place.chart = random() < 0.001 * kFault;
    return d;
  };
  EXPECT_NE(fault(c), "");
}

TEST(ChiSquare, FindsNarrowLobesOfAnotherShare) {
  // A narrow lobe should get two per cent of the samples, but gets more than that by a tenth.
  const Vec wo = direction(0.5, 0.4);
  const Ggx<float> ggx{1e-3f};
  constexpr double kShare = 0.02;
  const auto make = [&](double drawn) {
    Case c{"highlight", bsdf_testing::direction_charts(), {}, {}};
    c.density = [=](const Place& p) {
      const Vec wi = bsdf_testing::direction_at(p);
      const double narrow = double{eval_microfacet(ggx, wo, wi).pdf};
      return kShare * narrow + (1 - kShare) * double{cosine_hemisphere_pdf(wi.z)};
    };
    c.draw = [=](Random& random, bool) {
      const bool narrow = random() < drawn;
      const float u = random(), v = random();
      const Vec wi = narrow ? sample_microfacet(ggx, wo, u, v) : square_to_cosine_hemisphere(u, v);
      return Draw::at(bsdf_testing::place_of(wi));
    };
    return c;
  };
  EXPECT_EQ(fault(make(kShare)), "");
  EXPECT_NE(fault(make(kShare + 0.002 * kFault)), "");
}

TEST(ChiSquare, FindsSamplesThatStateAnotherDensity) {
  Case c = cosine_case();
  c.draw = [draw = c.draw](Random& random, bool check) {
    Draw d = draw(random, check);
    d.agrees = random() > 0.01;
    return d;
  };
  EXPECT_NE(fault(c), "");
}

}  // namespace
}  // namespace wavecomb
