// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/render/inspection/learned_lookup.h"

#include <algorithm>

#include "wavecomb/guiding/lookup.h"
#include "wavecomb/guiding/region_directions.h"
#include "wavecomb/light/calibration/partition.h"
#include "wavecomb/light/sampling/light_sample.h"
#include "wavecomb/light/tree/light_tree.h"

namespace wavecomb {
namespace {

void look_up_field(const GuidingTraining& training, const LearnedQuery& point, LearnedData& out) {
  if (!training.field) return;
  const GuidingView view = view_of(training);
  const auto found = look_up_guiding<float>(view, point.p, out.axis, point.material, true);
  out.known = found.known;
  if (!found.known) return;
  out.guided_share = 1.f - found.bsdf_share;
  out.survival = found.survival;
  out.density.resize(kGuidingBins);
  for (uint32_t i = 0; i < kGuidingBins; ++i)
    out.density[i] = guiding_pdf<float>(view, found, bin_direction(i), true);
}

/// Estimates the selection probabilities of lights at `point`: selects lights with evenly spaced
/// sample values, and counts how often each light is selected.
void count_lights(const Learned& learned, const LearnedQuery& point, LearnedData& out) {
  const Scene& scene = *learned.scene;
  const LightParts parts = divide_lights(scene, false);  // used for the names of lights
  LightView lights = scene.view().lights;
  if (lights.count == 0 || lights.count > kMaxCalibratedLights) return;
  if (parts.size() == 0) {  // the scene has a single light or emissive mesh
    out.light_shares.emplace_back("the only light", 1.f);
    return;
  }
  lights.by_tree = learned.by_tree;
  if (learned.by_tree) lights.tree = scene.light_tree(0).view();
  if (learned.lights) learned.lights->apply(lights);
  LightReceiver<float> receiver(point.p, pack_normal<float>(point.n));
  std::vector<uint32_t> counts(parts.size());
  constexpr uint32_t kStep = (1u << 24) / kCountedChoices;
  for (uint32_t i = 0; i < kCountedChoices; ++i) {
    receiver.seed = i;
    const float u = static_cast<float>(i * kStep + kStep / 2) * 0x1p-24f;
    const uint32_t light = select_light_index<float>(lights, receiver, u, true);
    const uint32_t part = light == kNoLight ? kNoPart : parts.of(light);
    if (part != kNoPart) ++counts[part];
  }
  for (size_t part = 0; part < counts.size(); ++part)
    if (counts[part] > 0)
      out.light_shares.emplace_back(parts.names[part],
                                    static_cast<float>(counts[part]) / kCountedChoices);
  std::stable_sort(out.light_shares.begin(), out.light_shares.end(),
                   [](const auto& a, const auto& b) { return a.second > b.second; });
}

}  // namespace

LearnedData look_up(const Learned& learned, const LearnedQuery& point) {
  LearnedData out;
  out.axis = guiding_axis<float>(point.n);
  if (learned.training) look_up_field(*learned.training, point, out);
  count_lights(learned, point, out);
  return out;
}

}  // namespace wavecomb
