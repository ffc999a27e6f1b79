// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/light/kinds/distant.h"

#include "wavecomb/light/records/record_builder.h"

namespace wavecomb {
namespace {

using namespace record_builder;

void make(LightBuild& out, const Light& light, LightBuildContext& context) {
  const LightColour colour(light);
  put(out.record.n, unit(to_double(light.to_world.axis(2)) * -1.0));
  const double half = std::clamp(double{light.angle}, 0.0, 360.0) / 2 * kPiD / 180;
  const double half_sin = std::sin(half / 2);
  double one_minus_cos = 2 * half_sin * half_sin;
  if (static_cast<float>(one_minus_cos) < 1e-30f) one_minus_cos = 0;
  out.record.one_minus_cos = static_cast<float>(one_minus_cos);
  double scale = 1;
  if (light.normalize && one_minus_cos > 0) {
    const double sin2 = std::sin(half) * std::sin(half);
    scale = 1 / (kPiD * (half <= kPiD / 2 ? sin2 : 2 - sin2));
  }
  set_radiance(out.record, colour.rgb * scale);
  const double solid_angle = one_minus_cos > 0 ? 2 * kPiD * one_minus_cos : 1;
  out.power =
      kPiD * context.scene_radius * context.scene_radius * solid_angle * scale * colour.mean;
}

}  // namespace

LightKindInfo DistantKind::describe() {
  using namespace light_trait;
  LightKindInfo kind;
  kind.name = "distant";
  kind.prims = {"DistantLight"};
  kind.traits = kHasTransform | kSized | kShaped;
  kind.parameters = {"angle"};
  kind.make = &make;
  return kind;
}

}  // namespace wavecomb
