// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/light/records/record_builder.h"

#include <cmath>

namespace wavecomb::record_builder {

void finish_area(LightBuild& out, const Light& light, double area) {
  const LightColour colour(light);
  out.record.area = static_cast<float>(area);
  const double scale = area < kMinArea ? 0 : (light.normalize ? 1 / area : 1);
  set_radiance(out.record, colour.rgb * scale);
  out.power = kPiD * area * scale * colour.mean;
}

void finish_flat(LightBuild& out, const Light& light, const Double3& u, const Double3& v,
                 double area_factor) {
  const Double3 m = cross(u, v);
  // The light emits from the side to which the transform maps -z, whether or not the transform
  // mirrors.
  const Double3 minus_z = to_double(light.to_world.axis(2)) * -1.0;
  Double3 n = unit(m);
  if (dot(n, minus_z) < 0) n = n * -1.0;
  put(out.record.u, u);
  put(out.record.v, v);
  put(out.record.n, n);
  const auto measure = [](const float (&edge)[3], float& size, float& inverse) {
    size = static_cast<float>(length(to_double(edge)));
    inverse = size > 0 && std::isfinite(1 / size) ? 1 / size : 0.f;
  };
  measure(out.record.u, out.record.length_u, out.record.inverse_u);
  measure(out.record.v, out.record.length_v, out.record.inverse_v);
  finish_area(out, light, area_factor * length(m));
}

Distribution2D density_of(const LightRecord& light, const LightBuildContext& context,
                          Distribution2D (*build)(const TextureView&, const Vec3<float>&)) {
  if (context.before)
    for (const LightRecord& other : context.before->records)
      if (other.kind == light.kind && other.texture == light.texture &&
          other.distribution != kNoDistribution &&
          std::ranges::equal(other.radiance, light.radiance))
        return context.before->distributions[other.distribution];
  return build(context.textures[light.texture]->view(),
               {light.radiance[0], light.radiance[1], light.radiance[2]});
}

Bounds box_around(const float (&a)[3], const float (&b)[3], const float (&half)[3]) {
  float lo[3], hi[3];
  for (int i = 0; i < 3; ++i) {
    const float slack = 1e-6f * std::max(std::abs(a[i]), std::abs(b[i])) + 1e-5f * half[i];
    lo[i] = std::min(a[i], b[i]) - half[i] - slack;
    hi[i] = std::max(a[i], b[i]) + half[i] + slack;
  }
  return {{lo[0], lo[1], lo[2]}, {hi[0], hi[1], hi[2]}};
}

}  // namespace wavecomb::record_builder
