// SPDX-License-Identifier: Apache-2.0
/// Table of materials that all tests of programs use.
#pragma once

#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "bsdf_testing.h"
#include "wavecomb/material/program_table.h"

namespace wavecomb::program_cases {

using P = OpenPbrParams<float>;

/// A material program and its parameters.
struct Case {
  std::string name;
  ProgramId program;
  P params;
  bool schlick = false;
  bool two_sided() const {
    const bool clear = params.transmission_weight > 0 && params.thin_walled == 0;
    return program != ProgramId::kDielectric && !(program == ProgramId::kOpenPbr && clear);
  }
  /// Whether transmission refracts; false for thin walls.
  bool bends() const { return program != ProgramId::kOpenPbr || params.thin_walled == 0; }
  /// Most OpenPBR materials are not reciprocal, because the scaling of lower layers depends only on
  /// the viewing direction.
  bool reciprocal() const {
    return program != ProgramId::kOpenPbr || name.find("reciprocal") != std::string::npos;
  }
  double ior() const { return static_cast<double>(params.ior); }
};

template <typename Edit>
Case make_case(std::string name, ProgramId program, Edit edit, bool schlick = false) {
  Case c{std::move(name), program, bsdf_testing::plain_params(), schlick};
  edit(c.params);
  return c;
}

/// Row of the table: makes a material for any roughness of its main lobe.
struct Row {
  std::string name;
  ProgramId program;
  std::vector<float> usual;
  std::function<void(P&, float roughness)> edit;
  bool schlick = false;

  Case at(float roughness) const {
    return make_case(
        name + " r" + std::to_string(roughness).substr(0, 5), program,
        [&](P& p) {
          p.roughness = roughness;
          edit(p, roughness);
        },
        schlick);
  }
};

/// Adds OpenPBR materials: each lobe alone, and all lobes together.
inline void add_openpbr(std::vector<Row>& all) {
  using Vec = Vec3<float>;
  const auto add = [&](std::string name, std::vector<float> usual, auto edit) {
    all.push_back({"openpbr " + std::move(name), ProgramId::kOpenPbr, std::move(usual),
                   [edit](P& p, float r) {
                     p.specular_color = Vec(1, 1, 1);
                     edit(p, r);
                   }});
  };
  const std::vector<float> usual = {0.f, 0.2f, 0.7f};
  add("reciprocal diffuse", {0.f, 0.5f, 1.f}, [](P& p, float r) {
    p.roughness = 0.5f;
    p.diffuse_roughness = r, p.specular_weight = 0;
  });
  add("metal", usual, [](P& p, float) { p.metallic = 1, p.specular_color = Vec(0.8f, 0.9f, 1); });
  add("glossy", usual, [](P& p, float) { p.diffuse_roughness = 0.5f; });
  add("glass", usual, [](P& p, float) { p.transmission_weight = 1; });
  add("coat", usual, [](P& p, float r) {
    p.roughness = 0.5f;
    p.clearcoat = 0.8f, p.clearcoat_roughness = r, p.coat_color = Vec(1, 0.6f, 0.3f);
  });
  // Microfacets of this rough coat often reflect to directions below the surface, in which the base
  // transmits.
  add("coated glass", {1.f}, [](P& p, float r) {
    p.roughness = 0.2f;
    p.transmission_weight = 1, p.clearcoat = 1, p.clearcoat_roughness = r;
  });
  add("brushed", {0.4f},
      [](P& p, float) { p.metallic = 1, p.anisotropy = 0.8f, p.rotation = 0.15f; });
  add("brushed glass", {0.3f},
      [](P& p, float) { p.transmission_weight = 1, p.anisotropy = 0.6f, p.rotation = 0.3f; });
  add("fuzz", {0.4f}, [](P& p, float r) {
    p.roughness = 0.5f;
    p.fuzz_weight = 0.7f, p.fuzz_roughness = r;
  });
  add("wall", {0.4f}, [](P& p, float) {
    p.thin_walled = 1, p.transmission_weight = 0.5f;
    p.subsurface_weight = 0.6f, p.subsurface_anisotropy = 0.2f;
  });
  add("film", {0.5f},
      [](P& p, float) { p.film_weight = 0.9f, p.metallic = 0.3f, p.transmission_weight = 0.4f; });
  add("all", {0.4f}, [](P& p, float) {
    p.metallic = 0.3f, p.transmission_weight = 0.4f, p.anisotropy = 0.3f;
    p.specular_weight = 0.7f, p.diffuse_roughness = 0.8f, p.clearcoat = 0.6f;
    p.clearcoat_roughness = 0.2f, p.coat_color = Vec(0.9f, 0.8f, 0.7f), p.fuzz_weight = 0.5f;
    p.fuzz_color = Vec(0.9f, 0.5f, 0.5f), p.film_weight = 0.5f;
    p.subsurface_weight = 0.5f, p.specular_color = Vec(0.9f, 0.9f, 0.5f);
  });
}

/// Returns the table. The table includes materials that have no roughness or a fixed roughness.
inline std::vector<Row> table() {
  using Vec = Vec3<float>;
  std::vector<Row> all;
  const auto add = [&](std::string name, ProgramId id, std::vector<float> usual, auto edit,
                       bool schlick = false) {
    all.push_back({std::move(name), id, std::move(usual), edit, schlick});
  };
  const auto plain = [](P&, float) {};
  const std::vector<float> usual = {0.f, 0.2f, 0.5f, 1.f};
  add("diffuse", ProgramId::kDiffuse, {0.5f}, plain);
  add("emissive", ProgramId::kEmissive, {0.5f}, plain);
  add("metal", ProgramId::kMetal, usual, plain);
  add("gold", ProgramId::kMetal, usual, [](P& p, float) {
    p.flags = kConductorIndex;
    p.conductor_eta = Vec(0.143f, 0.375f, 1.442f);
    p.conductor_k = Vec(3.983f, 2.386f, 1.603f);
  });
  add("glass", ProgramId::kDielectric, usual, [](P& p, float) { p.base_color = Vec(1, 1, 1); });
  add("plastic", ProgramId::kPlastic, usual, plain);
  add("principled", ProgramId::kPrincipled, usual, plain);
  add("glass schlick", ProgramId::kDielectric, {0.5f}, plain, true);
  add("bubble", ProgramId::kDielectric, {0.5f}, [](P& p, float) { p.ior = 0.75f; });
  add("diamond", ProgramId::kDielectric, {0.6f}, [](P& p, float) { p.ior = 2.4f; });
  add("plastic schlick", ProgramId::kPlastic, {0.5f}, plain, true);
  add("principled metal", ProgramId::kPrincipled, {0.3f}, [](P& p, float) { p.metallic = 0.9f; });
  add("principled specular", ProgramId::kPrincipled, {0.5f}, [](P& p, float) {
    p.flags = kSpecularWorkflow;
    p.specular_color = Vec(0.3f, 0.5f, 0.7f);
  });
  add("principled coat", ProgramId::kPrincipled, {0.3f}, [](P& p, float r) {
    p.roughness = 0.7f;
    p.clearcoat = 1, p.clearcoat_roughness = r;
  });
  add("principled smooth coat", ProgramId::kPrincipled, {0.5f},
      [](P& p, float) { p.clearcoat = 0.5f; });
  add("principled pane", ProgramId::kPrincipled, {0.5f},
      [](P& p, float) { p.opacity = 0.3f, p.clearcoat = 0.7f; });
  add("principled schlick", ProgramId::kPrincipled, {0.5f}, plain, true);
  add_openpbr(all);
  return all;
}

/// Returns each material at the roughnesses that most tests use.
inline std::vector<Case> usual_cases() {
  std::vector<Case> cases;
  for (const Row& m : table())
    for (const float r : m.usual) cases.push_back(m.at(r));
  return cases;
}

/// Calls f(bsdf) with the scalar class of the case's program.
template <typename Function>
void with_bsdf(const Case& c, Function f) {
  visit_program<float>(c.program, [&]<typename Bsdf>() {
    f(Bsdf(bsdf_testing::params_for<Bsdf>(c.params), c.schlick));
  });
}

/// Returns viewing directions with the given cosines. For materials whose two sides differ, adds
/// directions below the surface.
inline std::vector<Vec3<float>> views(const Case& c,
                                      const std::vector<double>& cosines = {0.02, 0.25, 0.6, 1.0}) {
  std::vector<Vec3<float>> all;
  for (const double z : cosines) {
    all.push_back(bsdf_testing::direction(z, 0.4));
    if (!c.two_sided() || z == 0.6) all.push_back(bsdf_testing::direction(-z, 2.5));
  }
  return all;
}

}  // namespace wavecomb::program_cases
