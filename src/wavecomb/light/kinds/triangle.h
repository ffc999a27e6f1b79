// SPDX-License-Identifier: Apache-2.0
/// Triangles of emissive meshes, sampled uniformly by area. Triangle lights emit on both sides.
#pragma once

#include "wavecomb/core/rows/fields.h"
#include "wavecomb/core/rows/rows.h"
#include "wavecomb/geometry/hit/uv.h"
#include "wavecomb/light/records/record_reader.h"
#include "wavecomb/material/inputs/presence.h"

namespace wavecomb::detail {

/// Fields of a TriangleLight.
template <typename F>
struct TriangleRow {
  Vec3<F> p, u, v;
  Color<F> radiance;
  Vec3<F> m;
  F selection_pdf;
  WAVECOMB_FIELDS(p, u, v, radiance, m, selection_pdf)
};
static_assert(sizeof(TriangleLight) == 4 * kRowWords<TriangleRow>);

/// Reads the triangle light record of each active lane.
template <typename F>
struct TriangleReader : TriangleRow<F> {
  TriangleReader(const LightView& view, const UInt<F>& light, const Mask<F>& active)
      : TriangleRow<F>(
            load_row<TriangleRow, F>(view.triangles, light - view.first_triangle, active)) {}
};

/// Returns the varying radiance of triangles at barycentrics `b` and world position q: the emission
/// of `material` (1 outside the lanes `emits`) times its opacity. `index` refers to TriangleUvs.
/// Textures are read at their finest level.
///
/// Opacity is stochastic: a bounce hits the triangle with a probability equal to the opacity, and
/// then receives the full emission. A light sample, whose shadow ray ends before the triangle,
/// receives the emission times the opacity. Both techniques estimate the integral of opacity *
/// emission, so that MIS weights depend only on the densities of the directions.
template <typename F>
[[gnu::noinline]] Color<F> varying_radiance(const LightView& view, const UInt<F>& material,
                                            const UInt<F>& index, const Vec2<F>& b,
                                            const Vec3<F>& q, const Mask<F>& emits,
                                            const Mask<F>& active) {
  constexpr uint32_t kWords = sizeof(TriangleUvs) / 4;
  const auto row = load_rows<8, F>(view.triangle_uvs, index * kWords, active);
  // Add the term of vertex 2 before that of vertex 1, since a different order of the float sums
  // would change the bits of images.
  const UvTriangle<F> corners({row[0], row[1]}, {row[4], row[5]}, {row[2], row[3]});
  const Vec2<F> uv = corners.at(b.y, b.x);
  const MeshPosition<F> mesh_position{float_bits<F>(row[6]), float_bits<F>(row[7]), b.x, b.y};
  Color<F> radiance(F(1.f));
  if (any(emits)) {
    const auto point = [&](const Mask<F>& /*lanes*/) {
      GraphPoint<F> at;
      at.uv = uv;
      at.mesh_position = mesh_position;
      at.position = q;
      return at;
    };
    const Color<F> material_emission =
        fetch_emission<F>(view.materials, material, uv, F(0.f), point, emits);
    radiance = select<F>(emits, material_emission, radiance);
  }
  const Mask<F> partly = has_presence<F>(view.materials, material, active);
  if (any(partly)) {
    const UInt<F> instance =
        gather_member<F>(view.triangle_uvs, &TriangleUvs::instance, index, partly);
    const F opacity = opacity_at<F>(
        view.materials, view.meshes, view.instances,
        {.material = material, .instance = instance, .mesh_position = mesh_position, .uv = uv},
        partly);
    radiance = radiance * select(partly, opacity, F(1.f));
  }
  return radiance;
}

/// Returns the radiance of a triangle at barycentrics `b` and world position q.
template <typename F>
inline Color<F> triangle_radiance(const TriangleReader<F>& light, const LightView& view,
                                  const Vec2<F>& b, const Vec3<F>& q, const Mask<F>& active) {
  const Mask<F> varies = active & (light.radiance.x < 0.f);
  if (none(varies)) [[likely]]
    return light.radiance;
  // Pass copies to the call, so that the original values, which triangles of constant radiance use,
  // can stay in registers.
  const UInt<F> material = float_bits<F>(light.radiance.y), index = float_bits<F>(light.radiance.z);
  const Vec2<F> at = b;
  const Vec3<F> point = q;
  const Mask<F> emits = varies & (light.radiance.x == TriangleLight::kEmission), on = varies;
  return select<F>(varies, varying_radiance<F>(view, material, index, at, point, emits, on),
                   light.radiance);
}

/// Samples a light path that starts uniformly on either side of the triangle.
template <typename F>
inline KindEmission<F> emit_triangle(const TriangleReader<F>& light, const LightView& view,
                                     const F& u, const F& v, const F& s, const F& t,
                                     const Mask<F>& active) {
  const Vec2<F> b = square_to_triangle(u, v);
  const Vec3<F> q = fma(light.u, b.x, fma(light.v, b.y, light.p));
  const F area = length(light.m);
  const Mask<F> back = s >= 0.5f;
  const F side = select(back, F(-1.f), F(1.f));
  const Vec3<F> n = light.m * F(side / select(area > 0.f, area, F(1.f)));
  const F part =
      clamp(F(fma(s, F(2.f), select(back, F(-1.f), F(0.f)))), F(0.f), F(kOneMinusEpsilon));
  return emit_by_cosine<F>(q, n, part, t, triangle_radiance<F>(light, view, b, q, active),
                           F(0.5f * uniform_emission_density<F>(area)));
}

/// Samples a point q = p + b1 u + b2 v on the triangle with area density 1 / area.
template <typename F>
inline KindSample<F> sample_triangle(const TriangleReader<F>& light, const LightView& view,
                                     const Vec3<F>& from, const F& u, const F& v,
                                     const Mask<F>& active) {
  const Vec2<F> b = square_to_triangle(u, v);
  const Vec3<F> q = fma(light.u, b.x, fma(light.v, b.y, light.p));
  const Direction<F> d = make_direction<F>(q - from);
  const F pdf = area_to_solid_angle<F>(d.length2, abs(dot(d.wi, light.m)), F(1.f));

  const Color<F> radiance = triangle_radiance<F>(light, view, b, q, active & (pdf > 0.f));
  return {d.wi, d.length, radiance, pdf, Mask<F>(false)};
}

/// Solid angle density of sampling a triangle light, and the probability of selecting it by power.
template <typename F>
struct TriangleDensity {
  F solid_angle, selection_pdf;
};

/// Returns the solid angle density and selection probability of the triangle lights that rays along
/// dir hit at distance t.
template <typename F>
inline TriangleDensity<F> triangle_pdf(const LightView& view, const UInt<F>& light,
                                       const Vec3<F>& dir, const F& t, const Mask<F>& active) {
  // Read only the last four words of the triangle's record.
  const auto r = load_rows<4, F>(
      view.triangles,
      (light - view.first_triangle) * (sizeof(TriangleLight) / 4) + word_of(&TriangleLight::m),
      active);
  const F projected = abs(dot(dir, Vec3<F>(r[0], r[1], r[2])));
  return {area_to_solid_angle<F>(F(t * t), projected, F(1.f)), r[3]};
}

}  // namespace wavecomb::detail
