// SPDX-License-Identifier: Apache-2.0
/// Reciprocity of OpenPBR: where it holds, where it does not, by how much and why.
/// test_openpbr_energy.cpp tests energy conservation, and test_programs.cpp tests properties that
/// all programs have in common.
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "bsdf_testing.h"
#include "wavecomb/material/programs/openpbr.h"

namespace wavecomb {
namespace {

using bsdf_testing::direction;
using bsdf_testing::plain_params;
using Bsdf = OpenPbrBsdf<float>;
using P = OpenPbrParams<float>;
using Vec = Vec3<float>;

template <typename Edit>
P edited(Edit edit) {
  P p = plain_params();
  p.base_color = Vec(0.8f);
  p.specular_color = Vec(1.f);
  edit(p);
  return p;
}

/// Draws two directions of cosine-weighted density, on either side for transmissive materials.
struct Pair {
  Vec o, i;
};
template <typename Function>
void for_pairs(const P& p, int count, Function function) {
  std::mt19937 rng(11);
  std::uniform_real_distribution<double> unit(0, 1);
  const bool clear = p.transmission_weight > 0 || p.thin_walled > 0;
  const auto any = [&] {
    const double z = std::sqrt(unit(rng)), side = clear && unit(rng) < 0.5 ? -1 : 1;
    return direction(side * z, 6.2832 * unit(rng));
  };
  for (int k = 0; k < count; ++k) {
    const Vec o = any(), i = any();
    function(Pair{o, i});
  }
}

/// Squared index on the side of w: f(o, i) n_i^2 = f(i, o) n_o^2 (Veach 1997, eq. 5.14).
double index2(const P& p, const Vec& w) {
  const bool solid = p.transmission_weight > 0 && p.thin_walled == 0;
  return solid && w.z < 0 ? double{p.ior} * double{p.ior} : 1;
}
/// f n_i^2 for o and i.
double value(const Bsdf& bsdf, const P& p, const Vec& o, const Vec& i) {
  return double{bsdf.eval(o, i).f_cos.y} / std::abs(double{i.z}) * index2(p, i);
}

/// Mean of |f(o, i) - f(i, o)| relative to the mean of f, with cosine weights for both directions.
double asymmetry(const P& p) {
  const Bsdf bsdf(p, false);
  double difference = 0, sum = 0;
  for_pairs(p, 40000, [&](const Pair& w) {
    const double a = value(bsdf, p, w.o, w.i), b = value(bsdf, p, w.i, w.o);
    difference += std::abs(a - b);
    sum += 0.5 * (a + b);
  });
  return difference / sum;
}

TEST(OpenPbr, LobesThatAreNotScaledAreReciprocal) {
  const std::pair<const char*, P> cases[] = {
      {"diffuse", edited([](P& p) { p.specular_weight = 0; })},
      {"rough diffuse", edited([](P& p) { p.specular_weight = 0, p.diffuse_roughness = 1; })},
      {"leaf", edited([](P& p) {
         p.specular_weight = 0, p.thin_walled = 1, p.subsurface_weight = 0.7f;
         p.subsurface_anisotropy = 0.3f;
       })},
      // A metal that reflects nothing at normal incidence gets no compensation for multiple
      // scattering.
      {"black metal",
       edited([](P& p) { p.metallic = 1, p.roughness = 0.6f, p.base_color = Vec(0.f); })},
      {"black brushed metal", edited([](P& p) {
         p.metallic = 1, p.roughness = 0.6f, p.base_color = Vec(0.f), p.anisotropy = 0.7f;
         p.rotation = 0.1f;
       })}};
  for (const auto& [name, p] : cases) {
    const Bsdf bsdf(p, false);
    int compared = 0;
    for_pairs(p, 5000, [&, name = name, &p = p](const Pair& w) {
      if (std::min(std::abs(w.o.z), std::abs(w.i.z)) < 0.02f) return;
      const double a = value(bsdf, p, w.o, w.i), b = value(bsdf, p, w.i, w.o);
      EXPECT_NEAR(a, b, 2e-4 * std::max(a, b) + 1e-6) << name << " " << w.o.z << " " << w.i.z;
      compared += a > 0;
    });
    EXPECT_GT(compared, 1000) << name;
  }
}

/// The scaling by the viewer's side is the only cause of asymmetry.
TEST(OpenPbr, WithoutTheViewersScaleItIsReciprocal) {
  const auto scales = [](const P& p, const Vec& w) {
    return OpenPbrBase<float>(p).view(Vec(w.x, w.y, std::abs(w.z)), w.z < 0, p.energy);
  };
  int compared = 0;
  const auto expect = [&compared](double a, double b, const char* what, const Pair& w) {
    EXPECT_NEAR(a, b, 1e-3 * std::max(a, b) + 1e-5) << what << " " << w.o.z << " " << w.i.z;
    compared += a > 0;
  };
  for (const float r : {0.2f, 0.5f, 1.f}) {
    const P metal = edited([r](P& p) { p.metallic = 1, p.roughness = r; });
    const P glossy = edited([r](P& p) { p.roughness = r; });
    const P glass = edited([r](P& p) { p.transmission_weight = 1, p.roughness = r; });
    const Bsdf metal_bsdf(metal, false), glossy_bsdf(glossy, false), glass_bsdf(glass, false);
    for_pairs(glass, 4000, [&](const Pair& w) {
      if (std::min(std::abs(w.o.z), std::abs(w.i.z)) < 0.05f) return;
      const double go = scales(glass, w.o).glass_scale, gi = scales(glass, w.i).glass_scale;
      expect(value(glass_bsdf, glass, w.o, w.i) / go, value(glass_bsdf, glass, w.i, w.o) / gi,
             "glass", w);
      if (w.o.z < 0 || w.i.z < 0) return;
      const auto mo = scales(metal, w.o), mi = scales(metal, w.i);
      expect(value(metal_bsdf, metal, w.o, w.i) / double{mo.metal_scale.y},
             value(metal_bsdf, metal, w.i, w.o) / double{mi.metal_scale.y}, "metal", w);
      const auto so = scales(glossy, w.o), si = scales(glossy, w.i);
      const double a = value(glossy_bsdf, glossy, w.o, w.i),
                   b = value(glossy_bsdf, glossy, w.i, w.o);
      const double below_o = double{glossy_bsdf.diffuse_f_cos(w.o, w.i).y} / double{w.i.z},
                   below_i = double{glossy_bsdf.diffuse_f_cos(w.i, w.o).y} / double{w.o.z};
      expect(below_o / (1 - double{so.gloss.y}), below_i / (1 - double{si.gloss.y}),
             "below the interface", w);
      expect((a - below_o) / double{so.gloss_scale}, (b - below_i) / double{si.gloss_scale},
             "interface", w);
    });
  }
  EXPECT_GT(compared, 5000);
}

TEST(OpenPbr, LayersAreNotReciprocalByTheFiguresOfItsPage) {
  // docs/openpbr.md quotes these values.
  struct Row {
    const char* name;
    P params;
    double size;
  };
  const auto glossy = [](float r) { return edited([r](P& p) { p.roughness = r; }); };
  const auto metal = [](float r) { return edited([r](P& p) { p.metallic = 1, p.roughness = r; }); };
  const auto brushed = [](float r) {
    return edited([r](P& p) { p.metallic = 1, p.roughness = r, p.anisotropy = 0.8f; });
  };
  const auto glass = [](float r) {
    return edited([r](P& p) { p.transmission_weight = 1, p.roughness = r; });
  };
  const auto wall = [](float r) {
    return edited([r](P& p) { p.transmission_weight = 0.5f, p.thin_walled = 1, p.roughness = r; });
  };
  const auto coat = [](float r) {
    return edited([r](P& p) { p.clearcoat = 1, p.clearcoat_roughness = r; });
  };
  const auto fuzz = [](float r) {
    return edited([r](P& p) { p.specular_weight = 0, p.fuzz_weight = 1, p.fuzz_roughness = r; });
  };
  const auto film = [](float r, float transmission) {
    return edited([r, transmission](P& p) {
      p.film_weight = 1, p.roughness = r, p.transmission_weight = transmission;
    });
  };
  const Row rows[] = {{"glossy 0.2", glossy(0.2f), 0.065},
                      {"glossy 0.5", glossy(0.5f), 0.028},
                      {"glossy 1", glossy(1.f), 0.010},
                      {"metal 0.2", metal(0.2f), 0.0014},
                      {"metal 0.5", metal(0.5f), 0.020},
                      {"metal 1", metal(1.f), 0.220},
                      {"brushed 0.2", brushed(0.2f), 0.0014},
                      {"brushed 0.5", brushed(0.5f), 0.016},
                      {"brushed 1", brushed(1.f), 0.099},
                      {"glass 0.2", glass(0.2f), 0.0028},
                      {"glass 0.5", glass(0.5f), 0.066},
                      {"glass 1", glass(1.f), 0.418},
                      {"wall 0.2", wall(0.2f), 0.032},
                      {"wall 0.5", wall(0.5f), 0.0235},
                      {"wall 1", wall(1.f), 0.1385},
                      {"coat 0.2", coat(0.2f), 0.067},
                      {"coat 0.5", coat(0.5f), 0.031},
                      {"coat 1", coat(1.f), 0.0129},
                      {"fuzz 0.2", fuzz(0.2f), 0.035},
                      {"fuzz 0.5", fuzz(0.5f), 0.116},
                      {"fuzz 1", fuzz(1.f), 0.064},
                      {"film over diffuse 0.2", film(0.2f, 0), 0.078},
                      {"film over diffuse 0.5", film(0.5f, 0), 0.0344},
                      {"film over diffuse 1", film(1.f, 0), 0.009},
                      {"film on glass 0.2", film(0.2f, 1), 0.0028},
                      {"film on glass 0.5", film(0.5f, 1), 0.067},
                      {"film on glass 1", film(1.f, 1), 0.423}};
  // For narrow lobes, few pairs of directions have a contribution, so the tolerance is a sixth of
  // the value, but at least 0.001.
  for (const Row& row : rows)
    EXPECT_NEAR(asymmetry(row.params), row.size, std::max(row.size / 6, 1e-3)) << row.name;
}

}  // namespace
}  // namespace wavecomb
