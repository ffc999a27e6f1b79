// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/guiding/field/field.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "wavecomb/guiding/field/field_builder.h"
#include "wavecomb/guiding/lookup.inl"

namespace wavecomb {
namespace {

/// Maximum number of training records in a cell; cells with more records are divided.
constexpr size_t kCellRecords = 2048;
/// Factor by which the survival probability of roulette is increased. Moments that are estimated
/// from few training paths miss rare light. Terminating paths too often where rare light arrives
/// causes bright pixels, whereas continuing paths too often costs only a few rays.
constexpr double kSafety = 1.5;

}  // namespace

GuidingField::GuidingField(const GuidingGrid& grid, std::span<const TrainingRecord> records,
                           size_t materials, bool first, bool guides, size_t max_bytes)
    : grid_(grid) {
  GuidingFieldBuilder builder(grid, records, materials, first, guides);
  for (size_t cell_records = kCellRecords;; cell_records *= 2) {
    GuidingFieldBuilder::Field built = builder.build(cell_records);
    parts_ = std::move(built.parts);
    facts_ = built.facts;
    if (bytes() <= max_bytes || cell_records >= records.size()) break;
  }
  compute_survival({}, {});
}

GuidingField::GuidingField(const GuidingGrid& grid, GuidingFieldArrays parts,
                           const GuidingFieldStatistics& facts, size_t materials)
    : grid_(grid), parts_(std::move(parts)), facts_(facts) {
  check_guiding_arrays(parts_, materials);
}

uint64_t bounce_position_key(const GuidingGrid& grid, const Vec3<float>& p, uint32_t axis) {
  return uint64_t{grid_code(grid, {p.x, p.y, p.z})} << 3 | axis;
}

void GuidingField::compute_survival(std::span<const BounceSample> training_samples,
                                    const PathStatistics& paths) {
  struct Sums {
    double count = 0, squared = 0, cost = 0;
  };
  const size_t regions = parts_.bsdf_share.size();
  std::vector<Sums> sums(regions + 1);  // the last element is the sum over all regions
  parts_.survival.assign(regions, 0.f);
  const auto add = [](Sums& s, const BounceSample& sample) {
    s.count += 1;
    // Do not clamp second moments, since a region whose light varies strongly should terminate few
    // paths.
    if (std::isfinite(sample.squared)) s.squared += double{sample.squared};
    s.cost += double{sample.cost};
  };
  const GuidingView v = view();
  for (const BounceSample& sample : training_samples) {
    if (!v.grid) break;
    const auto [x, y, z] = grid_position(static_cast<uint32_t>(sample.position_key >> 3));
    const uint32_t cell = detail::guiding_cell<float>(v, x, y, z, true);
    const uint32_t region = parts_.cells[size_t{cell} * kGuidingAxes + (sample.position_key & 7u)];
    if (region != kNoGuidingRegion) add(sums[region], sample);
    add(sums[regions], sample);
  }
  for (size_t i = 0; i < regions; ++i) {
    const Sums& s = sums[i].count >= kMinRegionRecords ? sums[i] : sums[regions];
    if (s.cost > 0 && paths.variance > 0)
      parts_.survival[i] = static_cast<float>(
          kSafety * std::sqrt(std::max(s.squared, 0.0) / s.cost * paths.cost / paths.variance));
  }
}

GuidingView GuidingField::view() const {
  GuidingView view;
  for (int i = 0; i < 3; ++i) {
    view.lo[i] = grid_.lo[i];
    view.scale[i] = grid_.scale[i];
  }
  if (parts_.bsdf_share.empty()) return view;
  view.grid = parts_.entries.data();
  view.cells = parts_.cells.data();
  view.tables = parts_.tables.data();
  view.spheres = parts_.spheres.data();
  view.bsdf_share = parts_.bsdf_share.data();
  view.survival = parts_.survival.data();
  view.material_share = parts_.material_share.data();
  return view;
}

size_t GuidingField::bytes() const {
  return parts_.bytes();
}

}  // namespace wavecomb
