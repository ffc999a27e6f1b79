// SPDX-License-Identifier: Apache-2.0
/// OpenPBR in a white furnace, compared per channel with double-precision integrals of the model's
/// formulas (openpbr_integrals.h).
#include <gtest/gtest.h>

#include <cmath>
#include <sstream>
#include <string>
#include <vector>

#include "bsdf_testing.h"
#include "openpbr_integrals.h"
#include "parts.h"
#include "wavecomb/material/programs/openpbr.h"

namespace wavecomb {
namespace {

using bsdf_testing::direction;
using bsdf_testing::kronecker;
using bsdf_testing::plain_params;
using facet_integrals::OpenPbrModel;
using facet_integrals::Rgb;
using Bsdf = OpenPbrBsdf<float>;
using P = OpenPbrParams<float>;
using Vec = Vec3<float>;

std::vector<double> cosines() {
  if (is_long()) return {0.03, 0.05, 0.1, 0.15, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0};
  return {0.05, 0.4, 1.0};
}
std::vector<float> roughnesses() {
  if (is_long()) return {0.f, 0.05f, 0.13f, 0.2f, 0.3f, 0.37f, 0.45f, 0.6f, 0.7f, 0.8f, 0.9f, 1.f};
  return {0.f, 0.13f, 0.55f, 1.f};
}

/// White parameters without absorption.
P white() {
  P p = plain_params();
  p.base_color = p.specular_color = p.subsurface_color = Vec(1.f);
  return p;
}

Rgb measured(const Bsdf& bsdf, const Vec& wo, uint32_t samples) {
  Rgb sum{0, 0, 0};
  for (uint32_t i = 0; i < samples; ++i) {
    const auto [l, u, v] = kronecker(i);
    const auto s = bsdf.sample(wo, l, u, v);
    const Vec w = s.weight * (s.eta * s.eta);
    sum[0] += double{w.x}, sum[1] += double{w.y}, sum[2] += double{w.z};
  }
  for (double& x : sum) x /= samples;
  return sum;
}

/// Tolerances for tables and sampling noise.
struct Bounds {
  double loss = 0.008, gain = 0.003;
  double most = 1.002;  ///< absolute limit
  std::vector<double> azimuths = {0.3};
  uint32_t samples = is_long() ? 32768 : 8192;
};

/// Expects the predicted albedo, from both sides if they differ.
void expect_predicted(const P& p, const std::string& what, const Bounds& bounds = {}) {
  const Bsdf bsdf(p, false);
  const OpenPbrModel model(p);
  const bool solid = p.transmission_weight > 0 && p.thin_walled == 0;
  for (const double z : cosines())
    for (const double phi : bounds.azimuths)
      for (const double side : {1.0, -1.0}) {
        if (side < 0 && !solid) continue;
        const Rgb expected = model.seen(z, phi, side < 0);
        const Rgb found = measured(bsdf, direction(side * z, phi), bounds.samples);
        for (size_t k = 0; k < 3; ++k) {
          const auto where = [&] {
            std::ostringstream text;
            text << what << " r " << p.roughness << " ior " << p.ior << " z " << side * z << " phi "
                 << phi << " channel " << k;
            return text.str();
          };
          // At grazing angles the tables are coarse, most of all inside rough glass.
          const double loss = side < 0 && z < 0.2 ? 2 * bounds.loss : bounds.loss;
          const double more = z < 0.05 ? 0.01 : 0;
          EXPECT_GE(found[k], expected[k] - loss) << where();
          EXPECT_LE(found[k], expected[k] + bounds.gain + more) << where();
          EXPECT_LE(found[k], bounds.most + more) << where();
        }
      }
}

TEST(OpenPbrEnergy, Diffuse) {
  for (const float r : {0.f, 0.3f, 0.7f, 1.f}) {
    P p = white();
    p.specular_weight = 0;
    p.diffuse_roughness = r;
    expect_predicted(p, "diffuse", {.loss = 0.003, .gain = 0.001});
  }
}

TEST(OpenPbrEnergy, Metals) {
  for (const float r : roughnesses()) {
    P p = white();
    p.metallic = 1;
    p.roughness = r;
    expect_predicted(p, "white metal");
    p.base_color = Vec(0.9f, 0.5f, 0.1f);
    p.specular_color = Vec(1.f, 0.8f, 0.6f);
    expect_predicted(p, "tinted metal");
  }
}

TEST(OpenPbrEnergy, BrushedMetals) {
  for (const float anisotropy : {0.4f, 0.9f, 1.f})
    for (const float r : {0.2f, 0.5f, 0.8f}) {
      P p = white();
      p.metallic = 1;
      p.roughness = r;
      p.anisotropy = anisotropy;
      expect_predicted(p, "brushed " + std::to_string(anisotropy),
                       {.loss = 0.015, .gain = 0.004, .most = 1.004, .azimuths = {0, 0.8, 1.57}});
    }
}

TEST(OpenPbrEnergy, BrushedDielectrics) {
  for (const float anisotropy : {0.5f, 0.9f})
    for (const float r : {0.3f, 0.6f, 0.9f})
      for (const float transmission : {0.f, 1.f}) {
        P p = white();
        p.roughness = r;
        p.anisotropy = anisotropy;
        p.transmission_weight = transmission;
        p.transmission_tint = p.base_color = Vec(1.f, 0.5f, 0.f);
        const std::string what = transmission > 0 ? "brushed glass " : "brushed gloss ";
        expect_predicted(p, what + std::to_string(anisotropy),
                         {.gain = 0.004, .most = 1.004, .azimuths = {0, 1.57}});
      }
}

TEST(OpenPbrEnergy, GlossOverDiffuse) {
  for (const float r : roughnesses())
    for (const float ior : {1.1f, 1.5f, 2.5f}) {
      P p = white();
      p.roughness = r;
      p.ior = ior;
      p.base_color = Vec(1.f, 0.5f, 0.f);
      expect_predicted(p, "gloss");
    }
}

TEST(OpenPbrEnergy, Glass) {
  for (const float r : roughnesses())
    for (const float ior : {1.1f, 1.5f, 2.f}) {
      P p = white();
      p.transmission_weight = 1;
      p.roughness = r;
      p.ior = ior;
      p.transmission_tint = Vec(1.f, 0.6f, 0.2f);
      expect_predicted(p, "glass", {.loss = 0.01});
    }
}

TEST(OpenPbrEnergy, GlassThatReflectsLessThanItsIndex) {
  for (const float weight : {0.f, 0.4f})
    for (const float r : {0.3f, 0.8f}) {
      P p = white();
      p.transmission_weight = 1;
      p.specular_weight = weight;
      p.roughness = r;
      p.transmission_tint = Vec(1.f, 0.6f, 0.2f);
      expect_predicted(p, "weak glass");
    }
}

TEST(OpenPbrEnergy, ThinWalls) {
  for (const float r : {0.f, 0.3f, 0.8f}) {
    P p = white();
    p.thin_walled = 1;
    p.transmission_weight = 0.5f;
    p.subsurface_weight = 0.8f;
    p.roughness = r;
    expect_predicted(p, "wall");
  }
}

TEST(OpenPbrEnergy, CoatAndFuzz) {
  for (const float r : roughnesses())
    for (const float metallic : {0.f, 1.f}) {
      P p = white();
      p.base_color = Vec(1.f, 0.5f, 0.2f);
      p.metallic = metallic;
      p.clearcoat = 1;
      p.clearcoat_roughness = r;
      expect_predicted(p, "coat");
      p.fuzz_weight = 1;
      p.fuzz_roughness = std::max(r, 0.1f);
      expect_predicted(p, "fuzz");
    }
}

TEST(OpenPbrEnergy, CoatedGlass) {
  for (const float r : {0.f, 0.45f, 1.f}) {
    P p = white();
    p.transmission_weight = 1;
    p.roughness = 0.2f;
    p.clearcoat = 1;
    p.clearcoat_roughness = r;
    expect_predicted(p, "coated glass");
  }
}

/// Thin films on glass, metal, a diffuse base, below a coat, and on all of them together.
TEST(OpenPbrEnergy, FilmsGainNothing) {
  struct Kind {
    const char* name;
    float metallic, transmission, wall, coat;
  };
  constexpr float kFilms[3][2] = {{120, 1.25f}, {350, 1.8f}, {900, 1.5f}};
  uint32_t turn = 0;
  for (const Kind& kind :
       {Kind{"film on gloss", 0, 0, 0, 0}, Kind{"film on metal", 1, 0, 0, 0},
        Kind{"film on glass", 0, 1, 0, 0}, Kind{"film on a wall", 0, 1, 1, 0},
        Kind{"film below a coat", 0, 0, 0, 1}, Kind{"film on all", 0.4f, 0.5f, 0, 0.5f}})
    for (const float r : {0.f, 0.3f, 0.6f, 1.f}) {
      ++turn;
      for (uint32_t f = 0; f < 3; ++f) {
        if (!is_long() && f != (turn + turn / 4) % 3) continue;
        P p = white();
        p.film_weight = f == 1 ? 0.7f : 1;
        p.film_thickness = kFilms[f][0];
        p.film_ior = kFilms[f][1];
        p.roughness = r;
        p.base_color = Vec(1.f, 0.5f, 0.f);
        p.metallic = kind.metallic;
        p.transmission_weight = kind.transmission;
        p.thin_walled = kind.wall;
        p.clearcoat = kind.coat;
        p.clearcoat_roughness = 0.4f;
        std::ostringstream what;
        what << kind.name << " of " << p.film_thickness << " nm";
        expect_predicted(p, what.str(),
                         {.most = 1.001, .samples = kind.coat == 0.5f ? 24000u : 6000u});
      }
    }
}

}  // namespace
}  // namespace wavecomb
