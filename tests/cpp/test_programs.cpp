// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <random>
#include <string>
#include <vector>

#include "parts.h"
#include "program_cases.h"
#include "wavecomb/path/program_reads.h"

namespace wavecomb {
namespace {

using bsdf_testing::direction;
using bsdf_testing::furnace;
using bsdf_testing::kronecker;
using bsdf_testing::params_for;
using bsdf_testing::plain_params;
using namespace program_cases;
using Vec = Vec3<float>;

TEST(Programs, TableFindsEachProgram) {
  for (uint32_t i = 0; i < kSurfaceProgramCount; ++i) {
    int visits = 0;
    visit_program<float>(static_cast<ProgramId>(i), [&]<typename Bsdf>() {
      EXPECT_EQ(static_cast<uint32_t>(Bsdf::kProgram), i);
      EXPECT_EQ(Bsdf::kEmits, can_emit(Bsdf::kProgram)) << kProgramNames[i];
      const ProgramReads reads = reads_of(Bsdf::kProgram);
      EXPECT_EQ(reads.inputs & ~input_bit(Input::kEmission), Bsdf::kInputs) << kProgramNames[i];
      EXPECT_EQ(reads.ior, Bsdf::kReadsIor) << kProgramNames[i];
      ++visits;
    });
    EXPECT_EQ(visits, 1);
  }
}

TEST(Programs, DeltaLobesAreChosenAsOftenAsStated) {
  // cosine_sampling scales the density of other lobes by 1 - delta_probability. Random numbers are
  // stratified, so the error is one stratum per lobe.
  for (const Case& c : usual_cases())
    with_bsdf(c, [&](const auto& bsdf) {
      for (const Vec& wo : views(c)) {
        constexpr int kSamples = 1000;
        double deltas = 0;
        for (int i = 0; i < kSamples; ++i) {
          const auto [l, u, v] = kronecker(static_cast<uint32_t>(i));
          deltas += bsdf.sample(wo, (static_cast<float>(i) + 0.5f) / kSamples, u, v).is_delta;
        }
        EXPECT_NEAR(deltas / kSamples, bsdf.delta_probability(wo), 3e-3) << c.name << " " << wo.z;
      }
    });
}

TEST(Programs, WeightIsValueOverDensity) {
  for (const Case& c : usual_cases())
    with_bsdf(c, [&](const auto& bsdf) {
      for (const Vec& wo : views(c))
        for (uint32_t i = 0; i < 500; ++i) {
          const auto [l, u, v] = kronecker(i);
          const auto s = bsdf.sample(wo, l, u, v);
          EXPECT_NEAR(length(s.wi), 1, 1e-5f);
          if (s.pdf <= 0) {
            EXPECT_TRUE(is_black(s.weight)) << c.name;
            continue;
          }
          const auto e = bsdf.eval(wo, s.wi);
          if (s.is_delta) {
            EXPECT_LE(s.pdf, 1.f) << c.name;
            EXPECT_EQ(s.roughness, 0.f) << c.name;
            continue;
          }
          // Narrow lobes amplify the rounding of wi.
          EXPECT_NEAR(e.pdf / s.pdf, 1, 5e-3) << c.name << " " << wo.z;
          EXPECT_NEAR(s.weight.x, e.f_cos.x / e.pdf, 5e-3 * s.weight.x + 1e-5)
              << c.name << " " << wo.z;
          EXPECT_NEAR(s.weight.z, e.f_cos.z / e.pdf, 5e-3 * s.weight.z + 1e-5)
              << c.name << " " << wo.z;
          EXPECT_EQ(s.eta != 1.f, s.wi.z * wo.z < 0 && c.bends()) << c.name;
        }
    });
}

TEST(Programs, DiffusePartIsOfTheWhole) {
  for (const Case& c : usual_cases())
    with_bsdf(c, [&](const auto& bsdf) {
      double diffuse = 0, rest = 0;
      for (const Vec& wo : views(c))
        for (uint32_t i = 0; i < 300; ++i) {
          const auto [l, u, v] = kronecker(i);
          const Vec wi = direction(2.0 * u - 1, 7.0 * v);
          const Vec whole = bsdf.eval(wo, wi).f_cos, part = bsdf.diffuse_f_cos(wo, wi);
          for (const auto& [a, b] :
               {std::pair(part.x, whole.x), {part.y, whole.y}, {part.z, whole.z}}) {
            EXPECT_GE(a, 0.f) << c.name;
            EXPECT_LE(a, b * 1.00001f) << c.name << " " << wo.z << " " << wi.z;
          }
          diffuse += part.x;
          rest += whole.x - part.x;
        }
      if (c.program != ProgramId::kOpenPbr) return;
      // Metal and glass have no diffuse part; EON without a specular lobe has only a diffuse part.
      const P& p = c.params;
      const bool opaque = p.metallic < 1 && p.transmission_weight < 1;
      EXPECT_EQ(diffuse > 0, opaque) << c.name;
      if (c.name.find("reciprocal diffuse") != std::string::npos) {
        EXPECT_NEAR(rest, 0, 1e-5 * diffuse) << c.name;
      }
    });
}

TEST(Programs, WhatIsNotReflectedPassesStraight) {
  // A white surface neither absorbs nor adds light, whatever its opacity, roughness and coat. The
  // fits of albedos (lobes/rough_interface.h, lobes/multiple_scattering.h) lose up to 3 %.
  using Bsdf = PrincipledBsdf<float, kAllParts>;
  for (const float opacity : {0.f, 0.3f, 0.8f})
    for (const float roughness : {0.f, 0.3f, 0.7f})
      for (const float coat : {0.f, 1.f})
        for (const float metallic : {0.f, 0.5f}) {
          auto p = plain_params();
          p.base_color = {1, 1, 1};
          p.opacity = opacity;
          p.roughness = roughness;
          p.clearcoat = coat;
          p.clearcoat_roughness = 0.2f;
          p.metallic = metallic;
          const auto params = params_for<Bsdf, float>(p);
          const Bsdf bsdf(params, false);
          const PrincipledLayers<float, kAllParts> layers(params, false);
          for (const float z : {0.2f, 0.6f, 1.f}) {
            const Vec straight = layers.straight(z);
            EXPECT_NEAR(layers.passing_probability(straight), straight.x, 1e-5f);
            const double whole = furnace(bsdf, direction(z, 1), 4000) + double{straight.x};
            EXPECT_LT(whole, 1.015) << opacity << " " << roughness << " " << coat << " " << z;
            // Where a surface is partly metallic, its base absorbs light.
            if (metallic > 0) continue;
            EXPECT_GT(whole, 0.96) << opacity << " " << roughness << " " << coat << " " << z;
          }
        }
}

TEST(Programs, TintedTransmissionIsSharedWithTraversal) {
  // Traversal transmits the smallest component, and the BSDF a delta lobe with the rest.
  using Bsdf = PrincipledBsdf<float, kAllParts>;
  auto p = plain_params();
  p.base_color = {0.9f, 0.6f, 0.2f};
  p.metallic = 0.8f;
  p.opacity = 0.25f;
  p.roughness = 0.3f;
  const auto params = params_for<Bsdf, float>(p);
  const Bsdf bsdf(params, false);
  const Vec wo = direction(0.7, 2),
            straight = PrincipledLayers<float, kAllParts>(params, false).straight(wo.z);
  EXPECT_LT(straight.x, straight.z);
  Vec passed(0.f);
  for (uint32_t i = 0; i < 1000; ++i) {
    const auto s = bsdf.sample(wo, (static_cast<float>(i) + 0.5f) / 1000, 0.4f, 0.3f);
    if (s.is_delta && s.wi.z < 0) passed = s.weight * s.pdf;
  }
  EXPECT_NEAR(passed.x, 0, 1e-6f);
  EXPECT_NEAR(passed.z, straight.z - straight.x, 1e-5f);
}

TEST(Programs, ThinWallsShareTransmissionWithTraversal) {
  // Traversal and the BSDF of a stopped path together transmit as much as the wall, and other lobes
  // do not change.
  using Bsdf = OpenPbrBsdf<float, kAllParts>;
  for (const float coat : {0.f, 0.6f})
    for (const float fuzz : {0.f, 0.5f})
      for (const float glass : {0.4f, 1.f})
        for (const Vec& tint : {Vec(1, 1, 1), Vec(0.9f, 0.6f, 0.3f)})
          for (const float z : {0.1f, 0.5f, 1.f}) {
            auto p = plain_params();
            p.roughness = p.clearcoat_roughness = 0;
            p.thin_walled = 1;
            p.transmission_weight = glass;
            p.transmission_tint = tint;
            p.clearcoat = coat;
            p.coat_color = {0.9f, 0.8f, 0.9f};
            p.fuzz_weight = fuzz;
            const Bsdf whole(p, false);
            const Vec wo = direction(z, 1);
            const Vec passed = whole.straight(whole.view(wo));
            const float passing = std::min({passed.x, passed.y, passed.z});
            EXPECT_GT(passing, 0.f);
            p.flags = kTransmitsStraight;
            const Bsdf rest(p, false);
            // Light paths and camera paths view the wall from two directions, and must agree on its
            // densities, which therefore depend on the view only.
            const Vec other = direction(0.35, 2);
            p.opacity = 0.3f;
            EXPECT_EQ(Bsdf(p, false).eval(other, wo).pdf, rest.eval(other, wo).pdf);
            const auto sums = [&wo](const Bsdf& bsdf) {
              std::pair<Vec, Vec> sum(Vec(0.f), Vec(0.f));  // straight; other
              constexpr int kSamples = 20000;
              for (uint32_t i = 0; i < kSamples; ++i) {
                const auto [l, u, v] = kronecker(i);
                const auto s = bsdf.sample(wo, l, u, v);
                (s.is_delta && s.wi.z < 0 ? sum.first : sum.second) += s.weight * (1.f / kSamples);
              }
              return sum;
            };
            const auto [a, b] = sums(whole);
            const auto [c, d] = sums(rest);
            EXPECT_NEAR(c.x + passing, a.x, 0.02f * a.x) << coat << fuzz << glass << z;
            EXPECT_NEAR(c.z + passing, a.z, 0.02f * a.z) << coat << fuzz << glass << z;
            EXPECT_NEAR(d.x, b.x, 0.02f * b.x + 1e-3f) << coat << fuzz << glass << z;
            EXPECT_NEAR(d.z, b.z, 0.02f * b.z + 1e-3f) << coat << fuzz << glass << z;
          }
}

TEST(Programs, ReciprocityHolds) {
  // f(o, i) / n_o^2 = f(i, o) / n_i^2 (Veach 1997, eq. 5.14).
  std::mt19937 rng(11);
  std::uniform_real_distribution<double> unit(-1, 1);
  for (const Case& c : usual_cases()) {
    if (!c.reciprocal()) continue;
    with_bsdf(c, [&](const auto& bsdf) {
      int compared = 0;
      for (int i = 0; i < 2000; ++i) {
        const Vec wo = direction(unit(rng), 4 * unit(rng));
        const Vec wi = direction(unit(rng), 4 * unit(rng));
        if (std::abs(wo.z) < 0.02f || std::abs(wi.z) < 0.02f) continue;
        const auto index = [&](const Vec& w) { return c.two_sided() || w.z > 0 ? 1.0 : c.ior(); };
        const auto a = bsdf.eval(wo, wi), b = bsdf.eval(wi, wo);
        const double x = a.f_cos.x / std::abs(wi.z) * std::pow(index(wi), 2);
        const double y = b.f_cos.x / std::abs(wo.z) * std::pow(index(wo), 2);
        // The absolute tolerance is for 1 - F near the critical angle, where its slope is infinite.
        EXPECT_NEAR(x, y, 2e-3 * std::max(x, y) + 1e-5) << c.name << " " << wo.z << " " << wi.z;
        compared += x > 0;
      }
      if (bsdf.has_non_delta()) {
        EXPECT_GT(compared, 50) << c.name;
      }
    });
  }
}

TEST(Programs, WhiteFurnaceNeverGains) {
  size_t index = 0;
  for (Case c : usual_cases()) {
    // Most materials have three roughnesses, so that each roughness is in some cases.
    if (!includes_case(index++, 4)) continue;
    c.params.base_color = Vec(1, 1, 1);
    with_bsdf(c, [&](const auto& bsdf) {
      for (const Vec& wo : views(c)) EXPECT_LE(furnace(bsdf, wo), 1.004) << c.name << " " << wo.z;
    });
  }
}

TEST(Programs, LosslessMaterialsPassTheWhiteFurnace) {
  const Vec white(1, 1, 1);
  const auto expect = [](const Case& c, double low) {
    with_bsdf(c, [&](const auto& bsdf) {
      for (const Vec& wo : views(c)) {
        const double energy = furnace(bsdf, wo);
        EXPECT_GE(energy, low) << c.name << " " << wo.z;
        EXPECT_LE(energy, 1.004) << c.name << " " << wo.z;
      }
    });
  };
  expect(make_case("diffuse", ProgramId::kDiffuse, [&](P& p) { p.base_color = white; }), 0.99999);
  for (float ior : {0.5f, 1.f, 1.33f, 2.f})
    expect(make_case("glass", ProgramId::kDielectric,
                     [&](P& p) { p.base_color = white, p.roughness = 0, p.ior = ior; }),
           0.99999);
  for (float r : {0.02f, 0.1f, 0.2f})
    expect(make_case("rough glass", ProgramId::kDielectric,
                     [&](P& p) { p.base_color = white, p.roughness = r; }),
           0.9);
  for (bool schlick : {false, true})
    expect(make_case(
               "smooth plastic", ProgramId::kPlastic,
               [&](P& p) { p.base_color = white, p.roughness = 0; }, schlick),
           0.996);
  for (bool schlick : {false, true})
    expect(make_case(
               "smooth principled", ProgramId::kPrincipled,
               [&](P& p) { p.base_color = white, p.roughness = 0; }, schlick),
           0.996);
  expect(
      make_case("mirror", ProgramId::kMetal, [&](P& p) { p.base_color = white, p.roughness = 0; }),
      0.99999);
}

TEST(Programs, MultipleScatteringKeepsTheEnergyOfMetals) {
  // The fit of lost energy is accurate to 2 % (see LostEnergy).
  size_t index = 0;
  for (float alpha : {0.1f, 0.2f, 0.3f, 0.5f, 0.7f, 1.f})
    for (const ProgramId id : {ProgramId::kMetal, ProgramId::kPrincipled}) {
      if (!includes_case(index++, 3)) continue;
      const Case c = make_case("white metal", id, [&](P& p) {
        p.base_color = Vec(1, 1, 1), p.metallic = 1, p.roughness = std::sqrt(alpha);
      });
      with_bsdf(c, [&](const auto& bsdf) {
        for (double z : {0.05, 0.1, 0.2, 0.4, 0.6, 0.8, 1.0}) {
          EXPECT_GE(furnace(bsdf, direction(z, 1)), 0.975) << alpha << " " << z;
          EXPECT_LE(furnace(bsdf, direction(z, 1)), 1.003) << alpha << " " << z;
        }
      });
    }
}

template <typename Bsdf, typename F>
void record_bits(const Bsdf& bsdf, const Vec3<F>& wo, const Vec3<F>& wi, const F& l, const F& u,
                 const F& v, float* out) {
  const auto e = bsdf.eval(wo, wi);
  const auto s = bsdf.sample(wo, l, u, v);
  const Color<F> a = bsdf.albedo();
  const F values[] = {e.f_cos.x,
                      e.f_cos.y,
                      e.f_cos.z,
                      e.pdf,
                      s.wi.x,
                      s.wi.y,
                      s.wi.z,
                      s.weight.x,
                      s.weight.y,
                      s.weight.z,
                      s.pdf,
                      s.eta,
                      s.roughness,
                      select(s.is_delta, F(1.f), F(0.f)),
                      a.x,
                      a.y,
                      a.z,
                      select(bsdf.has_non_delta(), F(1.f), F(0.f)),
                      bsdf.delta_probability(wo)};
  for (const F& value : values) {
    wavecomb::store(out, value);
    out += kWidth<F>;
  }
}
constexpr size_t kRecorded = 19;

/// Random inputs of every kind, some at the ends of their range.
struct Inputs {
  OpenPbrParams<float> params;
  Vec wo, wi;
  float l, u, v;
};
Inputs random_inputs(std::mt19937& rng) {
  std::uniform_real_distribution<float> unit(0, 0x1.fffffep-1f);
  const auto edgy = [&] {
    const float x = unit(rng);
    return x < 0.1f ? 0.f : (x > 0.9f ? 1.f : unit(rng));
  };
  Inputs in;
  in.params = plain_params();
  in.params.base_color = Vec(edgy(), edgy(), edgy());
  in.params.specular_color = Vec(edgy(), edgy(), edgy());
  in.params.roughness = edgy();
  in.params.metallic = edgy();
  in.params.clearcoat = edgy();
  in.params.clearcoat_roughness = edgy();
  in.params.opacity = edgy();
  const float iors[] = {0.1f, 0.5f, 0.999f, 1.f, 1.0001f, 1.33f, 1.5f, 2.4f, 10.f};
  in.params.ior = iors[rng() % 9];
  in.params.conductor_eta = Vec(3 * edgy(), 3 * edgy(), 3 * edgy());
  in.params.conductor_k = Vec(5 * edgy(), 5 * edgy(), 5 * edgy());
  in.params.flags = rng() % 8;
  P& p = in.params;
  const auto colour = [&] { return Vec(edgy(), edgy(), edgy()); };
  for (float* x : {&p.diffuse_roughness, &p.specular_weight, &p.anisotropy, &p.rotation,
                   &p.transmission_weight, &p.subsurface_weight, &p.subsurface_anisotropy,
                   &p.fuzz_weight, &p.fuzz_roughness, &p.coat_darkening, &p.film_weight})
    *x = edgy();
  for (Vec* c : {&p.transmission_tint, &p.subsurface_color, &p.fuzz_color, &p.coat_color})
    *c = colour();
  p.coat_ior = iors[rng() % 9];
  p.film_thickness = 2000 * edgy();
  p.film_ior = 1 + edgy();
  p.thin_walled = static_cast<float>(rng() % 2);
  p.subsurface = p.thin_walled > 0 ? 0.f : static_cast<float>(rng() % 3);
  const auto any_direction = [&] {
    const double grazing[] = {0, 1e-7, -1e-7, 1e-3, -1e-3, 1, -1};
    const double z = rng() % 4 == 0 ? grazing[rng() % 7] : 2.0 * unit(rng) - 1;
    Vec w = direction(z, 7 * unit(rng));
    if (z == 0 && rng() % 2) w.z = -0.f;
    return w;
  };
  in.wo = any_direction();
  in.wi = any_direction();
  if (rng() % 8 == 0) in.wi = -in.wo;
  if (rng() % 8 == 0) in.wi = Vec(-in.wo.x, -in.wo.y, in.wo.z);
  const float ends[] = {0.f, 0x1.fffffep-1f};
  in.l = rng() % 8 == 0 ? ends[rng() % 2] : unit(rng);
  in.u = rng() % 8 == 0 ? ends[rng() % 2] : unit(rng);
  in.v = rng() % 8 == 0 ? ends[rng() % 2] : unit(rng);
  return in;
}

template <size_t W>
void expect_packet_equals_scalar(ProgramId id) {
  using F = FloatP<W>;
  std::mt19937 rng(101 + W);
  for (int round = 0; round < 3000 / static_cast<int>(W) * 4; ++round) {
    const bool schlick = round % 3 == 0;
    Inputs in[W];
    for (Inputs& i : in) i = random_inputs(rng);
    const auto packet = [&](auto get) {
      float lanes[W];
      for (size_t i = 0; i < W; ++i) lanes[i] = get(in[i]);
      return wavecomb::load<F>(lanes);
    };
    const auto vec = [&](auto get) {
      return Vec3<F>(packet([&](const Inputs& i) { return get(i).x; }),
                     packet([&](const Inputs& i) { return get(i).y; }),
                     packet([&](const Inputs& i) { return get(i).z; }));
    };
    OpenPbrParams<F> p;
    p.energy = in[0].params.energy;
    using Q = OpenPbrParams<F>;
    const std::pair<Vec P::*, Color<F> Q::*> colours[] = {
        {&P::transmission_tint, &Q::transmission_tint},
        {&P::extinction, &Q::extinction},
        {&P::subsurface_color, &Q::subsurface_color},
        {&P::fuzz_color, &Q::fuzz_color},
        {&P::coat_color, &Q::coat_color}};
    for (const auto& [from, to] : colours)
      p.*to = vec([from = from](const Inputs& i) { return i.params.*from; });
    const std::pair<float P::*, F Q::*> numbers[] = {
        {&P::diffuse_roughness, &Q::diffuse_roughness},
        {&P::specular_weight, &Q::specular_weight},
        {&P::anisotropy, &Q::anisotropy},
        {&P::rotation, &Q::rotation},
        {&P::transmission_weight, &Q::transmission_weight},
        {&P::subsurface_weight, &Q::subsurface_weight},
        {&P::subsurface_anisotropy, &Q::subsurface_anisotropy},
        {&P::fuzz_weight, &Q::fuzz_weight},
        {&P::fuzz_roughness, &Q::fuzz_roughness},
        {&P::coat_ior, &Q::coat_ior},
        {&P::coat_darkening, &Q::coat_darkening},
        {&P::film_weight, &Q::film_weight},
        {&P::film_thickness, &Q::film_thickness},
        {&P::film_ior, &Q::film_ior},
        {&P::thin_walled, &Q::thin_walled},
        {&P::subsurface, &Q::subsurface}};
    for (const auto& [from, to] : numbers)
      p.*to = packet([from = from](const Inputs& i) { return i.params.*from; });
    p.base_color = vec([](const Inputs& i) { return i.params.base_color; });
    p.specular_color = vec([](const Inputs& i) { return i.params.specular_color; });
    p.emission = vec([](const Inputs& i) { return i.params.emission; });
    p.roughness = packet([](const Inputs& i) { return i.params.roughness; });
    p.metallic = packet([](const Inputs& i) { return i.params.metallic; });
    p.clearcoat = packet([](const Inputs& i) { return i.params.clearcoat; });
    p.clearcoat_roughness = packet([](const Inputs& i) { return i.params.clearcoat_roughness; });
    p.opacity = packet([](const Inputs& i) { return i.params.opacity; });
    p.normal = vec([](const Inputs& i) { return i.params.normal; });
    p.ior = packet([](const Inputs& i) { return i.params.ior; });
    p.conductor_eta = vec([](const Inputs& i) { return i.params.conductor_eta; });
    p.conductor_k = vec([](const Inputs& i) { return i.params.conductor_k; });
    p.flags =
        float_bits<F>(packet([](const Inputs& i) { return std::bit_cast<float>(i.params.flags); }));
    float wide[kRecorded * W], narrow[kRecorded];
    visit_program<F>(id, [&]<typename Bsdf>() {
      record_bits<Bsdf, F>(
          Bsdf(params_for<Bsdf>(p), schlick), vec([](const Inputs& i) { return i.wo; }),
          vec([](const Inputs& i) { return i.wi; }), packet([](const Inputs& i) { return i.l; }),
          packet([](const Inputs& i) { return i.u; }), packet([](const Inputs& i) { return i.v; }),
          wide);
    });
    for (size_t i = 0; i < W; ++i) {
      visit_program<float>(id, [&]<typename Bsdf>() {
        record_bits<Bsdf, float>(Bsdf(params_for<Bsdf>(in[i].params), schlick), in[i].wo, in[i].wi,
                                 in[i].l, in[i].u, in[i].v, narrow);
      });
      for (size_t k = 0; k < kRecorded; ++k)
        ASSERT_EQ(std::bit_cast<uint32_t>(narrow[k]), std::bit_cast<uint32_t>(wide[k * W + i]))
            << kProgramNames[static_cast<int>(id)] << " width " << W << " value " << k << ": "
            << narrow[k] << " and " << wide[k * W + i];
    }
  }
}

TEST(Programs, PacketEqualsScalarBitForBit) {
  for (uint32_t i = 0; i < kSurfaceProgramCount; ++i) {
    const auto id = static_cast<ProgramId>(i);
    expect_packet_equals_scalar<4>(id);
    expect_packet_equals_scalar<8>(id);
    expect_packet_equals_scalar<16>(id);
  }
}

/// Returns `p` with only these material features.
P with_parts(P p, ProgramId program, uint32_t parts) {
  const auto lacks = [parts](Part part) { return (parts & part) == 0; };
  if (lacks(kMetalPart)) {
    p.metallic = 0;
    p.flags &= ~uint32_t{kSpecularWorkflow};
  }
  if (lacks(kCoatPart)) p.clearcoat = 0;
  if (lacks(kTransmissionPart)) p.transmission_weight = 0;
  if (lacks(kTransmissionPart) && program == ProgramId::kPrincipled) p.opacity = 1;
  if (lacks(kBackDiffusePart)) (p.metallic > 0.5f ? p.thin_walled : p.subsurface_weight) = 0;
  if (lacks(kBackDiffusePart)) p.subsurface = 0;
  if (lacks(kFuzzPart)) p.fuzz_weight = 0;
  if (lacks(kFilmPart)) p.film_weight = 0;
  if (lacks(kAnisotropyPart)) p.anisotropy = p.rotation = 0;
  return p;
}

template <uint32_t kVariant>
void expect_variant_equals_program() {
  constexpr ProgramId kId = program_of(kVariant);
  if constexpr (kVariant >= kProgramCount) {
    using Full = Program<kId, float>;
    using Least = VariantBsdf<kVariant, float>;
    std::mt19937 rng(500 + kVariant);
    for (int round = 0; round < 20000; ++round) {
      const Inputs in = random_inputs(rng);
      const P params = with_parts(in.params, kId, kVariants[kVariant].parts);
      float full[kRecorded], least[kRecorded];
      record_bits<Full, float>(Full(params, round % 5 == 0), in.wo, in.wi, in.l, in.u, in.v, full);
      record_bits<Least, float>(Least(params, round % 5 == 0), in.wo, in.wi, in.l, in.u, in.v,
                                least);
      for (size_t k = 0; k < kRecorded; ++k)
        ASSERT_EQ(std::bit_cast<uint32_t>(full[k]), std::bit_cast<uint32_t>(least[k]))
            << kVariants[kVariant].name << " value " << k << ": " << full[k] << " and " << least[k]
            << " round " << round;
    }
  }
}

TEST(Programs, VariantsEqualTheirProgramsBitForBit) {
  [&]<size_t... kVariant>(std::index_sequence<kVariant...>) {
    (expect_variant_equals_program<kVariant>(), ...);
  }(std::make_index_sequence<kVariantCount>());
}

TEST(Programs, NoInputGivesNonsense) {
  std::mt19937 rng(77);
  for (uint32_t id = 0; id < kSurfaceProgramCount; ++id)
    for (int round = 0; round < (is_long() ? 60000 : 15000); ++round) {
      const Inputs in = random_inputs(rng);
      visit_program<float>(static_cast<ProgramId>(id), [&]<typename Bsdf>() {
        const float own = static_cast<float>(round % 5) / 4;
        const Bsdf bsdf(params_for<Bsdf>(in.params, own), round % 3 == 0);
        const auto e = bsdf.eval(in.wo, in.wi);
        const auto s = bsdf.sample(in.wo, in.l, in.u, in.v);
        for (float x :
             {e.f_cos.x, e.f_cos.y, e.f_cos.z, e.pdf, s.weight.x, s.weight.y, s.weight.z, s.pdf}) {
          ASSERT_TRUE(std::isfinite(x)) << kProgramNames[id] << " wo " << in.wo.z << " r "
                                        << in.params.roughness << " ior " << in.params.ior;
          ASSERT_GE(x, 0.f) << kProgramNames[id] << " wo " << in.wo.z << " r "
                            << in.params.roughness << " ior " << in.params.ior;
        }
        ASSERT_NEAR(length(s.wi), 1.f, 1e-4f) << kProgramNames[id];
        // Weights of single lobes are bounded by 1 / eta^2, those of mixtures by 1 / minimum lobe
        // probability.
        ASSERT_LE(max_component(s.weight) * s.eta * s.eta, 120.f) << kProgramNames[id];
        ASSERT_TRUE(s.pdf > 0 || is_black(s.weight)) << kProgramNames[id];
      });
    }
}

}  // namespace
}  // namespace wavecomb
