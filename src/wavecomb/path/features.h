// SPDX-License-Identifier: Apache-2.0
/// Optional features of vertex kernels (kernel_matrix.h). General kernels are compiled with all
/// features. Plain kernels have only the features that simple scenes need. There is no feature flag
/// for a joint transport, since kernels select it by a template type (joint_transport.h).
#pragma once

#include <cstdint>

namespace wavecomb {

enum Feature : uint32_t {
  kMotion = 1,         ///< support for moving meshes and instances
  kCurves = 2,         ///< curves and points
  kLinks = 4,          ///< light linking
  kMeshLights = 8,     ///< mesh lights, and lights with LightEffect
  kRecordsAovs = 16,   ///< recording of AOVs and path histories at vertices
  kExperiments = 32,   ///< cosine sampling, Schlick's approximation
  kSubsurface = 64,    ///< subsurface scattering
  kNestedMedia = 128,  ///< nested dielectrics
};
inline constexpr uint32_t kPlain = kRecordsAovs;
inline constexpr uint32_t kEverything = kMotion | kCurves | kLinks | kMeshLights | kRecordsAovs |
                                        kExperiments | kSubsurface | kNestedMedia;

}  // namespace wavecomb
