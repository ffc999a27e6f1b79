// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/medium/description/mesh_medium.h"

#include <algorithm>
#include <cmath>

#include "wavecomb/geometry/mesh/mesh.h"
#include "wavecomb/graph/graph.h"
#include "wavecomb/graph/parameters/parameters.h"
#include "wavecomb/material/description/material.h"

namespace wavecomb {

namespace {

/// Lower limit of transmission colours, which keeps their logarithm finite.
constexpr float kDarkestTransmission = 1e-6f;
constexpr float kMaxMediumCosine = 0.99f;

struct Coefficients {
  float absorption, scattering;
};

bool is_solid(const Material& m) {
  return has_trait(m.program, program_trait::kNests) && !m.openpbr.thin_walled;
}

/// Returns the coefficients of one colour channel as defined in OpenPBR 1.1, "Translucent base".
/// Extinction is -ln(colour) / depth, and scattering is scatter / depth. Absorption is extinction
/// minus scattering, which may be negative in this result.
Coefficients raw_coefficients(float color, float scatter, float depth) {
  const float extinction = -std::log(std::clamp(color, kDarkestTransmission, 1.f)) / depth;
  const float scattering = std::max(scatter, 0.f) / depth;
  return {extinction - scattering, scattering};
}

void set_medium(const OpenPbr& o, MeshMedium<float>& out) {
  if (!(o.transmission_depth > 0)) return;
  const Vec3<float>&c = o.transmission_color, &s = o.transmission_scatter;
  Coefficients k[3] = {raw_coefficients(c.x, s.x, o.transmission_depth),
                       raw_coefficients(c.y, s.y, o.transmission_depth),
                       raw_coefficients(c.z, s.z, o.transmission_depth)};
  // If a channel has negative absorption, add the same amount to all channels, so that the least
  // absorption is 0.
  const float least = std::min({k[0].absorption, k[1].absorption, k[2].absorption, 0.f});
  out.absorption = {k[0].absorption - least, k[1].absorption - least, k[2].absorption - least};
  out.scattering = {k[0].scattering, k[1].scattering, k[2].scattering};
  out.anisotropy =
      std::clamp(o.transmission_scatter_anisotropy, -kMaxMediumCosine, kMaxMediumCosine);
}

bool is_any(const Vec3<float>& v) {
  return v.x > 0 || v.y > 0 || v.z > 0;
}

/// Returns whether the surface neither reflects, refracts, tints nor emits light.
bool is_clear(const Material& m) {
  const OpenPbr& o = m.openpbr;
  const Vec3<float>& c = o.transmission_color;
  const bool tints = !(o.transmission_depth > 0) && (c.x < 1 || c.y < 1 || c.z < 1);
  const bool constant =
      m.graph == kNoGraph && !m.has_texture(Input::kMetallic) && !m.has_texture(Input::kClearcoat);
  return is_solid(m) && constant && m.ior == 1 && o.transmission_weight == 1 && m.metallic == 0 &&
         m.clearcoat == 0 && o.fuzz_weight == 0 && o.film_weight == 0 && !tints && !m.emits() &&
         !m.needs_presence();
}

/// Returns whether a material is a solid that may transmit light at some of its hits.
bool may_transmit(const Material& m, const GraphSet& graphs) {
  return is_solid(m) && (m.openpbr.transmission_weight > 0 ||
                         graphs.drives(m.graph, graph_parameter("transmission_weight")));
}

bool is_glass(const Material& m, const GraphSet& graphs) {
  return has_trait(m.program, program_trait::kGlass) || may_transmit(m, graphs);
}

bool drives_extinction(const Material& m, const GraphSet& graphs) {
  constexpr uint32_t kFirst = graph_parameter("extinction");
  return graphs.drives(m.graph, kFirst) || graphs.drives(m.graph, kFirst + 1) ||
         graphs.drives(m.graph, kFirst + 2);
}

}  // namespace

bool absorbs_by_graph(const Material& m, const GraphSet& graphs) {
  return may_transmit(m, graphs) && drives_extinction(m, graphs);
}

bool is_absorbing_solid(const Material& m, const GraphSet& graphs) {
  if (!may_transmit(m, graphs) || drives_extinction(m, graphs)) return false;
  MeshMedium<float> medium{};
  set_medium(m.openpbr, medium);
  return is_any(medium.absorption);
}

bool needs_medium_stack(const Material& m, const GraphSet& graphs, bool absorbing) {
  if (!is_solid(m)) return false;
  MeshMedium<float> medium{};
  set_medium(m.openpbr, medium);
  if (m.openpbr.transmission_weight > 0 && is_any(medium.scattering)) return true;
  if (absorbing && is_absorbing_solid(m, graphs)) return true;
  return m.openpbr.nested_priority != 0 || (is_clear(m) && is_any(medium.absorption));
}

uint32_t add_inside_material(std::vector<Material>& materials, const GraphSet& graphs,
                             bool absorbing) {
  if (std::ranges::none_of(
          materials, [&](const Material& m) { return needs_medium_stack(m, graphs, absorbing); }))
    return kInheritMaterial;
  Material inside;
  inside.name = "inside of meshes";
  inside.program = ProgramId::kVolume;
  materials.push_back(inside);
  return static_cast<uint32_t>(materials.size() - 1);
}

std::vector<MeshMedium<float>> make_mesh_media(std::span<const Material> materials,
                                               const GraphSet& graphs, bool absorbing) {
  if (std::ranges::none_of(
          materials, [&](const Material& m) { return needs_medium_stack(m, graphs, absorbing); }))
    return {};
  std::vector<MeshMedium<float>> all(materials.size());
  for (size_t i = 0; i < all.size(); ++i) {
    const Material& m = materials[i];
    MeshMedium<float>& out = all[i];
    out = {};
    out.ior = 1;
    if (!is_glass(m, graphs)) continue;
    const BoundaryKind kind = is_clear(m) ? BoundaryKind::kClear : BoundaryKind::kRefracts;
    out.kind = static_cast<uint32_t>(kind);
    out.ior = m.ior;
    if (!is_solid(m)) continue;
    out.priority = m.openpbr.nested_priority;
    set_medium(m.openpbr, out);
  }
  return all;
}

}  // namespace wavecomb
