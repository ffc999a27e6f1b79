// SPDX-License-Identifier: Apache-2.0
/// Materials as data: a program with parameters and textures.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "wavecomb/core/affine.h"
#include "wavecomb/graph/graph.h"
#include "wavecomb/scene/openpbr_data.h"
#include "wavecomb/scene/programs.h"
#include "wavecomb/texture/texture.h"

namespace wavecomb {

/// Parameters that a texture can drive. Each has a constant, used where no texture is connected.
enum class Input : uint8_t {
  kBaseColor,      ///< rgb: albedo; metal: reflectance at normal incidence (F0); dielectric: tint
  kSpecularColor,  ///< rgb: metal: tint at 82 degrees (F82); principled, specular workflow: F0
  kEmission,       ///< rgb: radiance
  kRoughness,      ///< perceptual; alpha = roughness^2
  kMetallic,
  kClearcoat,
  kClearcoatRoughness,
  kOpacity,
  kNormal,  ///< rgb: tangent-space normal, already scaled and biased to [-1, 1]
};
inline constexpr uint32_t kInputCount = 9;
inline constexpr const char* kInputNames[kInputCount] = {
    "base_color", "specular_color",      "emission", "roughness", "metallic",
    "clearcoat",  "clearcoat_roughness", "opacity",  "normal"};
inline constexpr uint32_t input_bit(Input s) {
  return 1u << static_cast<uint32_t>(s);
}

/// How an input reads a texture: value = texel * scale + bias at uv' = transform(uv).
struct TextureUse {
  uint32_t texture = kNoTexture;
  /// 0..3: that channel for all of r, g, b; 4: rgb.
  uint32_t channel = 4;
  std::array<float, 4> scale{1, 1, 1, 1}, bias{0, 0, 0, 0};
  /// u' = m[0] u + m[1] v + m[2]; v' = m[3] u + m[4] v + m[5].
  std::array<float, 6> uv{1, 0, 0, 0, 1, 0};
};

/// One material. Defaults are those of UsdPreviewSurface.
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
  float opacity_threshold = 0;  ///< > 0: opacity below it is 0, else 1
  /// Conductor by measured index (metal only): used where any k > 0, in place of F0 and F82.
  Vec3<float> conductor_eta{0, 0, 0}, conductor_k{0, 0, 0};
  bool specular_workflow = false;  ///< principled: F0 from specular_color rather than metallic
  bool presence = false;  ///< principled: opacity is presence (cut-out) rather than transparency
  std::array<TextureUse, kInputCount> textures;
  OpenPbr openpbr;  ///< read by the program of that name alone
  /// Parameters that its program alone has (ProgramInfo::own), where they are given.
  std::array<std::optional<float>, kMaxProgramParameters> own;
  /// What computes parameters at hits, in place of constants and textures: ids of
  /// SceneBuilder::add_graph or kNoGraph. The parts that drive opacity and emission alone stand
  /// beside the whole, for rays and lights that ask for nothing else.
  uint32_t graph = kNoGraph, opacity_graph = kNoGraph, emission_graph = kNoGraph;

  /// Number `i` of the parameters that its program alone has.
  float own_value(size_t i) const { return own[i].value_or(info_of(program).own[i].standard); }
  bool has_texture(Input s) const { return textures[static_cast<size_t>(s)].texture != kNoTexture; }
  /// Whether it can shine: its program reads the emission input and finds something there.
  bool emits() const {
    return can_emit(program) && (emission.x > 0 || emission.y > 0 || emission.z > 0 ||
                                 has_texture(Input::kEmission) || emission_graph != kNoGraph);
  }
  /// Whether rays must ask how much of the surface is there.
  bool needs_presence() const {
    return (presence || opacity_threshold > 0) &&
           (opacity < 1 || opacity < opacity_threshold || opacity_varies());
  }
  /// Whether opacity is not the same all over what wears the material.
  bool opacity_varies() const { return has_texture(Input::kOpacity) || opacity_graph != kNoGraph; }
};

/// A material as lanes read it: 32 floats side by side, so that one record is two cache lines.
struct alignas(64) MaterialRecord {
  float base_color[3], specular_color[3], emission[3];
  float roughness, metallic, clearcoat, clearcoat_roughness, opacity;
  float normal[3];
  float ior, opacity_threshold;
  float conductor_eta[3], conductor_k[3];
  uint32_t textured_inputs;  ///< bit s: input s reads a texture
  uint32_t flags;            ///< MaterialFlags
  uint32_t program;
  uint32_t openpbr;  ///< its OpenPbrRecord
  uint32_t graph = kNoGraph, opacity_graph = kNoGraph, emission_graph = kNoGraph;
};
static_assert(sizeof(MaterialRecord) == 128);
/// A bit of MaterialRecord::textured_inputs beside those of inputs: the program needs a frame along
/// the texture, though it may read none.
inline constexpr uint32_t kNeedsTangent = 1u << 31;
/// Likewise: a graph drives parameters; one drives the normal.
inline constexpr uint32_t kReadsGraph = 1u << 30, kGraphNormal = 1u << 29;
enum MaterialFlags : uint32_t {
  kSpecularWorkflow = 1,
  kPresence = 2,
  kConductorIndex = 4,
  kEmits = 8,
  kHasGraph = 16,
};
/// A TextureUse as lanes read it: 16 words.
struct alignas(64) TextureUseRecord {
  uint32_t texture, channel;
  float scale[4], bias[4], uv[6];
};
static_assert(sizeof(TextureUseRecord) == 64);

/// What programs have to themselves, as lanes read it.
struct alignas(16) ProgramParameterRecord {
  float value[kMaxProgramParameters];
};
static_assert(sizeof(ProgramParameterRecord) == 4 * kMaxProgramParameters);

/// What kernels need of all materials. Uses are at `material * kInputCount + input`.
struct MaterialView {
  const MaterialRecord* materials = nullptr;
  const TextureUseRecord* uses = nullptr;
  const TextureView* textures = nullptr;
  const OpenPbrRecord* openpbr = nullptr;
  /// By material; null where no material runs a program that has parameters to itself.
  const ProgramParameterRecord* own = nullptr;
  const float* energy = nullptr;  ///< EnergyTables; set where a material needs them
  GraphView graphs{};
};

}  // namespace wavecomb
