// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/light/kinds/dome.h"

#include "wavecomb/light/records/record_builder.h"

namespace wavecomb {
namespace {

using namespace record_builder;

/// Sets the world axes of the dome. The rotation and mirroring of its transform are used, but not
/// the scale. If the axes are not orthogonal, the pole (y axis) keeps its direction.
void set_axes(LightRecord& record, const Affine& m) {
  const Double3 y = unit(to_double(m.axis(1)));
  Double3 z = to_double(m.axis(2));
  z = subtract(z, y * dot(y, z));
  if (!(length(z) > 1e-6 * length(to_double(m.axis(2))))) {
    z = cross(y, std::fabs(y.x) < 0.5 ? Double3{1, 0, 0} : Double3{0, 0, 1});
  }
  z = unit(z);
  Double3 x = cross(y, z);
  if (dot(x, to_double(m.axis(0))) < 0) x = x * -1.0;
  put(record.u, x);
  put(record.v, y);
  put(record.n, z);
}

/// Adds the sampling distribution of the dome's image. Returns the image's mean luminance.
double add_image(LightRecord& record, LightBuildContext& context) {
  Distribution2D d = density_of(record, context, &build_dome_distribution);
  const double mean = d.mean_luminance;
  if (d.width == 0) {  // black
    record.texture = kNoTexture;
    put(record.radiance, {0, 0, 0});
  } else {
    record.distribution = static_cast<uint32_t>(context.set.distributions.size());
    context.set.distributions.push_back(std::move(d));
  }
  return mean;
}

/// Adds the portals of a dome, each as the record of a rectangle.
void add_portals(LightRecord& record, const std::vector<Affine>& portals, LightSet& set) {
  record.portals = static_cast<uint32_t>(set.portal_groups.size());
  const auto first = static_cast<uint32_t>(set.portals.size());
  for (const Affine& square : portals) {
    Light portal;
    portal.to_world = square;
    LightBuild rect;
    put(rect.record.p, to_double(square.point({0.5f, -0.5f, 0})));
    finish_flat(rect, portal, to_double(square.axis(0)) * -1, to_double(square.axis(1)), 1);
    rect.record.texture = kNoTexture;
    set.portals.push_back(rect.record);
  }
  const double spread = record.texture == kNoTexture
                            ? 4 * kPiD
                            : image_solid_angle(set.distributions[record.distribution]);
  set.portal_groups.push_back(
      {first, static_cast<uint32_t>(portals.size()), static_cast<float>(spread)});
}

void make(LightBuild& out, const Light& light, LightBuildContext& context) {
  const LightColour colour(light);
  set_axes(out.record, light.to_world);
  set_radiance(out.record, colour.rgb);
  const double mean = light.texture == kNoTexture ? colour.mean : add_image(out.record, context);
  out.power = 4 * kPiD * mean * kPiD * context.scene_radius * context.scene_radius;
  if (!light.portals.empty()) add_portals(out.record, light.portals, context.set);
}

}  // namespace

LightKindInfo DomeKind::describe() {
  using namespace light_trait;
  LightKindInfo kind;
  kind.name = "dome";
  kind.prims = {"DomeLight", "DomeLight_1"};
  kind.traits = kHasTransform | kTextured | kBackground;
  kind.parameters = {"portals"};
  kind.make = &make;
  return kind;
}

}  // namespace wavecomb
