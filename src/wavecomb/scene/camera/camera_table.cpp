// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/scene/camera/camera_table.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <type_traits>
#include <utility>

#include "wavecomb/core/encoding/number_text.h"
#include "wavecomb/core/error.h"
#include "wavecomb/geometry/mesh/motion.h"
#include "wavecomb/scene/scene_checks.h"

namespace wavecomb {
namespace {

template <auto kMember>
CameraValue read(const Camera& camera) {
  using T = std::remove_cvref_t<decltype(camera.*kMember)>;
  if constexpr (std::is_enum_v<T>)
    return static_cast<uint32_t>(camera.*kMember);
  else if constexpr (std::is_array_v<T>)
    return std::to_array(camera.*kMember);
  else
    return camera.*kMember;
}

template <auto kMember>
void write(Camera& camera, const CameraValue& value) {
  using T = std::remove_cvref_t<decltype(camera.*kMember)>;
  if constexpr (std::is_enum_v<T>)
    camera.*kMember = static_cast<T>(std::get<uint32_t>(value));
  else if constexpr (std::is_array_v<T>)
    std::copy_n(std::get<FourNumbers>(value).begin(), 4, camera.*kMember);
  else
    camera.*kMember = std::get<T>(value);
}

template <auto kMember>
CameraParameter row(const char* name, const char* help) {
  CameraParameter p;
  p.name = name;
  p.help = help;
  p.read = &read<kMember>;
  p.write = &write<kMember>;
  p.kind = static_cast<CameraValueKind>(p.read(Camera{}).index());
  return p;
}
/// Makes the row of a numeric parameter with an inclusive lower bound.
template <auto kMember>
CameraParameter number_from(const char* name, double least, const char* help) {
  CameraParameter p = row<kMember>(name, help);
  p.least = least;
  return p;
}
/// Makes the row of a numeric parameter with an exclusive lower bound.
template <auto kMember>
CameraParameter number_above(const char* name, double least, const char* help) {
  CameraParameter p = number_from<kMember>(name, least, help);
  p.is_above = true;
  return p;
}
/// Makes the row of a numeric parameter that may be infinite.
template <auto kMember>
CameraParameter distance(const char* name, const char* help) {
  CameraParameter p = row<kMember>(name, help);
  p.may_be_infinite = true;
  return p;
}
template <auto kMember>
CameraParameter choice(const char* name, std::vector<const char*> choices, const char* help) {
  CameraParameter p = row<kMember>(name, help);
  p.choices = std::move(choices);
  return p;
}
CameraParameter needed(CameraParameter p) {
  p.is_needed = true;
  return p;
}
CameraParameter counted(CameraParameter p) {
  p.counts_always = true;
  return p;
}

std::vector<CameraParameter> make_camera_parameters() {
  using C = Camera;
  return {
      counted(number_from<&C::lens_radius>(
          "lens_radius", 0, "Lens radius in scene units; 0 gives a pinhole camera.")),
      counted(distance<&C::focus_distance>("focus_distance",
                                           "Distance of the focal plane along -z in scene units; "
                                           "must be above 0 if the lens radius is above 0.")),
      counted(number_from<&C::near_clip>("near_clip", 0,
                                         "Near clipping distance in scene units: along -z, or from "
                                         "the centre of a latlong camera.")),
      counted(distance<&C::far_clip>("far_clip",
                                     "Far clipping distance in scene units: along -z, or from the "
                                     "centre of a latlong camera.")),
      counted(needed(row<&C::window>(
          "window",
          "Visible region (x0, x1, y0, y1) of a camera: on the plane z = -1 for perspective, in "
          "scene units for orthographic, in radians of longitude and latitude for latlong."))),
      choice<&C::projection>("projection", {"perspective", "orthographic", "latlong"},
                             "Projection of the camera; latlong shows all directions, with "
                             "longitude to the right and latitude up."),
      choice<&C::conform>("conform",
                          {"expandAperture", "cropAperture", "adjustApertureWidth",
                           "adjustApertureHeight", "adjustPixelAspectRatio"},
                          "How the camera window is fitted to an image of another aspect ratio "
                          "(UsdRender's aspectRatioConformPolicy)."),
      number_above<&C::pixel_aspect>("pixel_aspect", 0, "Aspect ratio of a pixel, width / height."),
      row<&C::clip_planes>("clip_planes",
                           "Clipping planes (a, b, c, d) in camera space; camera rays ignore "
                           "points with a x + b y + c z + d < 0."),
      number_from<&C::exposure>("exposure", 0,
                                "Factor by which the camera scales the radiance of the image."),
      number_from<&C::aperture_blades>(
          "aperture_blades", 0,
          "Number of corners of the lens aperture, 3 or more; 0 gives a circular aperture."),
      row<&C::aperture_rotation>("aperture_rotation", "Rotation of the lens aperture in degrees."),
      number_above<&C::lens_squeeze>("lens_squeeze", 0,
                                     "Height / width of the lens aperture, for anamorphic lenses."),
      row<&C::lens_k1>(
          "lens_k1",
          "Coefficient of r^2 in the radial lens distortion, on the plane at distance 1."),
      row<&C::lens_k2>("lens_k2", "Coefficient of r^4 in the radial lens distortion."),
      row<&C::lens_k3>("lens_k3", "Coefficient of r^6 in the radial lens distortion."),
      row<&C::lens_p1>("lens_p1", "First coefficient of the tangential lens distortion."),
      row<&C::lens_p2>("lens_p2", "Second coefficient of the tangential lens distortion."),
      row<&C::lens_map>("lens_map",
                        "Lens distortion map of n x n nodes, two in each row of four numbers; a "
                        "node is a position in the undistorted image, in fractions of its width "
                        "and height."),
      choice<&C::rolling_shutter>("rolling_shutter", {"off", "top", "bottom", "left", "right"},
                                  "Image edge at which the exposure of a rolling shutter begins."),
      number_from<&C::rolling_duration>(
          "rolling_duration", 0,
          "Fraction of the shutter interval for which a rolling shutter exposes each pixel row."),
  };
}

bool finite(const FourNumbers& four) {
  for (const float x : four)
    if (!std::isfinite(x)) return false;
  return true;
}

bool is_valid_transform(const Affine& m) {
  return finite(m) && std::abs(m.determinant()) >= 1e-30f;
}

constexpr float kHalfTurn = 1.5708f;  ///< upper bound pi / 2, with tolerance for rounding

}  // namespace

void CameraParameter::check(const Camera& camera) const {
  const auto wrong = [&](const std::string& what) {
    throw Error("the camera's " + std::string(name) + " " + what);
  };
  const CameraValue value = read(camera);
  if (const auto* number = std::get_if<float>(&value)) {
    const double v = *number;
    if (std::isnan(v) || (std::isinf(v) && !may_be_infinite))
      wrong("is not finite; give finite numbers");
    if (v < least || (is_above && v <= least))
      wrong("is " + text(v) + "; it must be " +
            (is_above ? "above " + text(least) : text(least) + " or more"));
  } else if (const auto* four = std::get_if<FourNumbers>(&value)) {
    if (!finite(*four)) wrong("is not finite; give finite numbers");
  } else if (const auto* planes = std::get_if<std::vector<FourNumbers>>(&value)) {
    for (const FourNumbers& plane : *planes)
      if (!finite(plane)) wrong("are not finite; give finite numbers");
  }
}

std::span<const CameraParameter> camera_table() {
  static const std::vector<CameraParameter> table = make_camera_parameters();
  return table;
}

void check_camera(const Camera& camera) {
  if (!is_valid_transform(camera.to_world))
    throw Error("the camera's transform is singular or not finite; give an invertible one");
  if (camera.steps.size() == 1 || camera.steps.size() > kMaxSteps)
    throw Error("the camera's motion needs 2 to " + std::to_string(kMaxSteps) + " steps");
  for (const Affine& step : camera.steps)
    if (!is_valid_transform(step))
      throw Error(
          "the camera's motion has a singular or non-finite transform; give invertible ones");
  for (const CameraParameter& p : camera_table()) p.check(camera);
  // Checks that involve several parameters.
  const float* w = camera.window;
  if (!(w[0] < w[1]) || !(w[2] < w[3]))
    throw Error("the camera's window is empty; check its aperture and focal length");
  if (camera.projection == Projection::kLatlong && (w[3] > kHalfTurn || w[2] < -kHalfTurn))
    throw Error("the latlong camera's window must lie between the poles");
  if (camera.lens_radius > 0 && !(camera.focus_distance > 0))
    throw Error("the camera's lens needs a focus distance above 0");
  const float blades = camera.aperture_blades;
  if (blades != 0 && (blades < 3 || blades > 64 || blades != std::floor(blades)))
    throw Error("the camera's aperture_blades is " + text(blades) +
                "; it must be 0, or a whole number from 3 to 64");
  if (camera.rolling_duration > 1)
    throw Error("the camera's rolling_duration is " + text(camera.rolling_duration) +
                "; it must be from 0 to 1");
  if (!camera.lens_map.empty() && lens_map_nodes(camera) == 0)
    throw Error("the camera's lens_map needs n x n nodes with an even n");
  if (!(camera.far_clip > camera.near_clip))
    throw Error("the camera's clipping range must end beyond its start");
}

}  // namespace wavecomb
