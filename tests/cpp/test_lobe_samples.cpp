// SPDX-License-Identifier: Apache-2.0
/// Tests that samples of single lobes (normals or directions) follow their densities. The selection
/// among lobes is not part of these tests.
#include <gtest/gtest.h>

#include <utility>

#include "bsdf_testing.h"
#include "parts.h"
#include "wavecomb/material/lobes/eon.h"
#include "wavecomb/material/lobes/fuzz.h"
#include "wavecomb/material/lobes/ggx_anisotropic.h"
#include "wavecomb/material/lobes/microfacet_reflection.h"
#include "wavecomb/material/lobes/rough_dielectric.h"

namespace wavecomb {
namespace {

using bsdf_testing::direction;
using chi_square::Battery;
using chi_square::Draw;
using chi_square::Place;
using chi_square::Random;
using Vec = Vec3<float>;

constexpr double kCosines[] = {0.05, 0.3, 0.7, 0.95};

/// A lobe whose `sample(random)` returns directions of density `pdf(w)`, or the zero vector for no
/// sample.
template <typename Pdf, typename Sample>
chi_square::Case lobe_case(std::string name, const Vec& wo, const Pdf& pdf, const Sample& sample) {
  chi_square::Case c;
  c.name = std::move(name) + ", z " + std::to_string(wo.z).substr(0, 5);
  c.charts = bsdf_testing::direction_charts();
  c.density = [pdf](const Place& p) {
    return static_cast<double>(pdf(bsdf_testing::direction_at(p)));
  };
  c.draw = [sample](Random& random, bool) {
    const Vec w = sample(random);
    return is_black(w) ? Draw::nothing() : Draw::at(bsdf_testing::place_of(w));
  };
  return c;
}
std::string named(const char* name, double value) {
  return std::string(name) + " " + std::to_string(value).substr(0, 6);
}

/// Tests squared roughnesses of 0.032 (the narrowest lobe), 0.1, 0.3 and 1.
std::vector<float> alphas() {
  return is_long() ? std::vector<float>{0.001024f, 0.01f, 0.09f, 1.f}
                   : std::vector<float>{0.001024f, 0.09f};
}

TEST(LobeSamples, VisibleNormals) {
  Battery battery("visible normals");
  for (const double z : {1e-3, 0.05, 0.3, 0.95, 1.0}) {
    const Vec wo = direction(z, 2.1);
    for (const float alpha : alphas()) {
      const Ggx<float> ggx{alpha};
      battery.run(lobe_case(
          named("GGX normals", double{alpha}), wo,
          [=](const Vec& h) {
            return h.z > 0 ? ggx.visible_density_over_cos(wo, h) * std::max(0.f, dot(wo, h)) : 0.f;
          },
          [=](Random& random) {
            const float u = random(), v = random();
            return ggx.sample_visible(wo, u, v);
          }));
    }
    for (const auto& [ax, ay] : {std::pair{0.3f, 0.02f}, {0.002f, 0.5f}, {1.f, 0.1f}}) {
      const AnisotropicGgx<float> ggx{ax, ay};
      battery.run(lobe_case(
          named("anisotropic GGX normals", double{ax}), wo,
          [=](const Vec& h) {
            // G1(wo) D(h) (wo . h) / z_o.
            const float d = 2 * ggx.d(h) / (wo.z + ggx.s(wo));
            return h.z > 0 ? d * std::max(0.f, dot(wo, h)) : 0.f;
          },
          [=](Random& random) {
            const float u = random(), v = random();
            return ggx.sample_visible(wo, u, v);
          }));
    }
  }
  battery.judge();
}

TEST(LobeSamples, ReflectionAndRefraction) {
  Battery battery("microfacets");
  for (const double z : kCosines)
    for (const float alpha : alphas()) {
      const Vec wo = direction(z, 2.1);
      const Ggx<float> ggx{alpha};
      battery.run(lobe_case(
          named("GGX reflection", double{alpha}), wo,
          [=](const Vec& wi) { return eval_microfacet(ggx, wo, wi).pdf; },
          [=](Random& random) {
            const float u = random(), v = random();
            const Vec wi = sample_microfacet(ggx, wo, u, v);
            return wi.z > 0 ? wi : Vec(0.f);
          }));
      for (const auto& [ior, side] : {std::pair{1.5f, 1.f}, {1.5f, -1.f}, {0.75f, 1.f}}) {
        const Vec from(wo.x, wo.y, side * wo.z);
        const Vec white(1.f);
        battery.run(lobe_case(
            named("dielectric of", double{ior}) + named(", alpha", double{alpha}), from,
            [=, ior = ior](const Vec& wi) {
              return eval_rough_dielectric<float>({ggx, ior, white, 0.5f, false}, from, wi).pdf;
            },
            [=, ior = ior](Random& random) {
              const float l = random(), u = random(), v = random();
              const auto s =
                  sample_rough_dielectric<float>({ggx, ior, white, 0.5f, false}, from, l, u, v);
              return s.pdf > 0 ? s.wi : Vec(0.f);
            }));
      }
    }
  battery.judge();
}

TEST(LobeSamples, RoughDiffuseAndFuzz) {
  Battery battery("diffuse and fuzz");
  for (const double z : kCosines)
    for (const float r : {0.f, 0.03f, 0.1f, 0.3f, 1.f}) {
      const Vec wo = direction(z, -1.3);
      const EonDiffuse<float> eon(r);
      const auto sampler = eon.sampler(wo.z);
      battery.run(lobe_case(
          named("EON", double{r}), wo, [=](const Vec& wi) { return eon.pdf(sampler, wo, wi); },
          [=](Random& random) {
            const float l = random(), u = random(), v = random();
            return eon.sample(sampler, wo, l, u, v);
          }));
      if (r == 0) continue;
      const FuzzLobe<float> fuzz(wo.z, r);
      battery.run(lobe_case(
          named("fuzz", double{r}), wo, [=](const Vec& wi) { return fuzz.density(wo, wi); },
          [=](Random& random) {
            const float u = random(), v = random();
            return fuzz.sample(wo, u, v);
          }));
    }
  battery.judge();
}

}  // namespace
}  // namespace wavecomb
