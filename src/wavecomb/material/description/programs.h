// SPDX-License-Identifier: Apache-2.0
/// List of shading programs. A shading program is the code that shades hits of a material, and each
/// material uses one program. Ids, names, kernels, material parameters and compile units are
/// derived from this list.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

namespace wavecomb {

/// Maximum number of parameters specific to one program.
inline constexpr size_t kMaxProgramParameters = 8;

/// A numeric parameter that only materials of one program have. Names must be unique among the
/// parameters of all programs.
struct ProgramParameter {
  const char* name = nullptr;
  float standard = 0;
  float least = 0, most = 0;
};

/// Traits of programs, combined as bits. The scene, the accelerator and pilot renders check traits
/// and never a program's name, so that a new program only needs a table row and a BSDF.
namespace program_trait {
inline constexpr uint32_t kEmits = 1;  ///< reads the emission input
/// The program has a roughness input. A low roughness gives lobes that can focus light into
/// caustics.
inline constexpr uint32_t kGlossy = 2;
/// All materials of the program refract light, as glass does.
inline constexpr uint32_t kGlass = 4;
/// Shades curves as whole fibres: the BSDF includes scattering inside the fibre, so rays hit such
/// meshes only from outside (accel/presence.h).
inline constexpr uint32_t kFibre = 8;
/// The BSDF transmits light where opacity is below 1, unless the material uses opacity as presence.
inline constexpr uint32_t kTransmitsByOpacity = 16;
/// The program has the inputs of WAVECOMB_OPENPBR_INPUTS, and its OpenPBR layers need energy
/// tables.
inline constexpr uint32_t kLayered = 32;
/// Closed meshes with the program may bound a medium, and have a priority for nested dielectrics.
inline constexpr uint32_t kNests = 64;
inline constexpr uint32_t kSubsurface = 128;  ///< materials may have subsurface random walks
}  // namespace program_trait

/// One row for each program:
///
///   name, class of its BSDF without "Bsdf", traits (program_trait), modelled cost of a record in
///   ns (for reproducible renders), then its specific parameters as {"name", default, least, most}
///
/// The code is in material/programs/NAME.h, which material/program_table.h includes for tests. A
/// row starts with P if the BSDF class has reduced variants (material/description/variants.h), and
/// with X otherwise. CMake also reads this list, so each row must begin on a new line, after two
/// spaces. Add new programs at the end, since fingerprints contain the ids.
#define WAVECOMB_PROGRAMS(X, P)                                                       \
  X(diffuse, Diffuse, 0, 60)                                                          \
  X(metal, Metal, kGlossy, 75)                                                        \
  X(dielectric, Dielectric, kGlossy | kGlass, 70)                                     \
  X(plastic, Plastic, kGlossy, 85)                                                    \
  X(emissive, Emissive, kEmits, 20)                                                   \
  P(principled, Principled, kEmits | kGlossy | kTransmitsByOpacity, 110)              \
  P(openpbr, OpenPbr, kEmits | kGlossy | kLayered | kNests | kSubsurface, 300)        \
  X(hair, Hair, kGlossy | kFibre, 350, {"azimuthal_roughness", 0.3f, 0, 1},           \
    {"scale_tt", 0.5f, 0, 10}, {"scale_trt", 2, 0, 10}, {"cuticle_tilt", 0, -90, 90}, \
    {"tint_r", 1, 0, 1}, {"tint_tt", 1, 0, 1}, {"tint_trt", 1, 0, 1})

/// Programs for collisions in media (path/media.h), in the same format. Meshes cannot use these
/// programs. Their code is in src/wavecomb/medium.
#define WAVECOMB_MEDIUM_PROGRAMS(M) M(volume, Volume, kGlossy, 150)

enum class ProgramId : uint8_t {
#define WAVECOMB_PROGRAM(name, Class, ...) k##Class,
  WAVECOMB_PROGRAMS(WAVECOMB_PROGRAM, WAVECOMB_PROGRAM) WAVECOMB_MEDIUM_PROGRAMS(WAVECOMB_PROGRAM)
#undef WAVECOMB_PROGRAM
};

struct ProgramInfo {
  const char* name;
  uint32_t traits;  ///< bits of program_trait
  float model_ns;   ///< estimated cost of shading one queued hit, in nanoseconds
  std::array<ProgramParameter, kMaxProgramParameters> own;

  constexpr size_t specific_count() const {
    size_t count = 0;
    while (count < own.size() && own[count].name) ++count;
    return count;
  }
};
/// All programs, indexed by ProgramId.
inline constexpr auto kPrograms = [] {
  using namespace program_trait;
  return std::to_array<ProgramInfo>({
#define WAVECOMB_PROGRAM(name, Class, traits, ns, ...) {#name, traits, ns, {{__VA_ARGS__}}},
      WAVECOMB_PROGRAMS(WAVECOMB_PROGRAM, WAVECOMB_PROGRAM)
          WAVECOMB_MEDIUM_PROGRAMS(WAVECOMB_PROGRAM)
#undef WAVECOMB_PROGRAM
  });
}();
inline constexpr const char* kProgramNames[] = {
#define WAVECOMB_PROGRAM(name, ...) #name,
    WAVECOMB_PROGRAMS(WAVECOMB_PROGRAM, WAVECOMB_PROGRAM) WAVECOMB_MEDIUM_PROGRAMS(WAVECOMB_PROGRAM)
#undef WAVECOMB_PROGRAM
};
inline constexpr auto kProgramCount = static_cast<uint32_t>(kPrograms.size());
#define WAVECOMB_PROGRAM(...) +1
inline constexpr uint32_t kMediumProgramCount = 0 WAVECOMB_MEDIUM_PROGRAMS(WAVECOMB_PROGRAM);
#undef WAVECOMB_PROGRAM
/// Number of surface programs, which come first.
inline constexpr uint32_t kSurfaceProgramCount = kProgramCount - kMediumProgramCount;

constexpr const ProgramInfo& info_of(ProgramId program) {
  return kPrograms[static_cast<size_t>(program)];
}
/// Returns whether a program has any of `traits` (bits of program_trait).
constexpr bool has_trait(ProgramId program, uint32_t traits) {
  return (info_of(program).traits & traits) != 0;
}
/// Returns whether a program reads the emission input.
constexpr bool can_emit(ProgramId program) {
  return has_trait(program, program_trait::kEmits);
}

}  // namespace wavecomb
