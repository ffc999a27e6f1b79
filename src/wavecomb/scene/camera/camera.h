// SPDX-License-Identifier: Apache-2.0
/// Camera parameters of a scene.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "wavecomb/core/affine.h"

namespace wavecomb {

enum class Projection : uint32_t {
  kPerspective,
  kOrthographic,
  kLatlong,  ///< equirectangular, all directions: longitude to the right, latitude up
};

/// Adaptation of a window to an image of a different aspect ratio, as by UsdRender's
/// aspectRatioConformPolicy.
enum class Conform : uint32_t {
  kExpandAperture,
  kCropAperture,
  kAdjustApertureWidth,
  kAdjustApertureHeight,
  kAdjustPixelAspectRatio,
};

/// Image edge at which a rolling shutter begins.
enum class RollingShutter : uint32_t { kOff, kTop, kBottom, kLeft, kRight };

/// A thin-lens camera. A camera looks along -z in camera space, with +x to the right and +y up, as
/// UsdGeomCamera does. Lengths are in scene units.
struct Camera {
  Affine to_world;
  /// Camera transforms at equally spaced shutter times, interpolated linearly: two or more if the
  /// camera moves. The list is empty if the camera is static at `to_world`.
  std::vector<Affine> steps{};
  Projection projection = Projection::kPerspective;
  /// Visible region: x from window[0] to window[1], y from window[2] to window[3]. For a
  /// perspective camera, the window lies on the plane z = -1. For an orthographic camera, it is
  /// perpendicular to the axis and in scene units. For a latlong camera, it is given by longitude
  /// and latitude in radians, with (0, 0) along -z.
  float window[4] = {-0.5f, 0.5f, -0.5f, 0.5f};
  /// Latlong cameras ignore this policy and stretch the window to the image.
  Conform conform = Conform::kExpandAperture;
  float pixel_aspect = 1;    ///< width / height of a pixel
  float lens_radius = 0;     ///< 0 gives a pinhole camera; ignored by latlong cameras
  float focus_distance = 1;  ///< distance along -z; must be > 0 if lens_radius > 0
  float near_clip = 0;       ///< distances along -z; radial distances for latlong cameras
  float far_clip = 1e30f;
  /// Clipping planes (a, b, c, d) in camera space. Camera rays ignore points with a x + b y + c z +
  /// d < 0; rays of all other kinds can hit these points.
  std::vector<std::array<float, 4>> clip_planes{};
  float exposure = 1;           ///< factor applied to the radiance of the image
  float aperture_blades = 0;    ///< polygon corners of the aperture, 3 or more; 0 gives a disk
  float aperture_rotation = 0;  ///< degrees, counter-clockwise as seen from behind the camera
  float lens_squeeze = 1;       ///< height / width of the aperture, for anamorphic lenses
  /// Coefficients of Brown's lens distortion model (path/camera/lens.h), on the plane at
  /// distance 1.
  float lens_k1 = 0, lens_k2 = 0, lens_k3 = 0, lens_p1 = 0, lens_p2 = 0;
  /// Lens distortion as a map, used instead of the coefficients above. The map has n x n nodes over
  /// the image, where n is even, row by row. Each array of four values holds two nodes. A node
  /// holds the position of its ray in the undistorted image, from the upper left corner, in
  /// fractions of the image width and height.
  std::vector<std::array<float, 4>> lens_map{};
  RollingShutter rolling_shutter = RollingShutter::kOff;
  /// Fraction of the shutter interval for which a rolling shutter exposes each pixel row.
  float rolling_duration = 0;
};

/// Window of a camera after `conform` has fitted it to the aspect ratio of the image: centre and
/// half extents.
struct FittedWindow {
  float centre_x, centre_y, half_x, half_y;
};
/// Returns whether the lens distorts.
bool distorts(const Camera& camera);
/// Returns the number of nodes along one edge of `lens_map`, or 0 if the map does not have n x n
/// nodes with n of 2 or more.
uint32_t lens_map_nodes(const Camera& camera);
/// Fits the camera's window to an image of width x height pixels by the policy `conform`.
FittedWindow fitted_window(const Camera& camera, uint32_t width, uint32_t height);

}  // namespace wavecomb
