// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/light/filters/filter.h"

#include <algorithm>
#include <cmath>

#include "wavecomb/light/records/record_builder.h"

namespace wavecomb {
namespace record_builder {
namespace {

/// Stores the rows and the translation of the inverse of `to_world`. All entries are 0 if
/// `to_world` is singular.
void store_inverse(FilterRecord& r, const Affine& to_world) {
  const Double3 axes[3] = {to_double(to_world.axis(0)), to_double(to_world.axis(1)),
                           to_double(to_world.axis(2))};
  const double det = dot(axes[0], cross(axes[1], axes[2]));
  const double scale = std::isnormal(det) ? 1 / det : 0;
  float (*const rows[3])[3] = {&r.row_x, &r.row_y, &r.row_z};
  const Double3 t = to_double(to_world.t);
  for (size_t i = 0; i < 3; ++i) {
    const Double3 row = cross(axes[(i + 1) % 3], axes[(i + 2) % 3]) * scale;
    put(*rows[i], row);
    r.origin[i] = static_cast<float>(-dot(row, t));
  }
}

void store_line(float (&to)[3], const Vec3<float>& line) {
  put(to, to_double(line));
}

}  // namespace

ShadowRecord make_shadow(const ShadowAttributes& attributes) {
  ShadowRecord r{};
  put(r.color, to_double(attributes.color));
  r.distance = attributes.distance < 0 ? kFarAway : attributes.distance;
  // Limit the falloff range, so that it does not extend beyond the shaded surface.
  r.falloff =
      attributes.distance < 0 ? 0.f : std::clamp(attributes.falloff, 0.f, attributes.distance);
  r.inverse_gamma = 1 / std::max(attributes.gamma, 1e-3f);
  return r;
}

}  // namespace record_builder

FilterRecord make_light_filter(const LightFilter& filter) {
  using namespace record_builder;
  FilterRecord r{};
  store_inverse(r, filter.to_world);
  store_line(r.side_0, filter.sides[0]);
  store_line(r.side_1, filter.sides[1]);
  store_line(r.side_2, filter.sides[2]);
  store_line(r.side_3, filter.sides[3]);
  store_line(r.picture_u, filter.picture_u);
  store_line(r.picture_v, filter.picture_v);
  r.distance = filter.distance;
  r.texture = filter.texture;
  const auto inverse = [](float from, float to) { return to > from ? 1 / (to - from) : 0.f; };
  const bool begins = filter.near_end > filter.near_start;
  r.near_start = begins ? filter.near_start : -1.f;
  r.near_inverse = begins ? inverse(filter.near_start, filter.near_end) : 1.f;
  r.far_start = filter.far_start;
  r.far_inverse = inverse(filter.far_start, filter.far_end);
  r.density = std::clamp(filter.density, 0.f, 1.f);
  r.next = filter.next;
  return r;
}

}  // namespace wavecomb
