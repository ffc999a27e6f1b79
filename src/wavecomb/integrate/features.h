// SPDX-License-Identifier: Apache-2.0
/// What kernels of a vertex are compiled with or without. There are two of each: with everything,
/// and plain ones for scenes and settings that ask for nothing of it.
#pragma once

#include <cstdint>

#include "wavecomb/core/lane_types.h"

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
/// Renders that are joined by paths from the lights have kernels of their own; nothing walks there.
inline constexpr uint32_t kPlain = kNotes, kEverything = 63 | kBelow | kInside,
                          kPlainJoint = kNotes | kJoined, kJoint = 63 | kJoined;

/// Whether there are plain kernels and least variants for packets of F: for the widest ones.
/// WAVECOMB_PLAIN is how many lanes they have; 1 where there are none.
template <typename F>
inline constexpr bool kHasPlain = !kIsScalar<F> && kWidth<F> == WAVECOMB_PLAIN;

}  // namespace wavecomb
