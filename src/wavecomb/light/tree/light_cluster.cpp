// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/light/tree/light_cluster.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "wavecomb/light/description/kind_info.h"

namespace wavecomb {
namespace {

double dot(const double* a, const double* b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

LightCluster empty_at(const float (&p)[3]) {
  LightCluster c;
  std::copy_n(p, 3, c.lo);
  std::copy_n(p, 3, c.hi);
  return c;
}

/// Quantises a component of a unit vector: 65536 steps from -1 to 1.
uint32_t steps(double x) {
  return static_cast<uint32_t>(std::nearbyint(std::clamp(x * 0.5 + 0.5, 0.0, 1.0) * 65535));
}

/// Quantises sin(angle / 2), rounding up.
uint32_t half_sine(double angle, uint32_t most) {
  const double s = std::sin(std::clamp(angle, 0.0, std::numbers::pi) / 2) * most;
  return std::min(most, static_cast<uint32_t>(std::ceil(s)));
}

}  // namespace

void include(LightCluster& c, const float (&p)[3]) {
  for (size_t k = 0; k < 3; ++k) {
    c.lo[k] = std::min(c.lo[k], p[k]);
    c.hi[k] = std::max(c.hi[k], p[k]);
  }
}

LightCluster bound_corners(const float (&p)[3], const float (&u)[3], const float (&v)[3],
                           bool opposite) {
  LightCluster c = empty_at(p);
  for (const float by : {0.f, 1.f})
    for (const float bx : {0.f, 1.f}) {
      if (bx + by > 1 && !opposite) continue;
      include(c, {p[0] + bx * u[0] + by * v[0], p[1] + bx * u[1] + by * v[1],
                  p[2] + bx * u[2] + by * v[2]});
    }
  return c;
}

void bound_normals(LightCluster& c, const float (&n)[3]) {
  for (size_t k = 0; k < 3; ++k) c.normals.axis[k] = double{n[k]};
  c.emission = std::numbers::pi / 2;
}

void bound_round(LightCluster& c) {
  c.normals.angle = std::numbers::pi;
  c.emission = std::numbers::pi / 2;
}

void widen(LightCluster& c, const float (&half)[3]) {
  for (size_t k = 0; k < 3; ++k) {
    c.lo[k] -= half[k];
    c.hi[k] += half[k];
  }
}

DirectionCone unite(const DirectionCone& a, const DirectionCone& b) {
  DirectionCone wide = a.angle >= b.angle ? a : b;
  const DirectionCone& other = a.angle >= b.angle ? b : a;
  wide.two_sided = a.two_sided || b.two_sided;
  double cosine = dot(wide.axis, other.axis);
  const double sign = wide.two_sided && cosine < 0 ? -1 : 1;
  cosine = std::clamp(cosine * sign, -1.0, 1.0);
  const double between = std::acos(cosine);
  if (std::min(between + other.angle, std::numbers::pi) <= wide.angle) return wide;
  const double angle = (wide.angle + between + other.angle) / 2;
  double across[3], length2 = 0;
  for (size_t k = 0; k < 3; ++k) {
    across[k] = other.axis[k] * sign - wide.axis[k] * cosine;
    length2 += across[k] * across[k];
  }
  const double all = wide.two_sided ? std::numbers::pi / 2 : std::numbers::pi;
  if (!(angle < all) || !(length2 > 1e-10)) {
    // If the axes are opposite, there is no unique axis between them, so use a cone of all
    // directions. If the axes are nearly equal, keep the axis of the wider cone.
    wide.angle =
        cosine < 0 || angle >= all ? std::numbers::pi : std::max(wide.angle, other.angle + between);
    return wide;
  }
  const double turn = angle - wide.angle, scale = std::sin(turn) / std::sqrt(length2);
  for (size_t k = 0; k < 3; ++k) wide.axis[k] = wide.axis[k] * std::cos(turn) + across[k] * scale;
  const double unit = 1 / std::sqrt(dot(wide.axis, wide.axis));
  for (double& x : wide.axis) x *= unit;
  wide.angle = angle;
  return wide;
}

LightCluster unite(const LightCluster& a, const LightCluster& b) {
  LightCluster c = a;
  include(c, b.lo);
  include(c, b.hi);
  c.normals = unite(a.normals, b.normals);
  c.emission = std::max(a.emission, b.emission);
  c.intensity = a.intensity + b.intensity;
  return c;
}

LightCluster bound_light(const LightRecord& light, double power) {
  LightCluster c = empty_at(light.p);
  c.intensity = power / std::numbers::pi;
  const LightKindInfo& kind = info_of(static_cast<LightKind>(light.kind));
  if (kind.bound) kind.bound(c, light, power);
  return c;
}

LightCluster bound_light(const TriangleLight& light, double power) {
  LightCluster c = bound_corners(light.p, light.u, light.v, false);
  // Intensity along the normal, for each of the two sides.
  c.intensity = power / (2 * std::numbers::pi);
  c.emission = std::numbers::pi / 2;
  c.normals.two_sided = true;
  const double m[3] = {double{light.m[0]}, double{light.m[1]}, double{light.m[2]}};
  const double area = std::sqrt(dot(m, m));
  if (area > 0)
    for (size_t k = 0; k < 3; ++k) c.normals.axis[k] = m[k] / area;
  else
    c.normals.angle = std::numbers::pi;
  return c;
}

LightTreeChild encode(const LightCluster& c) {
  LightTreeChild to{};
  double radius2 = 0;
  for (size_t k = 0; k < 3; ++k) {
    to.centre[k] = 0.5f * c.lo[k] + 0.5f * c.hi[k];
    const double half =
        std::max(double{c.hi[k]} - double{to.centre[k]}, double{to.centre[k]} - double{c.lo[k]});
    radius2 += half * half;
  }
  to.radius = static_cast<float>(std::sqrt(radius2) * (1 + 0x1p-20));
  to.intensity = static_cast<float>(std::max(c.intensity, 1e-20));
  const DirectionCone& n = c.normals;
  to.axis_xy = steps(n.axis[0]) | steps(n.axis[1]) << 16;
  to.axis_z_cones = steps(n.axis[2]) | half_sine(n.angle, 255) << 16 |
                    half_sine(c.emission, 127) << 24 | (n.two_sided ? 1u : 0u) << 31;
  to.next = c.next;
  return to;
}

}  // namespace wavecomb
