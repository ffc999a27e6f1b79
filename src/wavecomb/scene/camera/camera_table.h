// SPDX-License-Identifier: Apache-2.0
/// Table of camera parameters other than the transform: one row for each member of Camera. The
/// table determines the range checks, the scene fingerprint, the Python keywords with their stub,
/// and the camera values that the interactive window sets. To add a parameter, add a member, a row
/// here, and the code that uses the parameter.
#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <span>
#include <string_view>
#include <variant>
#include <vector>

#include "wavecomb/scene/camera/camera.h"

namespace wavecomb {

using FourNumbers = std::array<float, 4>;
/// Value of a camera parameter. The value of a choice is an index.
using CameraValue = std::variant<float, uint32_t, FourNumbers, std::vector<FourNumbers>>;

/// Alternatives of CameraValue, in the same order.
enum class CameraValueKind : uint8_t { kNumber, kChoice, kFour, kPlanes };

/// Description of a camera parameter. Contract: descriptions have static lifetime.
struct CameraParameter {
  const char* name = "";  ///< keyword of set_camera
  const char* help = "";  ///< one sentence, with the unit
  CameraValueKind kind = CameraValueKind::kNumber;
  double least = -std::numeric_limits<double>::infinity();  ///< lower bound of a number
  bool is_above = false;  ///< whether the lower bound is exclusive
  bool may_be_infinite = false;
  std::vector<const char*> choices;
  bool is_needed = false;  ///< whether set_camera requires the parameter
  /// Whether the fingerprint includes the value even if it is the default, as for the first
  /// parameters of the table.
  bool counts_always = false;

  CameraValue (*read)(const Camera&) = nullptr;
  void (*write)(Camera&, const CameraValue&) = nullptr;

  CameraValue standard() const { return read(Camera{}); }
  /// Throws Error with the name of the parameter if its value is out of range.
  void check(const Camera& camera) const;
};

/// Returns all parameters except `to_world` and `steps`, in the order in which fingerprints hash
/// them.
std::span<const CameraParameter> camera_table();

/// Throws Error with one line that says which camera value is invalid.
void check_camera(const Camera& camera);

}  // namespace wavecomb
