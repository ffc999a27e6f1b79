// SPDX-License-Identifier: Apache-2.0
/// Table of light parameters: one row for each member of Light and Shaping, and for each parameter
/// that is specific to a light kind. Range checks, the scene fingerprint, Python keywords, sandbox
/// calls and the fields of the light editor are derived from this table. To add a parameter, add a
/// member to Light or Shaping, a row to this table, and code that uses the parameter. A parameter
/// of a single light kind needs only a row in the description of the kind (LightKindInfo::own) and
/// code that uses the parameter.
#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <string_view>
#include <variant>
#include <vector>

#include "wavecomb/light/description/light.h"

namespace wavecomb {

/// Value of a light parameter. A choice is stored as its index; an unset id (such as kNoTexture) is
/// stored as monostate.
using LightValue =
    std::variant<std::monostate, bool, uint32_t, float, Vec3<float>, std::vector<Affine>>;

enum class LightValueKind : uint8_t { kNumber, kColour, kFlag, kChoice, kId, kTransforms };
/// Type of object to which the id in a light parameter refers.
enum class LightRefers : uint8_t { kNothing, kTexture, kProfile, kSet, kGroup, kFilter };
/// Group under which the light editor shows a parameter.
enum class LightGroup : uint8_t { kEmission, kShape, kShaping, kResponse };

/// Traits that kinds of lights share.
namespace light_trait {
/// The light has its own transform; mesh lights do not.
inline constexpr uint32_t kHasTransform = 1;
inline constexpr uint32_t kSized = 2;         ///< `normalize` has an effect
inline constexpr uint32_t kShaped = 4;        ///< supports UsdLuxShapingAPI
inline constexpr uint32_t kVisibleShape = 8;  ///< rays can hit the light's shape
inline constexpr uint32_t kTextured = 16;     ///< supports a texture
/// The light surrounds the scene at infinite distance.
inline constexpr uint32_t kInfinite = 32;
inline constexpr uint32_t kFiltered = 64;  ///< supports light filters
/// The light's radiance is the background in light path expressions.
inline constexpr uint32_t kBackground = 128;
/// Rays can hit the light's shape, which is not a mesh of the scene.
inline constexpr uint32_t kOwnShape = 256;
}  // namespace light_trait

/// Description of a light parameter. Contract: a description exists as long as the program runs.
struct LightParameter {
  const char* name = "";   ///< keyword of SceneBuilder.add_light()
  const char* label = "";  ///< label in the light editor
  const char* help = "";   ///< help text: one sentence, with the unit
  const char* input = "";  ///< UsdLux name without "inputs:"; "" if UsdLux has no equivalent
  LightGroup group = LightGroup::kEmission;
  LightValueKind kind = LightValueKind::kNumber;
  LightRefers refers = LightRefers::kNothing;
  /// Bounds of a number or of each component of a colour; all values are finite.
  double least = -std::numeric_limits<double>::infinity();
  double most = std::numeric_limits<double>::infinity();
  double slider_max = 1;  ///< upper end of the parameter's slider if `most` is infinite
  std::vector<const char*> choices;
  /// Lights with this trait have the parameter, in addition to the light kinds that list its name.
  uint32_t trait = 0;
  bool is_common = false;    ///< whether all lights have the parameter
  bool is_specific = false;  ///< whether the parameter is specific to one kind of light
  uint32_t kinds = 0;        ///< bit k is set if lights of LightKind k have the parameter

  LightValue (*read)(const Light&) = nullptr;
  void (*write)(Light&, const LightValue&) = nullptr;

  bool is_of(LightKind light) const { return (kinds >> static_cast<uint32_t>(light) & 1) != 0; }
  /// Returns whether the value of the parameter can be changed without building a new scene.
  bool can_change() const {
    return kind == LightValueKind::kNumber || kind == LightValueKind::kColour ||
           kind == LightValueKind::kFlag;
  }
  LightValue standard() const { return read(Light{}); }
};

/// Returns all light parameters except kind, name and to_world. Scene fingerprints hash them in
/// this order. Parameters specific to one kind come last.
std::span<const LightParameter> light_table();
/// Returns the table row of a light parameter, or null for an unknown name.
const LightParameter* find_light_parameter(std::string_view name);

/// Returns the value of a light's kind-specific parameter `kIndex` (an index into
/// LightKindInfo::own), or `standard` if it is not set.
template <size_t kIndex>
float specific_value(const Light& light, float standard) {
  static_assert(kIndex < kMaxSpecificParameters);
  return light.own[kIndex].value_or(standard);
}
template <size_t kIndex, float kStandard>
LightParameter specific_parameter(const char* name, const char* label, const char* input,
                                  const char* help, double least, double most) {
  LightParameter p;
  p.name = name;
  p.label = label;
  p.input = input;
  p.help = help;
  p.group = LightGroup::kShape;
  p.least = least;
  p.most = most;
  p.is_specific = true;
  p.read = [](const Light& light) -> LightValue {
    return specific_value<kIndex>(light, kStandard);
  };
  p.write = [](Light& light, const LightValue& value) {
    light.own[kIndex] = std::get<float>(value);
  };
  return p;
}

/// Returns the name of a type of object, such as "texture"; "" for kNothing.
const char* light_refers_name(LightRefers refers);
const char* light_kind_name(LightKind kind);
/// Returns the light kind called `name`. Throws Error if there is no such kind, or for mesh lights,
/// which have no transform.
LightKind light_kind(std::string_view name);

/// Numbers of textures, profiles, sets and filters to which lights can refer.
struct LightReferences {
  size_t textures = 0, profiles = 0, sets = 0, filters = 0;
};

/// Throws Error with a one-line message that names the light if a value is not finite or out of
/// range, if an id refers to an object that was never added, or if the kind has no transform.
void check_light(const Light& light, const LightReferences& references);
/// Throws Error if `light` is not a mesh light, if a value is not finite or out of range, or if an
/// id refers to an object that was never added.
void check_mesh_light(const Light& light, const LightReferences& references);

}  // namespace wavecomb
