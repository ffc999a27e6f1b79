// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/light/kinds/distant.h"

#include "wavecomb/light/kinds/record_builder.h"

namespace wavecomb {
namespace {

using namespace making;

void make(MadeLight& made, const Light& light, LightMaking& making) {
  const LightColour colour(light);
  put(made.record.n, unit(to_double(light.to_world.axis(2)) * -1.0));
  const double half = std::clamp(double{light.angle}, 0.0, 360.0) / 2 * kPiD / 180;
  const double half_sin = std::sin(half / 2);
  double one_minus_cos = 2 * half_sin * half_sin;
  if (static_cast<float>(one_minus_cos) < 1e-30f) one_minus_cos = 0;
  made.record.one_minus_cos = static_cast<float>(one_minus_cos);
  double scale = 1;
  if (light.normalize && one_minus_cos > 0) {
    const double sin2 = std::sin(half) * std::sin(half);
    scale = 1 / (kPiD * (half <= kPiD / 2 ? sin2 : 2 - sin2));
  }
  put_radiance(made.record, colour.rgb * scale);
  const double solid_angle = one_minus_cos > 0 ? 2 * kPiD * one_minus_cos : 1;
  made.power = kPiD * making.scene_radius * making.scene_radius * solid_angle * scale * colour.mean;
}

}  // namespace

LightKindInfo DistantKind::describe() {
  using namespace light_trait;
  LightKindInfo kind;
  kind.name = "distant";
  kind.prims = {"DistantLight"};
  kind.traits = kPlaced | kSized | kShaped | kInfinite;
  kind.parameters = {"angle"};
  kind.make = &make;
  return kind;
}

}  // namespace wavecomb
