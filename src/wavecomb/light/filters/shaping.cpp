// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/light/filters/shaping.h"

#include "wavecomb/light/records/record_builder.h"

namespace wavecomb::record_builder {

void add_shaping(LightBuild& out, const Light& light, LightBuildContext& context) {
  const Shaping& s = light.shaping;
  const double power = out.power;
  const Double3 minus_z = unit(to_double(light.to_world.axis(2)) * -1.0);
  ShapingRecord r{};
  put(r.axis, minus_z);
  // Compute the rows of the inverse matrix up to a common factor, which has no effect.
  const Double3 axes[3] = {to_double(light.to_world.axis(0)), to_double(light.to_world.axis(1)),
                           to_double(light.to_world.axis(2))};
  const double side = dot(axes[0], cross(axes[1], axes[2])) < 0 ? -1 : 1;
  double largest = 0;
  Double3 rows[3];
  for (size_t i = 0; i < 3; ++i) {
    rows[i] = cross(axes[(i + 1) % 3], axes[(i + 2) % 3]) * side;
    largest = std::max(largest, length(rows[i]));
  }
  float* const to_light[3] = {r.to_light_x, r.to_light_y, r.to_light_z};
  for (size_t i = 0; i < 3; ++i) {
    const Double3 row = rows[i] * (largest > 0 ? 1 / largest : 0);
    const double values[3] = {row.x, row.y, row.z};
    for (size_t j = 0; j < 3; ++j) to_light[i][j] = static_cast<float>(values[j]);
  }
  const auto tint = [](float x) { return std::max(0.0, double{x}); };
  put(r.tint, {tint(s.focus_tint.x), tint(s.focus_tint.y), tint(s.focus_tint.z)});
  r.focus = std::max(0.f, s.focus);
  const double cone = std::max(0.0, double{s.cone_angle}) * kPiD / 180;
  r.cone = s.cone_angle < 180 ? static_cast<float>(cone) : 4.f;
  r.cone_start = r.cone * (1 - std::clamp(s.cone_softness, 0.f, 1.f));
  r.ies = s.ies;
  r.angle_scale = s.ies_angle_scale;
  if (s.focus > 0) {
    const double left = 1.0 / (1.0 + double{s.focus});
    out.power *= left + (1 - left) * std::min(1.0, luminance(double{r.tint[0]}, double{r.tint[1]},
                                                             double{r.tint[2]}));
  }
  if (s.cone_angle < 180) out.power *= (1 - std::cos(cone)) / 2;
  if (s.ies != kNoIes) {
    const IesProfile& profile = context.profiles[s.ies];
    const double mean = profile.mean();
    r.ies_scale = s.ies_normalize && mean > 0 ? static_cast<float>(1 / mean) : 1.f;
    out.power *= mean * double{r.ies_scale} * (profile.covers_sphere() ? 1 : 0.5);
  }
  if (info_of(light.kind).has(light_trait::kInfinite))
    // For infinite lights, the cone and focus do not reduce the power, since all light travels
    // along the axis.
    out.power = power;
  out.record.shaping = static_cast<uint32_t>(context.set.shapings.size());
  context.set.shapings.push_back(r);
}

}  // namespace wavecomb::record_builder
