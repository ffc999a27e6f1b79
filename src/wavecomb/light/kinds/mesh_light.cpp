// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/light/kinds/mesh_light.h"

#include <bit>

#include "wavecomb/light/records/record_builder.h"

namespace wavecomb {

using namespace record_builder;

LightKindInfo TriangleKind::describe() {
  using namespace light_trait;
  LightKindInfo kind;
  kind.name = "triangle";
  kind.traits = kSized | kShaped | kVisibleShape;
  kind.parameters = {"material_sync"};
  return kind;
}

LightRecord make_mesh_light(const MeshLightInstance& instance, LightBuildContext& context) {
  Light light = *instance.light;
  light.to_world = instance.to_world * light.to_world;
  LightRecord record = make_light(light, context).record;
  const bool has_area = instance.area >= kMinArea;
  set_radiance(
      record, to_double(light.color) * (!has_area ? 0 : (light.normalize ? 1 / instance.area : 1)));
  record.area = static_cast<float>(instance.area);
  record.sync = static_cast<uint32_t>(light.sync);
  // If the light is independent of the material, only light samples find it: paths that hit the
  // mesh receive the material's emission instead.
  if (light.sync == MaterialSync::kIndependent) record.sampled_only = 1;
  if (!instance.is_sampled) record.sampled_only = 0;
  return record;
}

TriangleBuild make_triangle(const LightSet& set, const EmissiveTriangle& t) {
  TriangleBuild out;
  TriangleLight& r = out.light;
  const Double3 p0 = to_double(t.p0);
  const Double3 u = subtract(to_double(t.p1), p0), v = subtract(to_double(t.p2), p0);
  const Double3 m = cross(u, v) * 0.5;
  const double area = length(m);
  put(r.p, p0);
  put(r.u, u);
  put(r.v, v);
  put(r.m, m);
  const auto clamped = [](float x) { return std::clamp(double{x}, 0.0, kMaxRadiance); };
  Double3 radiance{clamped(t.radiance[0]), clamped(t.radiance[1]), clamped(t.radiance[2])};
  float varying = t.material == kNoLight ? 0.f : TriangleLight::kEmission;
  if (t.mesh_light != kNoLight) {
    const LightRecord& mesh = set.records[set.record_count + t.mesh_light];
    const Double3 tint = to_double(mesh.radiance);
    const bool independent = mesh.sync == static_cast<uint32_t>(MaterialSync::kIndependent);
    if (independent) varying = t.opacity_varies ? TriangleLight::kOpacity : 0.f;
    radiance =
        independent ? tint : Double3{radiance.x * tint.x, radiance.y * tint.y, radiance.z * tint.z};
  }
  radiance = radiance * double{t.opacity};
  const double mean = luminance(radiance.x, radiance.y, radiance.z) * double{t.mean_scale};
  put(r.radiance, {std::min(radiance.x, kMaxRadiance), std::min(radiance.y, kMaxRadiance),
                   std::min(radiance.z, kMaxRadiance)});
  if (varying != 0) {
    r.radiance[0] = varying;
    r.radiance[1] = std::bit_cast<float>(t.material);
  }
  out.power = area < kMinArea ? 0 : 2 * kPiD * area * mean;
  return out;
}

}  // namespace wavecomb
