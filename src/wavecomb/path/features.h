// SPDX-License-Identifier: Apache-2.0
/// Features that vertex kernels are compiled with (kernel_matrix.h): all of them, or, for plain
/// kernels, only those that simple scenes need.
#pragma once

#include <cstdint>

namespace wavecomb {

enum Feature : uint32_t {
  kMotion = 1,        ///< moving meshes or instances
  kCurves = 2,        ///< curves and points
  kLinks = 4,         ///< light linking
  kMeshLights = 8,    ///< mesh lights, and lights that only light sampling finds
  kNotes = 16,        ///< AOVs of vertices, path histories
  kExperiments = 32,  ///< cosine sampling, Schlick's approximation
  kJoined = 64,       ///< MIS between camera paths and light paths
  kBelow = 128,       ///< subsurface scattering
  kInside = 256,      ///< nested dielectrics
};
inline constexpr uint32_t kPlain = kNotes;
inline constexpr uint32_t kEverything =
    kMotion | kCurves | kLinks | kMeshLights | kNotes | kExperiments | kJoined | kBelow | kInside;

}  // namespace wavecomb
