// SPDX-License-Identifier: Apache-2.0
/// Samples of every program, with and without cosine_sampling, follow the density of eval.
#include <gtest/gtest.h>

#include <algorithm>
#include <bit>

#include "parts.h"
#include "program_cases.h"
#include "wavecomb/core/settings.h"
#include "wavecomb/path/steps/bounce_sampling.h"

namespace wavecomb {
namespace {

using namespace program_cases;
using chi_square::Battery;
using chi_square::Draw;
using chi_square::Place;
using chi_square::Random;
using Vec = Vec3<float>;

/// Whether weight and density of a sample agree with eval. Narrow lobes amplify rounding of wi.
bool agrees(const BsdfSample<float>& s, const BsdfEval<float>& e) {
  const auto near = [&](float weight, float f_cos) {
    return std::abs(weight * s.pdf - f_cos) <= 5e-3f * f_cos + 1e-5f * s.pdf;
  };
  return std::abs(e.pdf - s.pdf) <= 5e-3f * s.pdf && near(s.weight.x, e.f_cos.x) &&
         near(s.weight.y, e.f_cos.y) && near(s.weight.z, e.f_cos.z);
}

/// Delta lobes are atoms of the chi-square test, distinguished by side, weight and probability.
template <typename Bsdf>
chi_square::Case sampling_case(std::string name, const Bsdf& bsdf, const Vec& wo) {
  chi_square::Case c;
  c.name = std::move(name) + ", z " + std::to_string(wo.z).substr(0, 5);
  c.charts = bsdf_testing::direction_charts();
  // The density of refraction ends along a curve, where rules over large boxes err by 0.4 %.
  if (Bsdf::kTransmits && is_long()) c.boxes = 60;
  c.density = [&bsdf, wo](const Place& p) {
    return static_cast<double>(bsdf.eval(wo, bsdf_testing::direction_at(p)).pdf);
  };
  c.draw = [&bsdf, wo](Random& random, bool check) {
    const float l = random(), u = random(), v = random();
    const BsdfSample<float> s = bsdf.sample(wo, l, u, v);
    if (!(s.pdf > 0)) return Draw::nothing();
    if (s.is_delta) {
      const auto weight = uint64_t{std::bit_cast<uint32_t>(s.weight.x)};
      return Draw::of_atom(weight << 1 | std::signbit(s.wi.z), static_cast<double>(s.pdf));
    }
    return Draw::at(bsdf_testing::place_of(s.wi), !check || agrees(s, bsdf.eval(wo, s.wi)));
  };
  return c;
}

/// Roughnesses with the cosines at which they are viewed. 0.03 counts as smooth, and 0.032 is the
/// narrowest rough lobe.
struct Seen {
  float roughness;
  std::vector<double> cosines;
};
std::vector<Seen> roughnesses() {
  if (!is_long()) return {{0.032f, {0.6}}, {0.3f, {0.05}}};
  const std::vector<double> all = {0.05, 0.2, 0.6, 0.95};
  return {{0.03f, all}, {0.032f, all}, {0.1f, all}, {0.3f, all}, {1.f, all}};
}

/// Calls f(case, cosines) for each roughness, or once for materials without one.
template <typename Function>
void for_each_case(const Function& f) {
  for (const Row& row : table()) {
    const bool plain = row.program == ProgramId::kDiffuse || row.program == ProgramId::kEmissive;
    for (const auto& [roughness, cosines] : roughnesses()) {
      f(row.at(roughness), cosines);
      if (plain) break;
    }
  }
}

template <typename Wanted>
void expect_follow(const char* name, size_t least, const Wanted& wanted) {
  Battery battery(name);
  size_t seen = 0;
  for_each_case([&](const Case& c, const std::vector<double>& cosines) {
    if (!wanted(c)) return;
    with_bsdf(c, [&](const auto& bsdf) {
      for (const Vec& wo : views(c, cosines)) battery.run(sampling_case(c.name, bsdf, wo));
    });
    ++seen;
  });
  EXPECT_GE(seen, least);
  battery.judge();
}
bool is_layered(const Case& c) {
  return c.program == ProgramId::kPlastic || c.program == ProgramId::kPrincipled;
}

TEST(ProgramSamples, OfMetalsAndGlassFollowTheirDensity) {
  expect_follow("metals and glass", 14,
                [](const Case& c) { return c.program != ProgramId::kOpenPbr && !is_layered(c); });
}
TEST(ProgramSamples, OfPlasticAndPrincipledFollowTheirDensity) {
  expect_follow("plastic and principled", 18, is_layered);
}
TEST(ProgramSamples, OfOpenPbrFollowTheirDensity) {
  expect_follow("OpenPBR", 14,
                [](const Case& c) { return c.program == ProgramId::kOpenPbr && c.two_sided(); });
}
TEST(ProgramSamples, OfOpenPbrThatTransmitsFollowTheirDensity) {
  expect_follow("OpenPBR that transmits", 10,
                [](const Case& c) { return c.program == ProgramId::kOpenPbr && !c.two_sided(); });
}

/// A program whose bounces are sampled with the setting cosine_sampling.
template <typename Bsdf>
struct ByCosine {
  static constexpr bool kTransmits = false;
  const Bsdf& bsdf;
  ShadeSettings settings = [] {
    Settings s;
    s.cosine_sampling = true;
    return ShadeSettings(s);
  }();

  /// Replaces the path vertex, which enables the setting cosine_sampling.
  static constexpr bool has(Feature /*feature*/) { return true; }

  BsdfEval<float> eval(const Vec& wo, const Vec& wi) const {
    const BsdfEval<float> e = bsdf.eval(wo, wi);
    return {e.f_cos, bounce_pdf<Bsdf, float>(*this, bsdf, wo, bsdf.view(wo), wi, e)};
  }
  BsdfSample<float> sample(const Vec& wo, float l, float u, float v) const {
    return sample_bounce<Bsdf, float>(*this, bsdf, wo, bsdf.view(wo), {l, u, v, 0.f});
  }
};

TEST(ProgramSamples, FollowTheDensityOfCosineSampling) {
  Battery battery("cosine sampling");
  for_each_case([&](const Case& c, const std::vector<double>& cosines) {
    with_bsdf(c, [&](const auto& bsdf) {
      using Bsdf = std::decay_t<decltype(bsdf)>;
      if (Bsdf::kTransmits || !Bsdf::kHasNonDelta) return;
      const ByCosine<Bsdf> by_cosine{bsdf};
      battery.run(
          sampling_case(c.name + " by cosine", by_cosine, views(c, {cosines.front()}).back()));
    });
  });
  battery.judge();
}

}  // namespace
}  // namespace wavecomb
