// SPDX-License-Identifier: Apache-2.0
/// Material descriptions: a shading program with parameters and textures.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "wavecomb/core/affine.h"
#include "wavecomb/graph/graph.h"
#include "wavecomb/material/description/openpbr_inputs.h"
#include "wavecomb/material/description/programs.h"
#include "wavecomb/texture/texture.h"

namespace wavecomb {

/// Material parameters that a texture can drive. Inputs without a texture use a constant.
enum class Input : uint8_t {
  /// RGB: albedo, F0 of metals (reflectance at normal incidence), or tint of dielectrics.
  kBaseColor,
  /// RGB: tint at 82 degrees (F82) of metals, or F0 of "principled" with specular workflow.
  kSpecularColor,
  kEmission,   ///< RGB radiance
  kRoughness,  ///< perceptual; alpha = roughness^2
  kMetallic,
  kClearcoat,
  kClearcoatRoughness,
  kOpacity,
  kNormal,  ///< tangent-space normal, with components in [-1, 1]
};
inline constexpr uint32_t kInputCount = 9;
inline constexpr const char* kInputNames[kInputCount] = {
    "base_color", "specular_color",      "emission", "roughness", "metallic",
    "clearcoat",  "clearcoat_roughness", "opacity",  "normal"};
inline constexpr uint32_t input_bit(Input s) {
  return 1u << static_cast<uint32_t>(s);
}

/// A texture connected to an input: value = texel * scale + bias at uv' = transform(uv).
struct TextureUse {
  uint32_t texture = kNoTexture;
  /// Texture channel: 0 to 3 read a single channel for r, g and b; 4 reads RGB.
  uint32_t channel = 4;
  std::array<float, 4> scale{1, 1, 1, 1}, bias{0, 0, 0, 0};
  /// u' = m[0] u + m[1] v + m[2]; v' = m[3] u + m[4] v + m[5].
  std::array<float, 6> uv{1, 0, 0, 0, 1, 0};
};

/// A material. The defaults are the defaults of UsdPreviewSurface.
struct Material {
  std::string name;
  ProgramId program = ProgramId::kPrincipled;
  Vec3<float> base_color{0.18f, 0.18f, 0.18f};
  Vec3<float> specular_color{0, 0, 0};
  Vec3<float> emission{0, 0, 0};
  float roughness = 0.5f;
  float metallic = 0;
  float clearcoat = 0;
  float clearcoat_roughness = 0.01f;
  float opacity = 1;
  float ior = 1.5f;
  /// If the threshold is above 0, opacities below the threshold become 0, and all other opacities
  /// become 1.
  float opacity_threshold = 0;
  /// Measured complex index of refraction, for the program "metal". If any component of
  /// `conductor_k` is above 0, the index replaces F0 and F82.
  Vec3<float> conductor_eta{0, 0, 0}, conductor_k{0, 0, 0};
  /// For "principled": `specular_color` gives F0, and `metallic` is ignored.
  bool specular_workflow = false;
  /// For "principled": opacity cuts out parts of the surface instead of making the surface
  /// transparent.
  bool presence = false;
  std::array<TextureUse, kInputCount> textures;
  OpenPbr openpbr;  ///< inputs that only the program "openpbr" uses
  /// Values of the program-specific parameters that ProgramInfo::own lists; empty entries use the
  /// default.
  std::array<std::optional<float>, kMaxProgramParameters> own;
  /// Ids of the value graphs that compute parameters at hits, from SceneBuilder::add_graph(), or
  /// kNoGraph. The graphs for opacity and emission repeat the relevant parts of `graph`, so that
  /// shadow rays and light samples evaluate nothing else.
  uint32_t graph = kNoGraph, opacity_graph = kNoGraph, emission_graph = kNoGraph;

  /// Returns program-specific parameter `i`.
  float specific_value(size_t i) const { return own[i].value_or(info_of(program).own[i].standard); }
  [[deprecated("use specific_value()")]] float own_value(size_t i) const {
    return specific_value(i);
  }
  bool has_texture(Input s) const { return textures[static_cast<size_t>(s)].texture != kNoTexture; }
  /// Returns whether the material can emit light. The program must read the emission input, and the
  /// input must not be zero.
  bool emits() const {
    return can_emit(program) && (emission.x > 0 || emission.y > 0 || emission.z > 0 ||
                                 has_texture(Input::kEmission) || emission_graph != kNoGraph);
  }
  /// Returns whether ray traversal must evaluate the presence of the surface.
  bool needs_presence() const {
    return (presence || opacity_threshold > 0) &&
           (opacity < 1 || opacity < opacity_threshold || opacity_varies());
  }
  /// Returns whether light may pass straight through the surface because its opacity is below 1.
  bool transmits_straight() const {
    return has_trait(program, program_trait::kTransmitsByOpacity) && !presence &&
           !(opacity_threshold > 0) && (opacity < 1 || opacity_varies());
  }
  /// Returns whether opacity varies over surfaces with this material.
  bool opacity_varies() const { return has_texture(Input::kOpacity) || opacity_graph != kNoGraph; }
};

/// Packed material: 32 floats in a row, so that a record fills two cache lines.
struct alignas(64) MaterialRecord {
  float base_color[3], specular_color[3], emission[3];
  float roughness, metallic, clearcoat, clearcoat_roughness, opacity;
  float normal[3];
  float ior, opacity_threshold;
  float conductor_eta[3], conductor_k[3];
  uint32_t textured_inputs;  ///< bit `s` is set if input `s` reads a texture
  uint32_t flags;            ///< MaterialFlags
  uint32_t program;
  uint32_t openpbr;  ///< index of the material's OpenPbrRecord
  uint32_t graph = kNoGraph, opacity_graph = kNoGraph, emission_graph = kNoGraph;
};
static_assert(sizeof(MaterialRecord) == 128);
/// Additional bit of MaterialRecord::textured_inputs. The bit is set if the program needs a tangent
/// frame along the u axis of texture space, even if the material has no texture.
inline constexpr uint32_t kNeedsTangent = 1u << 31;
/// Bits of MaterialRecord::textured_inputs. `kReadsGraph` means that a value graph drives
/// parameters, and `kGraphNormal` that a value graph drives the normal.
inline constexpr uint32_t kReadsGraph = 1u << 30, kGraphNormal = 1u << 29;
enum MaterialFlags : uint32_t {
  kSpecularWorkflow = 1,
  kPresence = 2,
  kConductorIndex = 4,
  kEmits = 8,
  kHasGraph = 16,
  kTransmitsStraight = 32,
};
/// Packed TextureUse of 64 bytes.
struct alignas(64) TextureUseRecord {
  uint32_t texture, channel;
  float scale[4], bias[4], uv[6];
};
static_assert(sizeof(TextureUseRecord) == 64);

/// Packed parameters specific to a program.
struct alignas(16) ProgramParameterRecord {
  float value[kMaxProgramParameters];
};
static_assert(sizeof(ProgramParameterRecord) == 4 * kMaxProgramParameters);

/// Entry of MaterialView::straight_table for a material without a table.
inline constexpr uint32_t kNoStraightTable = 0xffffffffu;

/// Device view of all materials. Texture uses are indexed by `material * kInputCount + input`.
struct MaterialView {
  const MaterialRecord* materials = nullptr;
  const TextureUseRecord* uses = nullptr;
  const TextureView* textures = nullptr;
  const OpenPbrRecord* openpbr = nullptr;
  /// Records of program-specific parameters, indexed by material; null if no material has any.
  const ProgramParameterRecord* own = nullptr;
  const float* energy = nullptr;  ///< energy tables (EnergyTables), if a material needs them
  /// Index of each material's table in `straight_tables`, or kNoStraightTable; null if no material
  /// has a table of straight transmission (lobes/straight_transmission.h).
  const uint32_t* straight_table = nullptr;
  const float* straight_tables = nullptr;
  GraphView graphs{};
};

}  // namespace wavecomb
