// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/guiding/bounce/bounce_reader.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

#include "wavecomb/guiding/lookup.h"
#include "wavecomb/guiding/path_moments.h"
#include "wavecomb/guiding/roulette.h"
#include "wavecomb/path/steps/survive.h"

namespace wavecomb {
namespace {

/// Returns one over the length of the bounce ray from vertex `i`. The value 0 means that the bounce
/// ray left the scene. A negative value means that the length is unknown, because the next vertex
/// was not recorded.
float bounce_inverse_distance(const PathHistory& history, uint32_t slot, uint32_t i) {
  if (i + 1 == BounceReader::kVertices) return -1;
  if (i + 1 >= history.count(slot)) return 0;
  const float distance = length(history.vertex(slot, i + 1).p - history.vertex(slot, i).p);
  return distance > 0 && std::isfinite(1 / distance) ? 1 / distance : -1;
}

}  // namespace

BounceReader::BounceReader(std::span<const uint32_t> pixels, const TrainingPlan& plan)
    : pixels_(pixels), plan_(plan) {
  const size_t paths = pixels.size() * plan.samples;
  records_.resize(paths * kVertices);
  bounces_.resize(paths * kVertices);
  record_counts_.assign(paths, 0);
  bounce_counts_.assign(paths, 0);
  luminance_.assign(paths, 0.f);
  paths_.assign(paths, {});
}

void BounceReader::ended(const PathHistory& history, const float* radiance, const WaveTask& task) {
  const bool is_lit = plan_.tiles && plan_.tiles->is_lit();
  for (uint32_t slot = 0; slot < task.path_count(); ++slot) {
    const auto pixel = static_cast<size_t>(task.pixels - pixels_.data()) + slot / task.samples;
    const size_t path =
        pixel * plan_.samples + (task.first_sample - plan_.first) + slot % task.samples;
    const Color<float> end = load_row<RadianceRow, float>(radiance, slot, true).sum;
    luminance_[path] = luminance(end);
    read(history, slot, end, path,
         is_lit ? static_cast<float>(plan_.tiles->inverse_scale(pixels_[pixel])) : 1.f);
  }
}

void BounceReader::read(const PathHistory& history, uint32_t slot, const Color<float>& end,
                        size_t path, float inverse_scale) {
  std::array<PathStep, kVertices> steps;
  std::array<uint64_t, kVertices> position_keys;
  std::array<bool, kVertices> is_sample;
  uint32_t count = 0;
  Color<float> throughput(1.f);
  double reached = 1;  // Probability with which a path reaches the vertex if roulette is used.
  // The vertex at the maximum depth has no bounce.
  for (; count < std::min(history.count(slot), plan_.max_depth); ++count) {
    const HistoryRow<float> v = history.vertex(slot, count);
    const GuidingLookup<float> guiding =
        look_up_guiding<float>(plan_.guide, v.p, v.axis, v.material, true);
    const float arrived = luminance(throughput), contribution = luminance(end - v.radiance);
    const float value = contribution / arrived;
    const bool is_black_path = is_black(v.throughput),
               is_bright = value > 0 && std::isfinite(value);
    throughput = v.throughput;
    if (!is_black_path && v.pdf > 0 && is_bright)
      add_record(path, v, guiding, bounce_inverse_distance(history, slot, count), value,
                 arrived * inverse_scale);
    PathStep& step = steps[count];
    step = {double{arrived}, double{luminance(throughput)},
            is_bright && !is_black_path ? double{contribution} : 0.0, 1,
            plan_.costs.vertex(v.material)};
    if (count + 1 >= plan_.roulette_depth) {
      // Throughput of a path that reached the vertex, divided by the image brightness and by the
      // path's survival probability.
      const double share = double{arrived} * double{inverse_scale} / reached;
      step.survival = guiding.known
                          ? double{efficient_survival<float>(guiding, static_cast<float>(share))}
                          : std::clamp(double{kRouletteGain} * step.left / reached, 1e-3, 1.0);
      paths_[path].vertices += reached;
      reached *= step.survival;
      paths_[path].survivors += reached;
    }
    position_keys[count] = bounce_position_key(plan_.grid, v.p, v.axis);
    is_sample[count] = is_black_path || v.pdf > 0;
  }
  std::array<BounceMoments, kVertices> moments;
  const bool is_cut = count == kVertices && plan_.max_depth > count;
  compute_path_moments({steps.data(), count}, plan_.costs.ray,
                       is_cut ? steps[count - 1].vertex_cost : 0, moments);
  for (uint32_t j = 0; j < count; ++j)
    if (is_sample[j])
      bounces_[path * kVertices + bounce_counts_[path]++] = {
          position_keys[j], static_cast<float>(steps[j].value()),
          static_cast<float>(moments[j].squared), static_cast<float>(moments[j].cost)};
  PathStatistics& all = paths_[path];
  all.cost = plan_.costs.ray;
  if (count == 0) return;
  all.cost += steps[0].vertex_cost + moments[0].cost;
  all.variance = moments[0].squared - steps[0].value() * steps[0].value();
}

void BounceReader::append_to(TrainingSamples& training_samples) const {
  const auto append = [](auto& all, const auto& own, size_t path, uint32_t count) {
    const auto from = own.begin() + static_cast<std::ptrdiff_t>(path * kVertices);
    all.insert(all.end(), from, from + count);
  };
  const auto total = [](const std::vector<uint8_t>& counts) {
    return std::accumulate(counts.begin(), counts.end(), size_t{0});
  };
  training_samples.records.reserve(training_samples.records.size() + total(record_counts_));
  training_samples.bounces.reserve(training_samples.bounces.size() + total(bounce_counts_));
  for (size_t path = 0; path < paths_.size(); ++path) {
    append(training_samples.records, records_, path, record_counts_[path]);
    append(training_samples.bounces, bounces_, path, bounce_counts_[path]);
  }
  training_samples.luminances.insert(training_samples.luminances.end(), luminance_.begin(),
                                     luminance_.end());
  training_samples.paths.insert(training_samples.paths.end(), paths_.begin(), paths_.end());
}

void BounceReader::add_record(size_t path, const HistoryRow<float>& v,
                              const GuidingLookup<float>& guiding, float inverse_distance,
                              float value, float weight) {
  TrainingRecord& r = records_[path * kVertices + record_counts_[path]++];
  r = {{v.p.x, v.p.y, v.p.z},
       {v.wi.x, v.wi.y, v.wi.z},
       inverse_distance,
       v.material,
       static_cast<uint8_t>(v.axis),
       value,
       v.pdf,
       v.bsdf_pdf,
       0.f,
       weight};
  if (guiding.known) r.guiding_pdf = guiding_pdf<float>(plan_.guide, guiding, v.wi, true);
}

}  // namespace wavecomb
