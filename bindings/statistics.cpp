// SPDX-License-Identifier: Apache-2.0
#include "statistics.h"

#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include <map>
#include <string>

namespace nb = nanobind;
using namespace wavecomb;

namespace {

/// Returns lists that are indexed by path depth: the numbers of rays, of shadow rays, of shaded
/// hits, and of paths that ended at this depth.
nb::dict depths_dict(const RenderStatistics& s) {
  nb::dict d;
  std::vector<uint64_t> ended;
  for (size_t i = 0; i < s.rays_at.size(); ++i)
    ended.push_back(s.rays_at[i] - (i + 1 < s.rays_at.size() ? s.rays_at[i + 1] : 0));
  d["rays"] = s.rays_at;
  d["shadow_rays"] = s.shadow_rays_at;
  d["records"] = s.records_at;
  d["paths_ended"] = ended;
  return d;
}

nb::list materials_list(const RenderStatistics& s) {
  nb::list out;
  for (const MaterialStatistics& m : s.materials) {
    nb::dict d;
    d["name"] = m.name;
    d["program"] = m.program;
    d["records"] = m.records;
    d["timed_records"] = m.timed_records;
    d["ns_per_record"] = m.measured_ns;
    d["calibrated_ns"] = m.calibrated_ns;
    d["predicted_ns"] = m.predicted_ns;
    out.append(d);
  }
  return out;
}

/// Returns shading statistics summed over the materials of each shading program, without programs
/// that shaded nothing.
nb::dict programs_dict(const RenderStatistics& s) {
  struct Sum {
    uint64_t records = 0, timed = 0;
    double ns = 0;
  };
  std::map<std::string, Sum> sums;
  for (const MaterialStatistics& m : s.materials) {
    Sum& sum = sums[m.program];
    sum.records += m.records;
    sum.timed += m.timed_records;
    sum.ns += m.measured_ns * static_cast<double>(m.timed_records);
  }
  nb::dict out;
  for (const auto& [name, sum] : sums) {
    if (sum.records == 0) continue;
    nb::dict d;
    d["records"] = sum.records;
    d["ns_per_record"] = sum.timed > 0 ? sum.ns / static_cast<double>(sum.timed) : 0.0;
    out[name.c_str()] = d;
  }
  return out;
}

nb::dict sharing_dict(const WorkDistribution& s) {
  nb::dict d, passes;
  d["groups"] = s.groups();
  d["longest_s"] = s.longest_s();
  for (size_t i = 0; i < kThreadCounts.size(); ++i)
    passes[std::to_string(kThreadCounts[i]).c_str()] = s.passes_s(i);
  d["passes_s"] = passes;
  return d;
}

nb::object allotment_dict(const AllocationStatistics& s) {
  if (s.pilot == 0) return nb::none();
  nb::dict d;
  d["pilot"] = s.pilot;
  d["least"] = s.least;
  d["most"] = s.most;
  d["gain"] = s.gain > 0 ? nb::cast(s.gain) : nb::none();
  return d;
}

nb::object guiding_dict(const GuidingStatistics& s) {
  if (s.paths == 0) return nb::none();
  nb::dict d;
  d["seconds"] = s.seconds;
  d["paths"] = s.paths;
  d["rounds"] = s.rounds;
  d["bounces"] = s.facts.records;
  d["cells"] = s.facts.cells;
  d["regions"] = s.facts.regions;
  d["guided_regions"] = s.facts.guided_regions;
  d["guided_share"] = s.facts.guided_share;
  d["moment_ratio"] = s.facts.moment_ratio;
  d["field_bytes"] = s.field_bytes;
  d["gain"] = s.gain > 0 ? nb::cast(s.gain) : nb::none();
  d["survival"] = s.survival;
  d["used"] = s.used;
  d["kept"] = s.is_reused;
  return d;
}

nb::object light_aiming_dict(const AimStatistics& s) {
  if (s.paths == 0) return nb::none();
  nb::dict d;
  d["targets"] = s.targets;
  d["paths"] = s.paths;
  d["seconds"] = s.seconds;
  return d;
}

nb::object transport_dict(const std::optional<TransportChoice>& choice) {
  if (!choice) return nb::none();
  nb::dict d;
  const bool is_light = choice->transport == Transport::kLight;
  d["chosen"] = is_light ? "light" : "path";
  d["why"] = choice->why;
  d["light_paths"] = is_light ? choice->share.paths() : 0.f;
  d["merges"] = is_light && choice->merges;
  d["gain"] = choice->gain > 0 ? nb::cast(choice->gain) : nb::none();
  d["seconds"] = choice->seconds;
  return d;
}

nb::dict light_calibration_dict(const LightShares& s) {
  nb::dict d;
  d["seconds"] = s.seconds;
  d["paths"] = s.paths;
  d["kept"] = s.kept;
  d["tilted_nodes"] = s.tilted_nodes;
  nb::list shares;
  for (const LightShare& part : s.parts) {
    nb::dict one;
    one["name"] = part.name;
    one["share"] = part.share;
    one["by_power"] = part.by_power;
    shares.append(one);
  }
  d["shares"] = shares;
  return d;
}

}  // namespace

nb::dict texture_store_dict(const StoreStatistics& s) {
  nb::dict d;
  d["limit_bytes"] = s.limit_bytes;
  d["texture_bytes"] = s.texture_bytes;
  d["file_bytes"] = s.file_bytes;
  d["resident_bytes"] = s.resident_bytes;
  d["peak_bytes"] = s.peak_bytes;
  d["grid_bytes"] = s.grid_bytes;
  d["loads"] = s.loads;
  d["releases"] = s.releases;
  d["load_s"] = s.load_s;
  return d;
}

nb::dict statistics_dict(const RenderStatistics& s, const nb::dict& settings, size_t image_bytes) {
  nb::dict d, seconds, phases, counts, memory;
  d["settings"] = settings;
  seconds["build"] = s.build_s;
  seconds["render"] = s.render_s;
  seconds["first_samples"] = s.first_samples_s;
  d["seconds"] = seconds;
  for (const auto& [name, value] : s.phases_s) phases[name.c_str()] = value;
  d["phases_s"] = phases;
  counts["samples"] = s.samples;
  counts["rays"] = s.rays;
  counts["shadow_rays"] = s.shadow_rays;
  counts["records"] = s.records;
  counts["packets"] = s.packets;
  counts["packet_lanes"] = s.packet_lanes;
  counts["volume_steps"] = s.volume_counts.steps;
  counts["volume_collisions"] = s.volume_counts.collisions;
  counts["volume_lanes"] = s.volume_counts.lanes;
  counts["walks"] = s.walks;
  counts["walk_steps"] = s.walk_steps;
  counts["walk_lanes"] = s.walk_lanes;
  d["counts"] = counts;
  const auto rate = [&](uint64_t n) {
    return s.render_s > 0 ? static_cast<double>(n) / s.render_s : 0.0;
  };
  d["samples_per_s"] = rate(s.samples);
  d["rays_per_s"] = rate(s.rays + s.shadow_rays);
  d["lane_utilisation"] = s.packet_lanes > 0
                              ? static_cast<double>(s.records) / static_cast<double>(s.packet_lanes)
                              : 1.0;
  d["depths"] = depths_dict(s);
  nb::dict coherence, costs;
  coherence["run_length"] = s.run_length;
  coherence["material_homogeneity"] = s.material_homogeneity;
  coherence["texture_homogeneity"] = s.texture_homogeneity;
  d["coherence"] = coherence;
  d["materials"] = materials_list(s);
  d["programs"] = programs_dict(s);
  costs["r2"] = s.cost_r2;
  costs["mean_error"] = s.cost_mean_error;
  costs["materials"] = s.cost_materials;
  costs["calibration_s"] = s.calibration_s;
  d["cost_prediction"] = costs;
  d["light_calibration"] = light_calibration_dict(s.light_calibration);
  d["allotment"] = allotment_dict(s.allotment);
  d["guiding"] = guiding_dict(s.guiding);
  d["transport"] = transport_dict(s.transport);
  d["light_aiming"] = light_aiming_dict(s.light_aiming);
  nb::list without_paths;
  for (const std::string& name : s.lights_without_paths) without_paths.append(name);
  d["lights_without_paths"] = without_paths;
  nb::dict uses;
  for (const auto& [name, n] : s.policy_uses) uses[name.c_str()] = n;
  d["policy_uses"] = uses;
  d["sharing"] = sharing_dict(s.sharing);
  d["threads"] = s.threads;
  d["wave_size"] = s.wave_size;
  d["lanes"] = s.lanes;
  memory["accelerator"] = s.accelerator_bytes;
  memory["waves"] = s.wave_bytes;
  memory["film"] = s.film_bytes;
  memory["picture"] = image_bytes;
  memory["meshes"] = s.scene_bytes.meshes;
  memory["textures"] = s.scene_bytes.textures;
  memory["records"] = s.scene_bytes.records;
  memory["volumes"] = s.scene_bytes.volumes;
  d["memory_bytes"] = memory;
  d["texture_store"] = nb::none();
  if (s.texture_store) d["texture_store"] = texture_store_dict(*s.texture_store);
  d["peak_rss_bytes"] = s.peak_rss_bytes;
  d["passes"] = s.passes;
  d["resumed_samples"] = s.resumed_samples;
  d["error"] = s.error;
  d["cancelled"] = s.cancelled;
  return d;
}
