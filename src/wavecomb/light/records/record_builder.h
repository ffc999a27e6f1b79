// SPDX-License-Identifier: Apache-2.0
/// Shared functions of the light kinds that build light records, in double precision.
#pragma once

#include <algorithm>
#include <cmath>

#include "wavecomb/light/description/kind_info.h"

namespace wavecomb::record_builder {

inline constexpr double kPiD = 3.14159265358979323846;

/// Smallest area of an emitting light. Smaller areas are indistinguishable from 0 in float, so
/// lights with smaller areas do not emit.
inline constexpr double kMinArea = 1e-36;
/// Largest radiance. With larger values, products of radiance could overflow.
inline constexpr double kMaxRadiance = 1e30;

struct Double3 {
  double x, y, z;
  Double3 operator*(double s) const { return {x * s, y * s, z * s}; }
};
inline Double3 to_double(const Vec3<float>& v) {
  return {v.x, v.y, v.z};
}
inline Double3 to_double(const float* v) {
  return {v[0], v[1], v[2]};
}
inline Double3 subtract(const Double3& a, const Double3& b) {
  return {a.x - b.x, a.y - b.y, a.z - b.z};
}
inline Double3 cross(const Double3& a, const Double3& b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
inline double dot(const Double3& a, const Double3& b) {
  return a.x * b.x + a.y * b.y + a.z * b.z;
}
inline double length(const Double3& a) {
  return std::sqrt(dot(a, a));
}
/// Returns a / |a|, or the unit vector +z if a is zero.
inline Double3 unit(const Double3& a) {
  const double n = length(a);
  return n > 0 ? a * (1 / n) : Double3{0, 0, 1};
}
inline void put(float (&to)[3], const Double3& v) {
  to[0] = static_cast<float>(v.x);
  to[1] = static_cast<float>(v.y);
  to[2] = static_cast<float>(v.z);
}
inline double luminance(double r, double g, double b) {
  return 0.212656 * r + 0.715158 * g + 0.072186 * b;
}

inline void set_radiance(LightRecord& record, const Double3& v) {
  put(record.radiance,
      {std::min(v.x, kMaxRadiance), std::min(v.y, kMaxRadiance), std::min(v.z, kMaxRadiance)});
}

/// Light::color without negative components, and its luminance.
struct LightColour {
  Double3 rgb;
  double mean;

  explicit LightColour(const Light& light)
      : rgb{std::max(0.0, double{light.color.x}), std::max(0.0, double{light.color.y}),
            std::max(0.0, double{light.color.z})},
        mean(luminance(rgb.x, rgb.y, rgb.z)) {}
};

/// Sets radiance and power of a light with the given surface area. Lights with zero area do not
/// emit.
void finish_area(LightBuild& out, const Light& light, double area);

/// Sets area, emission directions, radiance and power of a planar light with the given edges or
/// half axes, whose area is `area_factor` |u x v|.
void finish_flat(LightBuild& out, const Light& light, const Double3& u, const Double3& v,
                 double area_factor);

/// Returns the sampling distribution for the texture and radiance of `light`: the distribution of a
/// light in context.before that has the same kind, texture and radiance, otherwise the result of
/// `build`.
Distribution2D density_of(const LightRecord& light, const LightBuildContext& context,
                          Distribution2D (*build)(const TextureView&, const Vec3<float>&));

/// Adds shaping to a light, and scales the light's power by the fraction of light that the shaping
/// transmits. This fraction is estimated as the product of the means of all shaping attributes over
/// directions, as if the attributes were independent.
void add_shaping(LightBuild& out, const Light& light, LightBuildContext& context);

/// Returns the packed shadow attributes of a light.
ShadowRecord make_shadow(const ShadowAttributes& attributes);

/// Returns a box from point `a` to point `b`, extended by `half` and a tolerance for rounding.
Bounds box_around(const float (&a)[3], const float (&b)[3], const float (&half)[3]);

}  // namespace wavecomb::record_builder
