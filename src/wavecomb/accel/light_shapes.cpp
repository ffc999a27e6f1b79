// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/accel/light_shapes.h"

#include <algorithm>
#include <cmath>

namespace wavecomb {
namespace {

double dot(const double* a, const double* b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

void cross(const double* a, const double* b, double* c) {
  c[0] = a[1] * b[2] - a[2] * b[1];
  c[1] = a[2] * b[0] - a[0] * b[2];
  c[2] = a[0] * b[1] - a[1] * b[0];
}

/// |o + t d|^2 = r^2, the nearer root that is ahead.
double intersect_sphere(const double* o, const double* d, double radius) {
  const double a = dot(d, d), b = dot(o, d), c = dot(o, o) - radius * radius;
  const double discriminant = b * b - a * c;
  if (!(discriminant >= 0)) return 0;
  const double root = std::sqrt(discriminant);
  return (-b - root > 0 ? -b - root : -b + root) / a;
}

/// The nearer point ahead of the open cylinder of axis u from 0 on.
double intersect_cylinder(const double* o, const double* d, const double* u, double radius) {
  const double uu = dot(u, u), ou = dot(o, u) / uu, du = dot(d, u) / uu;
  double across_o[3], across_d[3];
  for (int i = 0; i < 3; ++i) {
    across_o[i] = o[i] - ou * u[i];
    across_d[i] = d[i] - du * u[i];
  }
  const double a = dot(across_d, across_d), b = dot(across_o, across_d),
               c = dot(across_o, across_o) - radius * radius;
  const double discriminant = b * b - a * c;
  if (!(discriminant >= 0) || !(a > 0)) return 0;
  const double root = std::sqrt(discriminant);
  for (const double t : {(-b - root) / a, (-b + root) / a}) {
    const double along = ou + t * du;
    if (t > 0 && along >= 0 && along <= 1) return t;
  }
  return 0;
}

/// o + t d = x u + y v with x^2 + y^2 <= 1.
double intersect_disk(const double* o, const double* d, const double* u, const double* v) {
  double m[3], hv[3], uh[3];
  cross(u, v, m);
  const double t = -dot(o, m) / dot(d, m);
  if (!(t > 0) || !std::isfinite(t)) return 0;
  const double h[3] = {o[0] + t * d[0], o[1] + t * d[1], o[2] + t * d[2]};
  cross(h, v, hv);
  cross(u, h, uh);
  const double mm = dot(m, m), x = dot(hv, m) / mm, y = dot(uh, m) / mm;
  return x * x + y * y <= 1 ? t : 0;
}

}  // namespace

Bounds round_light_bounds(const LightRecord& light) {
  const auto kind = static_cast<LightKind>(light.kind);
  float lo[3], hi[3];
  for (int i = 0; i < 3; ++i) {
    const float half = kind == LightKind::kDisk ? std::hypot(light.u[i], light.v[i]) : light.radius;
    const float end = kind == LightKind::kCylinder ? light.p[i] + light.u[i] : light.p[i];
    const float slack = 1e-6f * std::max(std::abs(light.p[i]), std::abs(end)) + 1e-5f * half;
    lo[i] = std::min(light.p[i], end) - half - slack;
    hi[i] = std::max(light.p[i], end) + half + slack;
  }
  return {{lo[0], lo[1], lo[2]}, {hi[0], hi[1], hi[2]}};
}

float intersect_round_light(const LightRecord& light, const float (&origin)[3],
                            const float (&dir)[3]) {
  double o[3], d[3], u[3], v[3];
  for (int i = 0; i < 3; ++i) {
    o[i] = static_cast<double>(origin[i]) - light.p[i];
    d[i] = dir[i];
    u[i] = light.u[i];
    v[i] = light.v[i];
  }
  double t = 0;
  switch (static_cast<LightKind>(light.kind)) {
    case LightKind::kSphere:
      t = intersect_sphere(o, d, light.radius);
      break;
    case LightKind::kCylinder:
      t = intersect_cylinder(o, d, u, light.radius);
      break;
    default:
      t = intersect_disk(o, d, u, v);
  }
  return t > 0 ? static_cast<float>(t) : 0.f;
}

}  // namespace wavecomb
