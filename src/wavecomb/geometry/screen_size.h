// SPDX-License-Identifier: Apache-2.0
/// How large the edges of a mesh are in the picture.
#pragma once

#include <array>
#include <cstdint>
#include <span>

namespace wavecomb {

/// The view that a level of subdivision is chosen for.
struct ScreenView {
  /// From the world to the camera's space, row vectors; the camera looks along -z.
  std::array<double, 16> to_camera;
  /// What is far is as large as what is near, or all directions are in the picture.
  bool is_parallel = false, is_all_round = false;
  double centre[2], half[2];  ///< of the camera's window, as wide as the picture
  double pixels;              ///< for each unit of the window
};

/// Length in pixels of the edges of polygons in one placement: the mean of those in the picture,
/// long ones counting by their length. Edges outside the picture, and those behind the camera,
/// count an eighth of what they would have at their distance: reflections and shadows need no more.
/// The greater of both.
///
/// `to_world`: row vectors, 16 numbers. Points must be finite and corners in range.
double edge_pixels(std::span<const float> points, std::span<const int32_t> face_sizes,
                   std::span<const int32_t> corners, const double* to_world,
                   const ScreenView& view);

}  // namespace wavecomb
