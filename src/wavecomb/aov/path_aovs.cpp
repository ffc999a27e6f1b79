// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/aov/path_aovs.h"

namespace wavecomb {
namespace {

void add_to(double* sums, const Vec3<float>& v) {
  sums[0] += double{v.x};
  sums[1] += double{v.y};
  sums[2] += double{v.z};
}

/// Adds `all` - `before`, the difference of two RGB colours, to `sums`. Does nothing if `sums` is
/// null.
void add_difference(double* sums, const float* all, const float* before) {
  for (size_t c = 0; c < 3 && sums; ++c) sums[c] += double{all[c]} - double{before[c]};
}

const float* values_of(const float& value) {
  return &value;
}
const float* values_of(const Vec3<float>& value) {
  return &value.x;
}

}  // namespace

void PathAovs::resolve_ends(AovFilm& film, size_t pixel, const SlotRange& slots,
                            const float* radiance) const {
  if (depth_)
    slots.for_each([&](uint32_t slot) {
      if (!std::isfinite(depth_.rows[slot])) return;
      film.add(Aov::kDepth, pixel, depth_.rows + slot);
      film.count_hit(pixel);
    });
  if (end_)
    slots.for_each([&](uint32_t slot) {
      const auto row = load_row<RayEndRow, float>(end_.rows, slot, true);
      if (layout_.set.has(Aov::kTransmittance))
        film.add(Aov::kTransmittance, pixel, &row.through.x);
      if (layout_.set.has(Aov::kHalfDepth)) film.add_to_median(Aov::kHalfDepth, pixel, row.depth);
      if (layout_.set.has(Aov::kDeep) && std::isfinite(row.depth))
        film.deep().add(pixel, row.depth, row.in_volume > 0, radiance + slot * kRadianceWords);
    });
  if (alpha_)
    slots.for_each([&](uint32_t slot) { film.add(Aov::kAlpha, pixel, alpha_.rows + slot); });
}

template <typename Put>
void PathAovs::for_each_vertex_aov(AovKind kind, const Put& put) const {
  for (const AovRow& row : kAovs)
    if (row.kind == kind && row.source == AovSource::kVertex &&
        vertex_at_[aov_index(row.aov)] != kNoWords)
      put(row.aov, vertex_.rows + vertex_at_[aov_index(row.aov)]);
}

void PathAovs::resolve_vertices(AovFilm& film, size_t pixel, const SlotRange& slots) const {
  for_each_vertex_aov(AovKind::kMean, [&](Aov aov, const float* rows) {
    slots.for_each([&](uint32_t slot) { film.add(aov, pixel, rows + slot * vertex_.words); });
  });
  if (hits_) {
    slots.for_each([&](uint32_t slot) {
      const auto hit = load_row<FirstHitRow, float>(hits_.rows, slot, true);
      if (tables_) film.add_ids(pixel, hit.object, hit.material, tables_->crypto);
      if (!centre_ || !film.is_nearest(pixel, centre_.rows[slot])) return;
      for_each_hit_value(
          hit, [&](Aov aov, const auto& value) { film.put(aov, pixel, values_of(value)); });
      if (motion_) film.put(Aov::kMotion, pixel, motion_.rows + size_t{2} * slot);
      for_each_vertex_aov(AovKind::kNearest, [&](Aov aov, const float* rows) {
        film.put(aov, pixel, rows + slot * vertex_.words);
      });
    });
  }
  if (guides_) {
    double* albedo = film.sums(Aov::kGuideAlbedo, pixel);
    double* normal = film.sums(Aov::kGuideNormal, pixel);
    slots.for_each([&](uint32_t slot) {
      const auto row = load_row<GuideRow, float>(guides_.rows, slot, true);
      if (albedo) add_to(albedo, row.albedo);
      if (normal) add_to(normal, row.normal);
    });
  }
}

void PathAovs::resolve_light(AovFilm& film, size_t pixel, const SlotRange& slots,
                             const float* radiance) const {
  if (parts_[0]) {
    const float none[3] = {0, 0, 0};
    double* emission = film.sums(Aov::kEmission, pixel);
    double* direct = film.sums(Aov::kDirect, pixel);
    double* indirect = film.sums(Aov::kIndirect, pixel);
    slots.for_each([&](uint32_t slot) {
      const size_t row = slot * kRadianceWords;
      const float *emitted = parts_[0].rows + row, *with_direct = parts_[1].rows + row;
      add_difference(emission, emitted, none);
      add_difference(direct, with_direct, emitted);
      add_difference(indirect, radiance + row, with_direct);
      if (!early_connections_) return;
      const float* links = early_connections_.rows + row;
      add_difference(direct, none, links);
      add_difference(indirect, links, none);
    });
  }
  if (groups_) {
    double* sums = film.sums(Aov::kLightGroups, pixel);
    slots.for_each([&](uint32_t slot) {
      for (uint32_t g = 0; g < layout_.light_groups; ++g) {
        const auto c =
            load_row<RadianceRow, float>(groups_.rows, slot * layout_.light_groups + g, true).sum;
        add_to(sums + 3 * g, c);
      }
    });
  }
  if (expressions_) {
    double* sums = film.sums(Aov::kExpressions, pixel);
    slots.for_each([&](uint32_t slot) {
      const float* found = expressions_.sums(slot);
      for (uint32_t i = 0; i < 3 * layout_.expressions; ++i) sums[i] += double{found[i]};
    });
  }
  for (size_t i = 0; i < std::size(kTechniqueAovs); ++i) {
    double* sums = film.sums(kTechniqueAovs[i].aov, pixel);
    slots.for_each([&](uint32_t slot) {
      const float* row = by_technique_[i].rows + slot * kRadianceWords;
      for (size_t c = 0; c < 3 && sums; ++c) sums[c] += double{row[c]};
    });
  }
  if (double* bounced = film.sums(Aov::kByBounces, pixel)) {
    const Block& sampled = by_technique_[technique_index(Aov::kByLightSamples)];
    slots.for_each([&](uint32_t slot) {
      const size_t row = slot * kRadianceWords;
      add_difference(bounced, radiance + row, sampled.rows + row);
    });
  }
}

void PathAovs::resolve_work(AovFilm& film, size_t pixel, const SlotRange& slots) const {
  if (bounces_) {
    double* guided = film.sums(Aov::kGuidedShare, pixel);
    double* survival = film.sums(Aov::kSurvival, pixel);
    slots.for_each([&](uint32_t slot) {
      const auto row = load_row<BounceRow, float>(bounces_.rows, slot, true);
      const bool bounced = row.bounces > 0;
      if (guided && bounced) *guided += double{row.guided} / double{row.bounces};
      if (survival) *survival += bounced ? double{row.survived} / double{row.bounces} : 1.0;
    });
  }
  if (cost_ns_)
    slots.for_each([&](uint32_t slot) { film.add(Aov::kCost, pixel, cost_ns_.rows + slot); });
}

void PathAovs::resolve(AovFilm& film, size_t pixel, size_t begin, size_t end,
                       const float* radiance) const {
  const SlotRange slots{static_cast<uint32_t>(begin), static_cast<uint32_t>(end)};
  resolve_ends(film, pixel, slots, radiance);
  resolve_vertices(film, pixel, slots);
  resolve_light(film, pixel, slots, radiance);
  resolve_work(film, pixel, slots);
}

}  // namespace wavecomb
