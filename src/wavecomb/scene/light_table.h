// SPDX-License-Identifier: Apache-2.0
/// What a light can be told, as a table: a row for each member of Light and of its Shaping, and for
/// what kinds have to themselves. Checks, the fingerprint, keywords in Python, calls of the sandbox
/// and the window's fields follow from it. A new parameter is a member, a row here, and its use; of
/// one kind alone, a row of that kind (LightKindInfo::own) and its use.
#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <string_view>
#include <variant>
#include <vector>

#include "wavecomb/scene/light_data.h"

namespace wavecomb {

/// A value of a light; of a choice its number, of an id that is none (kNoTexture, ...) monostate.
using LightValue =
    std::variant<std::monostate, bool, uint32_t, float, Vec3<float>, std::vector<Affine>>;

enum class LightValueKind : uint8_t { kNumber, kColour, kFlag, kChoice, kId, kTransforms };
/// What an id counts.
enum class LightRefers : uint8_t { kNothing, kTexture, kProfile, kSet, kGroup, kFilter };
/// What a parameter is about.
enum class LightGroup : uint8_t { kEmission, kShape, kShaping, kResponse };

/// What kinds of lights have in common.
namespace light_trait {
inline constexpr uint32_t kPlaced = 1;     ///< it is a light by itself, not that of a mesh
inline constexpr uint32_t kSized = 2;      ///< `normalize` says something
inline constexpr uint32_t kShaped = 4;     ///< UsdLuxShapingAPI
inline constexpr uint32_t kSeen = 8;       ///< rays may meet its shape
inline constexpr uint32_t kPictured = 16;  ///< a texture
inline constexpr uint32_t kInfinite = 32;  ///< it is all around the scene
inline constexpr uint32_t kFiltered = 64;  ///< filters may stand before it
}  // namespace light_trait

/// Contract: lives as long as the program.
struct LightParameter {
  const char* name = "";   ///< keyword of add_light
  const char* label = "";  ///< in a form
  const char* help = "";   ///< a sentence, with the unit
  const char* input = "";  ///< UsdLux's, without "inputs:"; "" where it has none of that meaning
  LightGroup group = LightGroup::kEmission;
  LightValueKind kind = LightValueKind::kNumber;
  LightRefers refers = LightRefers::kNothing;
  /// Of numbers and of each component of colours; all are finite.
  double least = -std::numeric_limits<double>::infinity();
  double most = std::numeric_limits<double>::infinity();
  double usual = 1;  ///< upper end of a slider, where there is no `most`
  std::vector<const char*> choices;
  uint32_t trait = 0;      ///< lights of this trait have it, beside those of kinds that name it
  bool is_common = false;  ///< all lights have it
  bool is_own = false;     ///< one kind's, which no other light can be told
  uint32_t kinds = 0;      ///< bit k: lights of LightKind k have it

  LightValue (*read)(const Light&) = nullptr;
  void (*write)(Light&, const LightValue&) = nullptr;

  bool is_of(LightKind light) const { return (kinds >> static_cast<uint32_t>(light) & 1) != 0; }
  /// Whether a scene that is built can be told another value.
  bool can_change() const {
    return kind == LightValueKind::kNumber || kind == LightValueKind::kColour ||
           kind == LightValueKind::kFlag;
  }
  LightValue standard() const { return read(Light{}); }
};

/// All parameters but kind, name and to_world, in the order that fingerprints take them in; those
/// that one kind has to itself come last.
std::span<const LightParameter> light_table();
/// Null where there is none.
const LightParameter* find_light_parameter(std::string_view name);

/// A row for a kind's LightKindInfo::own: number `kIndex` of its own, of kMaxOwnParameters.
template <size_t kIndex>
float own_value(const Light& light, float standard) {
  static_assert(kIndex < kMaxOwnParameters);
  return light.own[kIndex].value_or(standard);
}
template <size_t kIndex, float kStandard>
LightParameter own_parameter(const char* name, const char* label, const char* input,
                             const char* help, double least, double most) {
  LightParameter p;
  p.name = name;
  p.label = label;
  p.input = input;
  p.help = help;
  p.group = LightGroup::kShape;
  p.least = least;
  p.most = most;
  p.is_own = true;
  p.read = [](const Light& light) -> LightValue { return own_value<kIndex>(light, kStandard); };
  p.write = [](Light& light, const LightValue& value) {
    light.own[kIndex] = std::get<float>(value);
  };
  return p;
}

/// "texture"; "" of kNothing.
const char* light_refers_name(LightRefers refers);
const char* light_kind_name(LightKind kind);
/// Of a light with a place of its own; throws Error for other names.
LightKind light_kind(std::string_view name);

/// How many things there are that lights refer to.
struct LightReferences {
  size_t textures = 0, profiles = 0, sets = 0, filters = 0;
};

/// Throws Error with one line that names the light where a value is not finite or out of range,
/// where it refers to what was never added, or where `light` has no place of its own.
void check_light(const Light& light, const LightReferences& there);
/// Likewise of a light of meshes.
void check_mesh_light(const Light& light, const LightReferences& there);

}  // namespace wavecomb
