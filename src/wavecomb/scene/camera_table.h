// SPDX-License-Identifier: Apache-2.0
/// What a camera can be told beside its place, as a table: a row for each member of Camera. Checks,
/// the fingerprint, keywords in Python and their stub, calls of the sandbox and poses of the window
/// follow from it. A new parameter is a member, a row here, and its use.
#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <span>
#include <string_view>
#include <variant>
#include <vector>

#include "wavecomb/scene/camera.h"

namespace wavecomb {

using FourNumbers = std::array<float, 4>;
/// A value of a camera; of a choice its number.
using CameraValue = std::variant<float, uint32_t, FourNumbers, std::vector<FourNumbers>>;

/// In the order of CameraValue.
enum class CameraValueKind : uint8_t { kNumber, kChoice, kFour, kPlanes };

/// Contract: lives as long as the program.
struct CameraParameter {
  const char* name = "";  ///< keyword of set_camera
  const char* help = "";  ///< a sentence, with the unit
  CameraValueKind kind = CameraValueKind::kNumber;
  double least = -std::numeric_limits<double>::infinity();  ///< of numbers
  bool is_above = false;                                    ///< `least` itself is too little
  bool may_be_infinite = false;
  std::vector<const char*> choices;
  bool is_needed = false;  ///< set_camera has no default for it
  /// Counts for the fingerprint where it is the default, too: so it did before there were others.
  bool counts_always = false;

  CameraValue (*read)(const Camera&) = nullptr;
  void (*write)(Camera&, const CameraValue&) = nullptr;

  CameraValue standard() const { return read(Camera{}); }
  /// Throws Error, which names the parameter, unless its value is in range.
  void check(const Camera& camera) const;
};

/// All parameters but to_world and steps, which say where the camera is, in the order of
/// fingerprints.
std::span<const CameraParameter> camera_table();

/// Throws Error with one line that says what is wrong with the camera.
void check_camera(const Camera& camera);

}  // namespace wavecomb
