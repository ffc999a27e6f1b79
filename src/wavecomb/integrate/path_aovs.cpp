// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/integrate/path_aovs.h"

namespace wavecomb {
namespace {

void add_to(double (&sum)[3], const Vec3<float>& v) {
  sum[0] += double{v.x};
  sum[1] += double{v.y};
  sum[2] += double{v.z};
}

}  // namespace

void PathAovs::resolve(AovFilm& film, size_t pixel, size_t begin, size_t end,
                       const float* radiance) const {
  const auto for_each_slot = [&](const auto& one) {
    for (auto slot = static_cast<uint32_t>(begin); slot < end; ++slot) one(slot);
  };
  const auto first_vertex = [&](uint32_t slot) {
    return load_row<FirstVertexRow, float>(first_.rows, slot, true);
  };
  if (film.has_first()) {
    AovFilm::First& first = film.first(pixel);
    if (first_) {
      for_each_slot([&](uint32_t slot) {
        const FirstVertexRow<float> row = first_vertex(slot);
        add_to(first.albedo, row.albedo);
        add_to(first.normal, row.normal);
      });
    }
    if (depth_) {
      for_each_slot([&](uint32_t slot) {
        if (!std::isfinite(depth_.rows[slot])) return;
        first.depth += double{depth_.rows[slot]};
        ++first.depth_samples;
      });
    }
  }
  if (hits_) {
    for_each_slot([&](uint32_t slot) {
      const auto row = load_row<FirstHitRow, float>(hits_.rows, slot, true);
      const Vec2<float> uv =
          layout_.set.has(Aov::kUv) ? first_vertex(slot).uv : Vec2<float>{0.f, 0.f};
      film.add_hit(pixel,
                   {{row.position.x, row.position.y, row.position.z},
                    row.object,
                    row.material,
                    row.instance},
                   centre_ ? centre_.rows[slot] : 0.f, &uv.x, tables_ ? &tables_->crypto : nullptr);
    });
  }
  if (parts_[0]) {
    for_each_slot([&](uint32_t slot) {
      const size_t row = slot * kRadianceWords;
      film.add_parts(pixel, parts_[0].rows + row, parts_[1].rows + row, radiance + row);
    });
  }
  if (groups_) {
    double* sums = film.groups(pixel);
    for_each_slot([&](uint32_t slot) {
      for (uint32_t g = 0; g < layout_.light_groups; ++g) {
        const auto c =
            load_row<RadianceRow, float>(groups_.rows, slot * layout_.light_groups + g, true).sum;
        sums[3 * g] += double{c.x};
        sums[3 * g + 1] += double{c.y};
        sums[3 * g + 2] += double{c.z};
      }
    });
  }
  if (guides_)
    for_each_slot(
        [&](uint32_t slot) { film.add_guides(pixel, guides_.rows + slot * kRowWords<GuideRow>); });
  if (cost_ns_)
    for_each_slot([&](uint32_t slot) { film.add_cost(pixel, double{cost_ns_.rows[slot]}); });
}

}  // namespace wavecomb
