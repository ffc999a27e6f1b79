// SPDX-License-Identifier: Apache-2.0
/// Fractions of the error and the cost of a render that camera paths cause, for the prediction of
/// gains.
#pragma once

namespace wavecomb {

/// Fractions of a render's squared error and cost that its camera paths cause. Light paths cause
/// the rest.
struct CameraPathPart {
  double error = 1, cost = 1;

  /// Returns the efficiency of a render in which the squared error and the cost of camera paths
  /// change by these factors, relative to the efficiency of the render without these changes.
  double gain(double error_factor, double cost_factor) const {
    return 1 / ((1 + error * (error_factor - 1)) * (1 + cost * (cost_factor - 1)));
  }
  /// Returns `error` after the squared error of camera paths has changed by a factor.
  double error_after(double error_factor) const {
    return error * error_factor / (1 + error * (error_factor - 1));
  }
  bool operator==(const CameraPathPart&) const = default;
};
/// Fractions that are assumed for renders with light paths whose errors were not measured.
inline constexpr CameraPathPart kUnknownCameraPart = {0.5, 0.5};

}  // namespace wavecomb
