// SPDX-License-Identifier: Apache-2.0
/// Features that vertex kernels are compiled with (kernel_matrix.h): all of them, or, for plain
/// kernels, only those that simple scenes need. A joint transport is not a feature flag, since
/// kernels select it by a template type (joint_transport.h).
#pragma once

#include <cstdint>

namespace wavecomb {

enum Feature : uint32_t {
  kMotion = 1,         ///< moving meshes or instances
  kCurves = 2,         ///< curves and points
  kLinks = 4,          ///< light linking
  kMeshLights = 8,     ///< mesh lights, and lights that only light sampling finds
  kRecordsAovs = 16,   ///< AOVs of vertices, path histories
  kExperiments = 32,   ///< cosine sampling, Schlick's approximation
  kSubsurface = 64,    ///< subsurface scattering
  kNestedMedia = 128,  ///< nested dielectrics
};
inline constexpr uint32_t kPlain = kRecordsAovs;
inline constexpr uint32_t kEverything = kMotion | kCurves | kLinks | kMeshLights | kRecordsAovs |
                                        kExperiments | kSubsurface | kNestedMedia;

}  // namespace wavecomb
