// SPDX-License-Identifier: Apache-2.0
/// Program variants: the same shading code compiled for a subset of features.
#pragma once

#include <cstdint>
#include <span>
#include <string_view>

#include "wavecomb/material/description/material.h"

namespace wavecomb {

/// Features of the programs principled and openpbr that a variant can omit.
enum Part : uint32_t {
  kTexturePart = 1,   ///< The material reads textures or a value graph.
  kEmissionPart = 2,  ///< emission
  kMetalPart = 4,     ///< The material has a metallic weight above 0, or `specular_color` gives F0.
  kCoatPart = 8,      ///< clearcoat
  kTransmissionPart = 16,  ///< straight or refracted transmission
  // openpbr only:
  kBackDiffusePart = 32,  ///< diffuse transmission of thin walls, and subsurface random walks
  kFuzzPart = 64,         ///< fuzz
  kFilmPart = 128,        ///< thin film
  kAnisotropyPart = 256,  ///< anisotropy and its rotation
};
inline constexpr uint32_t kAllParts = kTexturePart | kEmissionPart | kMetalPart | kCoatPart |
                                      kTransmissionPart | kBackDiffusePart | kFuzzPart | kFilmPart |
                                      kAnisotropyPart;

/// List of reduced variants as X(name, program, parts), where `parts` are the features that the
/// variant supports, in ascending order of cost. A material uses the first variant that has all
/// features of the material. CMake reads this list as well and makes a compile unit for each row.
#define WAVECOMB_VARIANTS(X)                               \
  X(gloss, principled, 0)                                  \
  X(tinted_gloss, principled, kMetalPart)                  \
  X(textured_gloss, principled, kTexturePart)              \
  X(textured_metal, principled, kTexturePart | kMetalPart) \
  X(base, openpbr, kMetalPart)                             \
  X(textured_base, openpbr, kTexturePart | kMetalPart)

struct Variant {
  const char* name;
  const char* program;
  uint32_t parts;
};
/// List of all variants. The complete programs come first, in the order of ProgramId.
inline constexpr Variant kVariants[] = {
#define WAVECOMB_PROGRAM(name, ...) {#name, #name, kAllParts},
    WAVECOMB_PROGRAMS(WAVECOMB_PROGRAM, WAVECOMB_PROGRAM) WAVECOMB_MEDIUM_PROGRAMS(WAVECOMB_PROGRAM)
#undef WAVECOMB_PROGRAM
#define WAVECOMB_VARIANT(name, program, parts) {#name, #program, parts},
        WAVECOMB_VARIANTS(WAVECOMB_VARIANT)
#undef WAVECOMB_VARIANT
};
inline constexpr uint32_t kVariantCount = sizeof(kVariants) / sizeof(Variant);

/// Returns the id of the program called `name`. `name` must exist; in a constant expression, an
/// unknown name does not compile.
constexpr ProgramId program_id(std::string_view name) {
  uint32_t i = 0;
  while (name != kProgramNames[i]) ++i;
  return static_cast<ProgramId>(i);
}
/// Returns the program of a variant.
constexpr ProgramId program_of(uint32_t variant) {
  return program_id(kVariants[variant].program);
}

/// Returns the features that a simplified material (simplified_material.h) may use, for any texture
/// values and any graph outputs within their ranges (ranges.h). `textures` are the textures that
/// the graphs may read. `allows_subsurface` is set if the scene has subsurface random walks.
uint32_t parts_of(const Material& material, const GraphSet& graphs,
                  std::span<const TexturePtr> textures, bool allows_subsurface = false);

/// Returns the least expensive variant of a program that has all features in `parts`.
uint32_t cheapest_variant(ProgramId program, uint32_t parts);

}  // namespace wavecomb
