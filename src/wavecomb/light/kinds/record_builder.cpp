// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/light/kinds/record_builder.h"

#include <cmath>

namespace wavecomb::making {

void finish_area(MadeLight& made, const Light& light, double area) {
  const LightColour colour(light);
  made.record.area = static_cast<float>(area);
  const double scale = area < kLeastArea ? 0 : (light.normalize ? 1 / area : 1);
  put_radiance(made.record, colour.rgb * scale);
  made.power = kPiD * area * scale * colour.mean;
}

void finish_flat(MadeLight& made, const Light& light, const Double3& u, const Double3& v,
                 double area_factor) {
  const Double3 m = cross(u, v);
  // Light leaves on the side that -z is mapped to, independent of the handedness of the transform.
  const Double3 minus_z = to_double(light.to_world.axis(2)) * -1.0;
  Double3 n = unit(m);
  if (dot(n, minus_z) < 0) n = n * -1.0;
  put(made.record.u, u);
  put(made.record.v, v);
  put(made.record.n, n);
  const auto measure = [](const float (&edge)[3], float& size, float& inverse) {
    size = static_cast<float>(length(to_double(edge)));
    inverse = size > 0 && std::isfinite(1 / size) ? 1 / size : 0.f;
  };
  measure(made.record.u, made.record.length_u, made.record.inverse_u);
  measure(made.record.v, made.record.length_v, made.record.inverse_v);
  finish_area(made, light, area_factor * length(m));
}

Distribution2D density_of(const LightRecord& light, const LightMaking& making,
                          Distribution2D (*build)(const TextureView&, const Vec3<float>&)) {
  if (making.before)
    for (const LightRecord& other : making.before->records)
      if (other.kind == light.kind && other.texture == light.texture &&
          other.distribution != kNoDistribution &&
          std::ranges::equal(other.radiance, light.radiance))
        return making.before->distributions[other.distribution];
  return build(making.textures[light.texture]->view(),
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

}  // namespace wavecomb::making
