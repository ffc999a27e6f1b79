// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/path/camera/lens.h"

#include <cmath>
#include <string>

#include "wavecomb/core/error.h"

namespace wavecomb {
namespace {

/// Number of table nodes along an edge of the image. In an image of 4,096 pixels, nodes are sixteen
/// pixels apart, and the interpolation error for strong distortion (k1 = 0.3) is a hundredth of a
/// pixel.
constexpr uint32_t kLensNodes = 257;

using WindowPoint = std::array<double, 2>;

/// Evaluates Brown's lens distortion model at a point whose y axis points down.
WindowPoint brown(const Camera& c, const WindowPoint& p) {
  const auto [x, y] = p;
  const double xx = x * x, yy = y * y, xy = x * y, r2 = xx + yy;
  const double k1 = c.lens_k1, k2 = c.lens_k2, k3 = c.lens_k3, p1 = c.lens_p1, p2 = c.lens_p2;
  const double radial = 1 + r2 * (k1 + r2 * (k2 + r2 * k3));
  return {x * radial + 2 * p1 * xy + p2 * (r2 + 2 * xx),
          y * radial + p1 * (r2 + 2 * yy) + 2 * p2 * xy};
}

/// Inverts Brown's model at `to` by Newton's method, starting at `p`. Returns false if the
/// iteration finds no solution or reaches a point where the model is not invertible.
bool invert_brown(const Camera& c, const WindowPoint& to, WindowPoint& p) {
  constexpr double kStep = 1e-6, kGood = 1e-9;
  for (int i = 0; i < 50; ++i) {
    const WindowPoint at = brown(c, p);
    const double ex = to[0] - at[0], ey = to[1] - at[1];
    const WindowPoint along_x = brown(c, {p[0] + kStep, p[1]}),
                      along_y = brown(c, {p[0], p[1] + kStep});
    const double a = (along_x[0] - at[0]) / kStep, b = (along_y[0] - at[0]) / kStep;
    const double d = (along_x[1] - at[1]) / kStep, e = (along_y[1] - at[1]) / kStep;
    const double det = a * e - b * d;
    if (!(det > 1e-6)) return false;
    if (std::abs(ex) + std::abs(ey) < kGood) return true;
    p = {p[0] + (e * ex - b * ey) / det, p[1] + (a * ey - d * ex) / det};
  }
  return false;
}

/// Inverts Brown's model from the centre of the image outwards along a line, so that the solution
/// is on the branch that contains the centre.
bool solve_outwards(const Camera& c, const WindowPoint& to, WindowPoint& p) {
  constexpr int kSteps = 8;
  p = {0, 0};
  for (int k = 1; k <= kSteps; ++k)
    if (!invert_brown(c, {to[0] * k / kSteps, to[1] * k / kSteps}, p)) return false;
  return true;
}

void fill_brown(const Camera& camera, const PixelGrid& grid, double width, double height,
                std::vector<float>& nodes) {
  nodes.resize(2 * kLensNodes * kLensNodes);
  for (uint32_t row = 0; row < kLensNodes; ++row)
    for (uint32_t column = 0; column < kLensNodes; ++column) {
      const double x = width * column / (kLensNodes - 1), y = height * row / (kLensNodes - 1);
      WindowPoint p;
      if (!solve_outwards(camera,
                          {double{grid.x0} + x * double{grid.step_x},
                           y * double{grid.step_y} - double{grid.y1}},
                          p))
        throw Error(
            "the camera's lens distortion folds over within the picture; give smaller "
            "coefficients, or a narrower picture");
      float* node = nodes.data() + 2 * (size_t{row} * kLensNodes + column);
      node[0] = static_cast<float>((p[0] - double{grid.x0}) / double{grid.step_x});
      node[1] = static_cast<float>((p[1] + double{grid.y1}) / double{grid.step_y});
    }
}

void fill_map(const Camera& camera, float width, float height, std::vector<float>& nodes) {
  for (const auto& [s0, t0, s1, t1] : camera.lens_map)
    nodes.insert(nodes.end(), {s0 * width, t0 * height, s1 * width, t1 * height});
}

}  // namespace

LensTable::LensTable(const Camera& camera, const PixelGrid& grid, uint32_t width, uint32_t height) {
  const auto w = static_cast<float>(width), h = static_cast<float>(height);
  if (camera.lens_map.empty()) {
    across = kLensNodes;
    fill_brown(camera, grid, width, height, nodes);
  } else {
    across = lens_map_nodes(camera);
    fill_map(camera, w, h, nodes);
  }
  per_x = static_cast<float>(across - 1) / w;
  per_y = static_cast<float>(across - 1) / h;
}

}  // namespace wavecomb
