// SPDX-License-Identifier: Apache-2.0
/// Variants of programs: the same code without the parts that a material cannot show.
#pragma once

#include <cstdint>
#include <span>
#include <string_view>

#include "wavecomb/scene/material_data.h"

namespace wavecomb {

/// What materials of programs principled and openpbr may do without.
enum Part : uint32_t {
  kVaries = 1,     ///< reads textures or a value graph
  kGlows = 2,      ///< emission
  kMetals = 4,     ///< metallic above 0, or F0 by specular_color
  kCoats = 8,      ///< a clearcoat
  kPasses = 16,    ///< transmission, straight or refracted
  kBacks = 32,     ///< openpbr: diffuse light through thin walls
  kFuzzes = 64,    ///< openpbr: fuzz
  kFilms = 128,    ///< openpbr: a thin film
  kBrushes = 256,  ///< openpbr: anisotropy and its rotation
};
inline constexpr uint32_t kAllParts = 511;

/// The variants that are not the whole of a program, each the cheapest that has its parts:
/// X(name, program, parts), in the order of what they cost. CMake reads this list, too: there is a
/// compile unit for each.
#define WAVECOMB_VARIANTS(X)                       \
  X(gloss, principled, 0)                          \
  X(tinted_gloss, principled, kMetals)             \
  X(textured_gloss, principled, kVaries)           \
  X(textured_metal, principled, kVaries | kMetals) \
  X(base, openpbr, kMetals)                        \
  X(textured_base, openpbr, kVaries | kMetals)

struct Variant {
  const char* name;
  const char* program;
  uint32_t parts;
};
/// Each program with all of its parts comes first, in the order of ProgramId.
inline constexpr Variant kVariants[] = {
#define WAVECOMB_PROGRAM(name, ...) {#name, #name, kAllParts},
    WAVECOMB_PROGRAMS(WAVECOMB_PROGRAM, WAVECOMB_PROGRAM) WAVECOMB_MEDIUM_PROGRAMS(WAVECOMB_PROGRAM)
#undef WAVECOMB_PROGRAM
#define WAVECOMB_VARIANT(name, program, parts) {#name, #program, parts},
        WAVECOMB_VARIANTS(WAVECOMB_VARIANT)
#undef WAVECOMB_VARIANT
};
inline constexpr uint32_t kVariantCount = sizeof(kVariants) / sizeof(Variant);

/// The id of the program called `name`; no constant where there is none.
constexpr ProgramId program_id(std::string_view name) {
  uint32_t i = 0;
  while (name != kProgramNames[i]) ++i;
  return static_cast<ProgramId>(i);
}
/// The program that a variant is of.
constexpr ProgramId program_of(uint32_t variant) {
  return program_id(kVariants[variant].program);
}

/// Parts that a settled material (settled_material.h) may show: whatever its textures give, and its
/// graphs within their ranges (graph_ranges.h), which may read `textures`. `may_walk`: light walks
/// below the surfaces that ask for it.
uint32_t parts_of(const Material& material, const GraphSet& graphs,
                  std::span<const TexturePtr> textures, bool may_walk = false);

/// The cheapest variant of a program that has all of these parts.
uint32_t least_variant(ProgramId program, uint32_t parts);

}  // namespace wavecomb
