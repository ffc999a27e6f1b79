// SPDX-License-Identifier: Apache-2.0
/// Parameters of the program "openpbr" beyond the slots that all programs share.
#pragma once

#include <cstdint>

#include "wavecomb/core/vec3.h"

namespace wavecomb {

/// Defaults are those of OpenPBR Surface 1.1, but for the weights of its slots.
struct OpenPbr {
  float diffuse_roughness = 0;
  float specular_weight = 1;
  float anisotropy = 0;  ///< of specular roughness, 0 to 1
  float rotation = 0;    ///< of the grain, in turns from the tangent towards the bitangent
  float transmission_weight = 0;
  Vec3<float> transmission_color{1, 1, 1};
  /// Where > 0, transmission_color is what a path of this length inside leaves; else it tints each
  /// crossing.
  float transmission_depth = 0;
  float subsurface_weight = 0;  ///< approximated as diffuse
  Vec3<float> subsurface_color{0.8f, 0.8f, 0.8f};
  float subsurface_anisotropy = 0;  ///< -1 to 1: thin walls send (1 + this) / 2 through
  float fuzz_weight = 0;
  Vec3<float> fuzz_color{1, 1, 1};
  float fuzz_roughness = 0.5f;
  Vec3<float> coat_color{1, 1, 1};
  float coat_ior = 1.6f;
  float coat_darkening = 1;
  float film_weight = 0;
  float film_thickness = 500;  ///< nanometres
  float film_ior = 1.4f;
  bool thin_walled = false;
};

/// As lanes read it: 32 words.
struct alignas(64) OpenPbrRecord {
  float diffuse_roughness, specular_weight, anisotropy, rotation;
  float transmission_weight, transmission_tint[3], extinction[3];
  float subsurface_weight, subsurface_color[3], subsurface_anisotropy;
  float fuzz_weight, fuzz_color[3], fuzz_roughness;
  float coat_color[3], coat_ior, coat_darkening;
  float film_weight, film_thickness, film_ior;
  float thin_walled;  ///< 0 or 1
  float pad[2];
};
static_assert(sizeof(OpenPbrRecord) == 128);

}  // namespace wavecomb
