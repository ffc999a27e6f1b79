// SPDX-License-Identifier: Apache-2.0
/// What kernels of a vertex are compiled with or without (kernel_matrix.h): with everything, or
/// plain, for scenes and settings that ask for nothing of it.
#pragma once

#include <cstdint>

namespace wavecomb {

enum Feature : uint32_t {
  kMotion = 1,        ///< meshes or instances that move
  kCurves = 2,        ///< curves and points
  kLinks = 4,         ///< lights that are linked
  kMeshLights = 8,    ///< mesh lights, and lights that bounces do not find
  kNotes = 16,        ///< AOVs of vertices, histories of paths
  kExperiments = 32,  ///< cosine sampling, Schlick's approximation
  kBelow = 128,       ///< light that walks below surfaces
  kInside = 256,      ///< paths that know what they are inside of
  kJoined = 64,       ///< paths from the lights, which share in the weights of the camera's
};
inline constexpr uint32_t kPlain = kNotes, kEverything = 511;

}  // namespace wavecomb
