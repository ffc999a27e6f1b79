// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/geometry/gaussian_splat/gaussian_splat.h"

#include <algorithm>
#include <cmath>

#include "wavecomb/core/error.h"

namespace wavecomb {
namespace {

using namespace curve_math;

constexpr double kMaxDeviations = 3, kMinAlpha = 1.0 / 255;
/// Maximum number of Gaussian splats in a mesh, since 32-bit offsets address 48 coefficients of
/// spherical harmonics per splat.
constexpr size_t kMaxGaussianSplats = 0xffffffffu / 48;
/// Range of the scales of a Gaussian splat. Products of scales must stay within the range of float.
constexpr float kMinScale = 1e-9f, kMaxScale = 1e9f;

void need(const std::string& name, size_t has, size_t want, const char* what) {
  if (has != want)
    throw Error(name + " has " + std::to_string(has) + " " + what + " where " +
                std::to_string(want) + " are needed");
}

/// Computes the columns of a quaternion's rotation matrix.
void axes_of(const float* q, const std::string& name, V (&axis)[3]) {
  double w = q[0], x = q[1], y = q[2], z = q[3];
  const double size = std::sqrt(w * w + x * x + y * y + z * z);
  if (!(size > 1e-12 && size < 1e12))
    throw Error(name + " has an orientation that is zero or not finite; fix or remove it");
  w /= size, x /= size, y /= size, z /= size;
  axis[0] = {1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)};
  axis[1] = {2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x)};
  axis[2] = {2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)};
}

/// Transforms a vector to the axes of a Gaussian splat, with the standard deviations along the axes
/// as units.
V whitened(const GaussianSplatRow& row, const V& v) {
  return {dot_d(vec(row.whiten), v), dot_d(vec(row.whiten + 3), v), dot_d(vec(row.whiten + 6), v)};
}

}  // namespace

std::vector<GaussianSplatRow> make_gaussian_splat_rows(std::span<const float> scales,
                                                       std::span<const float> orientations,
                                                       std::span<const float> opacities,
                                                       const std::string& name) {
  const size_t n = opacities.size();
  need(name, scales.size(), 3 * n, "scales");
  need(name, orientations.size(), 4 * n, "parts of orientations");
  std::vector<GaussianSplatRow> rows(n);
  for (size_t i = 0; i < n; ++i) {
    GaussianSplatRow& row = rows[i];
    const float* s = &scales[3 * i];
    for (size_t k = 0; k < 3; ++k)
      if (!(s[k] >= kMinScale && s[k] <= kMaxScale))
        throw Error(name + " has a scale that is not from 1e-9 to 1e9; fix or remove it");
    if (!(opacities[i] >= 0 && opacities[i] <= 1))
      throw Error(name + " has an opacity that is not from 0 to 1; fix or remove it");
    V axis[3];
    axes_of(&orientations[4 * i], name, axis);
    row.opacity = opacities[i];
    // Also make rows for invisible Gaussian splats, so that row indices equal splat indices.
    const double visible = 2 * std::log(std::max(opacities[i] / kMinAlpha, 1.0));
    const double cut = std::min(kMaxDeviations * kMaxDeviations, visible);
    row.cut = opacities[i] < static_cast<float>(kMinAlpha) ? -1.f : static_cast<float>(cut);
    const double reach = std::sqrt(std::max(double{row.cut}, 0.0)) * (1 + 1e-6);
    double square[3] = {};
    for (size_t k = 0; k < 3; ++k) {
      const double part[3] = {axis[k].x, axis[k].y, axis[k].z};
      for (size_t j = 0; j < 3; ++j) {
        row.whiten[3 * k + j] = static_cast<float>(part[j] / s[k]);
        square[j] += part[j] * part[j] * s[k] * s[k];
      }
    }
    for (size_t j = 0; j < 3; ++j)
      row.half[j] = static_cast<float>(reach * std::sqrt(square[j]) * (1 + 1e-6));
  }
  return rows;
}

std::vector<float> gaussian_splat_radii(std::span<const GaussianSplatRow> rows) {
  std::vector<float> radii;
  radii.reserve(rows.size());
  for (const GaussianSplatRow& row : rows) radii.push_back(length(gaussian_splat_extent(row)));
  return radii;
}

void check_gaussian_splats(const Mesh& mesh, const std::string& name) {
  const size_t n = mesh.vertex_count(), degree = mesh.harmonics_degree;
  if (n > kMaxGaussianSplats)
    throw Error(name + " has too many splats for 32-bit offsets; split it");
  need(name, mesh.splats.size(), n, "rows of splats");
  if (degree > 3) throw Error(name + " has harmonics of a degree above 3; leave those out");
  need(name, mesh.harmonics.size(), 3 * (degree + 1) * (degree + 1) * n, "harmonics");
  if (!std::ranges::all_of(mesh.harmonics, [](float x) { return std::isfinite(x); }))
    throw Error(name + " has harmonics that are not finite; fix or remove them");
}

Vec3<float> gaussian_splat_extent(const GaussianSplatRow& row) {
  return {row.half[0], row.half[1], row.half[2]};
}

void intersect_gaussian_splat(const GaussianSplatRow& row, const Vec3<float>& centre,
                              const CurveRay& ray, float tfar, CurveHits& hits) {
  const V o = whitened(row, ray.space.o - widen(centre)), d = whitened(row, vec(ray.dir));
  const double d2 = dot_d(d, d), t = -dot_d(o, d) / d2;
  if (!(t > 0 && t <= tfar)) return;
  const V w = o + d * t;
  if (!(dot_d(w, w) <= row.cut)) return;
  const Vec3<float> at = narrow(w);
  const GaussianSplatFrame<float> frame =
      gaussian_splat_frame<float>(narrow(d * (1 / std::sqrt(d2))));
  hits.add({static_cast<float>(t), dot(at, frame.x), dot(at, frame.y)});
}

}  // namespace wavecomb
