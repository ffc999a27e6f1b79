// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/light/kinds/rect.h"

#include "wavecomb/light/kinds/record_builder.h"

namespace wavecomb {
namespace {

using namespace making;

/// Images whose distribution has at least this spread are sampled uniformly, which adds no noise.
constexpr float kEvenSpread = 0.9f;

/// Adds the sampling distribution of the image, and sets the power by its mean.
void add_picture(MadeLight& made, LightMaking& making) {
  Distribution2D d = density_of(made.record, making, &build_rect_distribution);
  made.power = kPiD * double{made.record.area} * d.mean_luminance;
  if (d.width == 0) {  // black
    made.record.texture = kNoTexture;
    put(made.record.radiance, {0, 0, 0});
  } else if (d.spread < kEvenSpread) {
    made.record.distribution = static_cast<uint32_t>(making.set.distributions.size());
    making.set.distributions.push_back(std::move(d));
  }
}

/// Makes the record. Seen from the front, along +z with +y up, +x is to the left, so s runs along
/// -x.
void make(MadeLight& made, const Light& light, LightMaking& making) {
  const Affine& m = light.to_world;
  const double w = std::fabs(double{light.width}), h = std::fabs(double{light.height});
  put(made.record.p,
      to_double(m.point({static_cast<float>(w / 2), static_cast<float>(-h / 2), 0})));
  finish_flat(made, light, to_double(m.axis(0)) * -w, to_double(m.axis(1)) * h, 1);
  if (made.record.texture != kNoTexture) add_picture(made, making);
}

void bound(LightCluster& cluster, const LightRecord& light, double /*power*/) {
  const double intensity = cluster.intensity;
  cluster = bound_corners(light.p, light.u, light.v, true);
  cluster.intensity = intensity;
  bound_normals(cluster, light.n);
}

LightShape shape(const LightRecord& /*light*/) {
  return LightShape::kParallelogram;
}

}  // namespace

LightKindInfo RectKind::describe() {
  using namespace light_trait;
  LightKindInfo kind;
  kind.name = "rect";
  kind.prims = {"RectLight"};
  kind.traits = kPlaced | kSized | kShaped | kSeen | kPictured | kFiltered;
  kind.parameters = {"width", "height"};
  kind.make = &make;
  kind.bound = &bound;
  kind.shape = &shape;
  return kind;
}

}  // namespace wavecomb
