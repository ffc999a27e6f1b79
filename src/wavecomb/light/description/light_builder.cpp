// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/light/description/light_builder.h"

#include <algorithm>
#include <bit>
#include <cmath>

#include "wavecomb/core/error.h"
#include "wavecomb/light/description/kind_info.h"
#include "wavecomb/light/description/motion.h"
#include "wavecomb/scene/parallel.h"
#include "wavecomb/scene/scene_limits.h"

namespace wavecomb {

namespace {

/// Makes the power of a light finite and not negative, so that powers can be compared.
double valid_power(double power) {
  const bool is_valid = std::isfinite(power) && power > 0;
  return is_valid ? power : (power > 0 ? 1e300 : 0);
}

void pack_profiles(LightSet& set, std::span<const IesProfile> profiles) {
  const auto append = [&](const std::vector<float>& values) {
    const auto first = static_cast<uint32_t>(set.ies_numbers.size());
    set.ies_numbers.insert(set.ies_numbers.end(), values.begin(), values.end());
    return first;
  };
  for (const IesProfile& p : profiles) {
    IesRecord r{};
    r.vertical_count = static_cast<uint32_t>(p.vertical.size());
    r.horizontal_count = static_cast<uint32_t>(p.horizontal.size());
    r.vertical = append(p.vertical);
    r.horizontal = append(p.horizontal);
    append(p.candela);
    set.ies.push_back(r);
  }
}

/// Packs the emissive triangles of `set` and writes their powers to `powers`.
void make_triangles(LightSet& set, size_t count, const TriangleSource& source, double* powers) {
  constexpr size_t kChunk = 4096;
  const size_t chunks = (count + kChunk - 1) / kChunk;
  std::vector<std::vector<TriangleUvs>> uvs(chunks);
  const auto each = [&](size_t chunk, const auto& one) {
    for (size_t i = chunk * kChunk; i < std::min(count, (chunk + 1) * kChunk); ++i) one(i);
  };
  set.triangles.resize(count);
  if (set.records.size() > set.record_count) set.mesh_lights.assign(count, kNoLight);
  parallel_for(chunks, [&](size_t chunk) {
    each(chunk, [&](size_t i) {
      const EmissiveTriangle t = source(i);
      const TriangleBuild out = make_triangle(set, t);
      set.triangles[i] = out.light;
      powers[i] = valid_power(out.power);
      if (t.mesh_light != kNoLight) set.mesh_lights[i] = set.record_count + t.mesh_light;
      if (!out.light.varies()) return;
      uvs[chunk].push_back({{t.uv0[0], t.uv0[1]},
                            {t.uv1[0], t.uv1[1]},
                            {t.uv2[0], t.uv2[1]},
                            t.mesh,
                            t.prim,
                            t.instance});
    });
  });
  for (size_t chunk = 0; chunk < chunks; ++chunk) {
    if (uvs[chunk].empty()) continue;
    auto next = static_cast<uint32_t>(set.triangle_uvs.size());
    each(chunk, [&](size_t i) {
      TriangleLight& t = set.triangles[i];
      if (t.varies()) t.radiance[2] = std::bit_cast<float>(next++);
    });
    set.triangle_uvs.insert(set.triangle_uvs.end(), uvs[chunk].begin(), uvs[chunk].end());
  }
}

}  // namespace

LightView LightSet::view(const MaterialView& materials) const {
  LightView v;
  v.lights = records.data();
  v.triangles = triangles.data();
  v.triangle_uvs = triangle_uvs.data();
  v.power_table = power_table;
  v.power_table.bins = power_bins.empty() ? nullptr : power_bins.data();
  v.tree = tree.view();
  v.count = static_cast<uint32_t>(size());
  v.first_triangle = first_triangle();
  v.infinite_count = infinite_count;
  v.distributions = distributions.data();
  if (!portals.empty()) {
    v.portals = portals.data();
    v.portal_groups = portal_groups.data();
  }
  if (!shapings.empty()) {
    v.shapings = shapings.data();
    v.ies = ies.data();
    v.ies_numbers = ies_numbers.data();
  }
  if (!filters.empty()) v.filters = filters.data();
  if (!motions.empty()) {
    v.motions = motions.data();
    v.motion_steps = motion_steps.data();
  }
  if (!shadows.empty()) v.shadows = shadows.data();
  if (records.size() > record_count) v.mesh_lights = mesh_lights.data();
  for (const LightRecord& record : records) {
    v.has_multipliers |= record.diffuse != 1 || record.specular != 1;
    v.has_effects |= v.has_multipliers || record.sampled_only != 0;
  }
  v.materials = materials;
  return v;
}

void check_light_count(uint64_t count) {
  if (count > kMaxLights)
    throw Error("the scene has " + with_commas(count) + " lights and emissive triangles; " +
                with_commas(kMaxLights) +
                " can be numbered; give meshes that emit fewer triangles or instances");
}

LightSet build_lights(const LightInputs& inputs) {
  const std::span<const Light> lights = inputs.lights;
  const std::span<const MeshLightInstance> mesh_lights = inputs.mesh_lights;
  const size_t triangle_count = inputs.triangle_count;
  check_light_count(lights.size() + triangle_count);
  SceneCounts counts{.lights = lights.size() + mesh_lights.size()};
  for (const Light& light : lights) counts.lights += light.portals.size();
  for (const IesProfile& p : inputs.profiles)
    counts.profile_values += p.vertical.size() + p.horizontal.size() + p.candela.size();
  check_counts(counts);
  const float radius = inputs.scene_radius;
  const double scene_radius = std::isfinite(radius) && radius > 0 ? double{radius} : 1.0;
  LightSet set;
  std::vector<double> powers;
  set.records.reserve(lights.size() + mesh_lights.size());
  powers.reserve(lights.size() + triangle_count);
  set.of_input.resize(lights.size());
  pack_profiles(set, inputs.profiles);
  for (const LightFilter& filter : inputs.filters) set.filters.push_back(make_light_filter(filter));
  LightBuildContext context{
      set, inputs.before, scene_radius, inputs.textures, inputs.profiles, inputs.filters};
  for (const bool infinite : {true, false}) {
    for (size_t i = 0; i < lights.size(); ++i) {
      if (info_of(lights[i].kind).has(light_trait::kInfinite) != infinite) continue;
      set.of_input[i] = static_cast<uint32_t>(set.records.size());
      const LightBuild out = make_light(lights[i], context);
      set.records.push_back(out.record);
      powers.push_back(valid_power(out.power));
    }
    if (infinite) set.infinite_count = static_cast<uint32_t>(set.records.size());
  }
  set.record_count = static_cast<uint32_t>(set.records.size());
  add_motions(set, lights);
  for (const MeshLightInstance& placed : mesh_lights)
    set.records.push_back(make_mesh_light(placed, context));
  powers.resize(lights.size() + triangle_count);
  make_triangles(set, triangle_count, inputs.triangle, powers.data() + lights.size());

  for (const double power : powers) set.total_power += power;
  if (powers.size() <= inputs.max_power_lights) {
    std::vector<uint32_t> numbers;
    set.power_table = build_power_table(powers, set.first_triangle(), set.power_bins, numbers);
    const auto pdf = [&](size_t i) { return static_cast<float>(numbers[i]) * 0x1p-24f; };
    for (size_t i = 0; i < set.record_count; ++i) set.records[i].selection_pdf = pdf(i);
    for (size_t i = 0; i < triangle_count; ++i)
      set.triangles[i].selection_pdf = pdf(set.first_triangle() + i);
  }
  set.tree = outline_light_tree(set, powers);
  if (inputs.tree_time == TreeTime::kNow || set.power_bins.empty() ||
      prefers_tree(set.tree.effective_lights))
    set.tree = build_light_tree(set, powers);
  else
    set.powers = std::move(powers);
  return set;
}

}  // namespace wavecomb
