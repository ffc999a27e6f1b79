// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/render/statistics/render_statistics.h"
#include "wavecomb/render/passes/pass_runner.h"
#include "wavecomb/render/pilots/light_calibration.h"
#include "wavecomb/render/statistics/render_costs.h"
#include "wavecomb/wave/wave.h"

#include <cstddef>

namespace wavecomb {
namespace {

/// Returns counts by depth, without the depths that no path reached.
template <typename Counts>
std::vector<uint64_t> reached(const Counts& at) {
  size_t n = at.size();
  while (n > 0 && at[n - 1] == 0) --n;
  return {at.begin(), at.begin() + static_cast<std::ptrdiff_t>(n)};
}

std::vector<MaterialStatistics> material_statistics(const std::vector<WorkerView>& workers,
                                                    const WaveContext& context, const Scene& scene,
                                                    const RenderCosts& costs) {
  std::vector<MaterialStatistics> out;
  for (size_t m = 0; m < context.traits.size(); ++m) {
    MaterialStatistics material;
    material.name = scene.materials()[m].name;
    material.program = kProgramNames[static_cast<size_t>(scene.materials()[m].program)];
    for (const WorkerView& worker : workers)
      if (worker.costs) material.records += worker.costs->record_counts()[m];
    material.timed_records = costs.total_timed()[m];
    if (material.timed_records > 0)
      material.measured_ns = costs.total_ns()[m] / static_cast<double>(material.timed_records);
    material.calibrated_ns = costs.calibrated().material_ns[m];
    material.predicted_ns = costs.order.material_ns[m];
    out.push_back(std::move(material));
  }
  return out;
}

}  // namespace

void add_up(const PassRunner& runner, const WaveContext& context, const Scene& scene,
            const RenderCosts& costs, RenderStatistics& s) {
  PhaseClock clock;
  Counts counts;
  CoherenceCounts coherence;
  std::vector<uint64_t> uses(context.policies.size());
  std::vector<WorkerView> workers;
  for (uint32_t i = 0; i < runner.threads(); ++i) {
    const WorkerView worker = runner.integrator().worker(i);
    if (worker.clock) clock.add(*worker.clock);
    if (worker.counts) counts.add(*worker.counts);
    if (worker.coherence) coherence.add(*worker.coherence);
    for (size_t p = 0; worker.policies && p < uses.size(); ++p)
      uses[p] += worker.policies->used()[p];
    s.wave_bytes += worker.bytes;
    workers.push_back(worker);
  }
  s.lanes = runner.integrator().lanes();
  s.sharing = runner.work_distribution();
  for (size_t i = 0; i < kPhaseCount; ++i)
    s.phases_s.emplace_back(kPhaseNames[i], 1e-9 * static_cast<double>(clock.ns()[i]));
  s.samples = counts.samples;
  s.rays = counts.rays;
  s.shadow_rays = counts.shadow_rays;
  s.records = counts.records;
  s.packets = counts.packets;
  s.packet_lanes = counts.packet_lanes;
  s.volume_counts = counts.volumes;
  s.walks = counts.walks;
  s.walk_steps = counts.walk_steps;
  s.walk_lanes = counts.walk_lanes;
  s.rays_at = reached(counts.rays_at);
  s.shadow_rays_at = reached(counts.shadow_rays_at);
  s.records_at = reached(counts.records_at);
  s.run_length = coherence.run_length();
  s.material_homogeneity = coherence.material_homogeneity();
  s.texture_homogeneity = coherence.texture_homogeneity();
  s.materials = material_statistics(workers, context, scene, costs);
  s.cost_r2 = costs.prediction().r2;
  s.cost_mean_error = costs.prediction().mean_error;
  s.cost_materials = costs.prediction().materials;
  s.calibration_s = costs.calibration_s();
  if (uses.size() > 1)
    for (size_t p = 0; p < uses.size(); ++p)
      s.policy_uses.emplace_back(std::string(context.policies[p]->name()), uses[p]);
}

LightShares light_shares(const LightCalibration& calibration) {
  LightShares out{
      calibration.seconds, calibration.paths, calibration.kept, calibration.tilted_nodes, {}};
  const LightParts& parts = calibration.parts;
  for (size_t i = 0; i < parts.size(); ++i)
    out.parts.push_back({parts.names[i], calibration.tables.shares[i], parts.power[i]});
  return out;
}

}  // namespace wavecomb
