// SPDX-License-Identifier: Apache-2.0
/// The camera as data.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "wavecomb/core/affine.h"

namespace wavecomb {

enum class Projection : uint32_t {
  kPerspective,
  kOrthographic,
  kLatlong,  ///< longitude to the right, latitude up: all directions in one picture
};

/// What gives way where the shapes of window and picture differ: UsdRender's
/// aspectRatioConformPolicy.
enum class Conform : uint32_t {
  kExpandAperture,
  kCropAperture,
  kAdjustApertureWidth,
  kAdjustApertureHeight,
  kAdjustPixelAspectRatio,
};

/// Where a shutter that rolls over the picture begins.
enum class RollingShutter : uint32_t { kOff, kTop, kBottom, kLeft, kRight };

/// A thin-lens camera. It looks along -z of its own space, +x right, +y up (UsdGeomCamera). Lengths
/// are in scene units.
struct Camera {
  Affine to_world;
  /// Places at equal distances over the shutter, with straight lines between; none: it stands still
  /// at to_world. Two or more where it moves.
  std::vector<Affine> steps{};
  Projection projection = Projection::kPerspective;
  /// What the picture shows: x from window[0] to window[1], y from window[2] to window[3]. On the
  /// plane z = -1 of a perspective camera; across the axis of an orthographic one; of a latlong
  /// camera longitude and latitude in radians, (0, 0) along -z.
  float window[4] = {-0.5f, 0.5f, -0.5f, 0.5f};
  Conform conform = Conform::kExpandAperture;  ///< not of latlong cameras, which fill the picture
  float pixel_aspect = 1;                      ///< width of a pixel / its height
  float lens_radius = 0;                       ///< 0: all is sharp, as of latlong cameras
  float focus_distance = 1;                    ///< along -z, > 0 where lens_radius > 0
  float near_clip = 0;                         ///< along -z; of latlong cameras a distance
  float far_clip = 1e30f;
  /// Planes in the camera's space; of what it sees itself, points with a x + b y + c z + d < 0 are
  /// cut off.
  std::vector<std::array<float, 4>> clip_planes{};
  float exposure = 1;           ///< what light is multiplied by in the picture
  float aperture_blades = 0;    ///< corners of the aperture, 3 or more; 0: it is round
  float aperture_rotation = 0;  ///< degrees, counter-clockwise as the camera sees it
  float lens_squeeze = 1;       ///< the aperture's height / its width: anamorphic lenses
  /// Brown's model of distortion (integrate/lens.h), on the plane at distance 1.
  float lens_k1 = 0, lens_k2 = 0, lens_k3 = 0, lens_p1 = 0, lens_p2 = 0;
  /// Distortion as a map, in place of these: n x n nodes over the picture, n even, row by row and
  /// two in each four numbers: where the ray goes through the undistorted picture, of whose width
  /// and height these are shares, from the upper left corner.
  std::vector<std::array<float, 4>> lens_map{};
  RollingShutter rolling_shutter = RollingShutter::kOff;
  float rolling_duration = 0;  ///< share of the shutter's time that a row of pixels is exposed
};

/// A window fitted to a picture of width x height pixels, as the camera's `conform` says.
struct FittedWindow {
  float centre_x, centre_y, half_x, half_y;
};
/// Whether the lens distorts.
bool distorts(const Camera& camera);
/// Nodes along an edge of `lens_map`; 0 where these are not as many as they must be.
uint32_t lens_map_nodes(const Camera& camera);
FittedWindow fitted_window(const Camera& camera, uint32_t width, uint32_t height);

}  // namespace wavecomb
