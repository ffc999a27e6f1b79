// SPDX-License-Identifier: Apache-2.0
/// Tests that lights are selected with the probabilities that the renderer computes: by power, by
/// calibrated shares, by the light tree, and by the tree with shares and calibrated nodes.
#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>

#include "chi_square.h"
#include "light_tree_testing.h"
#include "parts.h"
#include "wavecomb/light/calibration/partition.h"
#include "wavecomb/light/sampling/light_sample.h"

namespace wavecomb {
namespace {

using namespace light_testing;
using chi_square::Battery;

float stated(const LightView& view, uint32_t light, const LightReceiver<float>& to) {
  if (view.by_tree) return selection_pdf(view, light, to);
  if (view.selection_pdf) return view.selection_pdf[light];
  return light < view.first_triangle ? view.lights[light].selection_pdf
                                     : view.triangles[light - view.first_triangle].selection_pdf;
}

/// Counts how often each light is selected for a receiver. The last cell counts no selection;
/// lights that cannot be selected have no cell.
void count(Battery& battery, const std::string& name, const LightView& view,
           LightReceiver<float> to, uint32_t seed) {
  const size_t samples = chi_square::usual_samples();
  std::vector<double> observed(view.count + 1, 0), expected(view.count + 1, 0);
  double sum = 0;
  for (uint32_t i = 0; i < view.count; ++i) sum += expected[i] = double{stated(view, i, to)};
  EXPECT_LT(sum, 1 + 1e-5) << name;
  expected[view.count] = sum > 1 - 1e-5 ? 0 : 1 - sum;
  for (double& e : expected) e *= static_cast<double>(samples);
  chi_square::Random random(seed);
  for (size_t i = 0; i < samples; ++i) {
    const float u = random();
    to.seed = random.bits();
    uint32_t light = select_light_index<float>(view, to, u, true);
    if (light == kNoLight) light = view.count;
    observed[light] += 1;
  }
  for (uint32_t i = 0; i <= view.count; ++i)
    if (expected[i] == 0) {
      ASSERT_EQ(observed[i], 0) << name << ", light " << i;
    }
  battery.add(name, chi_square::p_of_counts(observed, expected));
}

/// Puts each light record into a separate part. Puts all triangle lights, or all lights of the
/// tree, into one more part.
LightParts parts_of(const LightSet& set, bool by_tree) {
  LightParts parts;
  parts.by_tree = by_tree;
  parts.of_record.assign(set.record_count, kNoPart);
  double sum = 0;
  for (uint32_t i = 0; i < (by_tree ? set.infinite_count : set.record_count); ++i) {
    const double pdf = double{by_tree ? set.tree.infinite_pdf[i] : set.records[i].selection_pdf};
    if (!(pdf > 0)) continue;
    parts.of_record[i] = static_cast<uint32_t>(parts.size());
    parts.power.push_back(pdf);
    sum += pdf;
  }
  parts.power.push_back(1 - sum);
  if (!by_tree) parts.of_mesh = {{set.first_triangle(), static_cast<uint32_t>(parts.size() - 1)}};
  return parts;
}
std::vector<double> odd_shares(size_t n) {
  std::vector<double> shares(n);
  Numbers number(31);
  for (double& s : shares) s = std::exp(double{number.between(-3, 3)});
  const double sum = std::accumulate(shares.begin(), shares.end(), 0.0);
  for (double& s : shares) s /= sum;
  return shares;
}

TEST(LightChoice, IsAsOftenAsStated) {
  Battery battery("choice of a light");
  for (const size_t n : {3, 100}) {
    const Lights lights = random_lights(n, 5, 3);
    const LightView power = lights.view(), tree = by_tree(lights);
    const LightParts table_parts = parts_of(lights.set, false),
                     tree_parts = parts_of(lights.set, true);
    const CalibratedLights table = LightTableBuilder(lights.set, lights.set.tree, table_parts)
                                       .build_tables(odd_shares(table_parts.size()), {});
    std::vector<NodeTilt> tilts;
    for (uint32_t i = 0; i < std::min<size_t>(lights.set.tree.nodes.size(), 40); i += 3)
      tilts.push_back({i, i % 2 ? 6.f : 0.2f});
    const CalibratedLights tilted = LightTableBuilder(lights.set, lights.set.tree, tree_parts)
                                        .build_tables(odd_shares(tree_parts.size()), tilts);
    LightView calibrated = power, calibrated_tree = tree;
    table.apply(calibrated);
    tilted.apply(calibrated_tree);
    const std::string of = " of " + std::to_string(n);
    const Vec3<float> origin(0.f);
    count(battery, "by power" + of, power, origin, 1);
    count(battery, "by power, calibrated" + of, calibrated, origin, 2);
    Numbers number(6);
    for (uint32_t k = 0; k < (is_long() ? 12u : 4u); ++k) {
      const LightReceiver<float> to = random_receiver(number);
      count(battery, "by tree" + of + ", " + std::to_string(k), tree, to, 10 + k);
      count(battery, "by tree, calibrated" + of + ", " + std::to_string(k), calibrated_tree, to,
            40 + k);
    }
  }
  battery.judge();
}

TEST(LightChoice, GivesTheProbabilityThatItWasMadeWith) {
  const Lights lights = random_lights(100, 5, 3);
  const LightView view = by_tree(lights);
  Numbers number(8);
  for (int i = 0; i < 20000; ++i) {
    LightReceiver<float> to = random_receiver(number);
    to.seed = static_cast<uint32_t>(number.rng());
    const LightChoice<float> c = detail::choose_by_tree<float>(view, to, number(), true);
    if (c.light != kNoLight) {
      ASSERT_EQ(c.pdf, selection_pdf(view, c.light, to));
    }
  }
}

}  // namespace
}  // namespace wavecomb
