// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/light/kinds/rect.h"

#include "wavecomb/light/records/record_builder.h"

namespace wavecomb {
namespace {

using namespace record_builder;

/// A rect light whose image distribution has at least this spread is sampled uniformly, which
/// increases noise only slightly.
constexpr float kUniformSpread = 0.9f;

/// Adds the sampling distribution of the light's image, and sets the power from the image's mean.
void add_texture_distribution(LightBuild& out, LightBuildContext& context) {
  Distribution2D d = density_of(out.record, context, &build_rect_distribution);
  out.power = kPiD * double{out.record.area} * d.mean_luminance;
  if (d.width == 0) {  // black
    out.record.texture = kNoTexture;
    put(out.record.radiance, {0, 0, 0});
  } else if (d.spread < kUniformSpread) {
    out.record.distribution = static_cast<uint32_t>(context.set.distributions.size());
    context.set.distributions.push_back(std::move(d));
  }
}

/// Makes the light record. As seen from the front (looking along +z with +y up), +x points to the
/// left, so the image coordinate s runs along -x.
void make(LightBuild& out, const Light& light, LightBuildContext& context) {
  const Affine& m = light.to_world;
  const double w = std::fabs(double{light.width}), h = std::fabs(double{light.height});
  put(out.record.p, to_double(m.point({static_cast<float>(w / 2), static_cast<float>(-h / 2), 0})));
  finish_flat(out, light, to_double(m.axis(0)) * -w, to_double(m.axis(1)) * h, 1);
  if (out.record.texture != kNoTexture) add_texture_distribution(out, context);
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
  kind.traits =
      kHasTransform | kSized | kShaped | kVisibleShape | kOwnShape | kTextured | kFiltered;
  kind.parameters = {"width", "height"};
  kind.make = &make;
  kind.bound = &bound;
  kind.shape = &shape;
  return kind;
}

}  // namespace wavecomb
