// SPDX-License-Identifier: Apache-2.0
/// Projected size of mesh edges, from which subdivision levels are chosen.
#pragma once

#include <array>
#include <cstdint>
#include <span>

namespace wavecomb {

/// Camera for which a subdivision level is chosen.
struct ScreenView {
  /// Transform from world to camera space, for row vectors; the camera looks along -z.
  std::array<double, 16> to_camera;
  /// Whether the projection is orthographic, and whether it shows all directions.
  bool is_parallel = false, is_all_round = false;
  double centre[2], half[2];  ///< centre and half-size of the camera window
  double pixels;              ///< pixels per unit of the camera window
};

/// Returns the length-weighted mean projected length of the edges of one instance, in pixels. Edges
/// outside the image or behind the camera have a separate mean with weight 1/8, because they affect
/// only reflections and shadows, which need less detail. The result is the larger of the two means.
///
/// `to_world`: 4 x 4, for row vectors. The points must be finite, and the corner indices in range.
double edge_pixels(std::span<const float> points, std::span<const int32_t> face_sizes,
                   std::span<const int32_t> corners, const double* to_world,
                   const ScreenView& view);

}  // namespace wavecomb
