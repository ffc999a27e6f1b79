// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/scene/light_table.h"

#include <cmath>
#include <string>
#include <type_traits>

#include "wavecomb/core/error.h"
#include "wavecomb/scene/scene_checks.h"

namespace wavecomb {
namespace {

constexpr uint32_t kNone = 0xffffffffu;
static_assert(kNoTexture == kNone && kNoIes == kNone && kNoSet == kNone);

constexpr const char* kKindNames[kLightKindCount] = {"rect",    "disk", "sphere",  "cylinder",
                                                     "distant", "dome", "triangle"};

template <typename... Kind>
constexpr uint32_t kinds(Kind... of) {
  return ((1u << static_cast<uint32_t>(of)) | ...);
}
constexpr uint32_t kAll = (1u << kLightKindCount) - 1;
constexpr uint32_t kPlaced = kAll & ~kinds(LightKind::kTriangle);
constexpr uint32_t kSized = kAll & ~kinds(LightKind::kDome), kShaped = kSized;
constexpr uint32_t kSeen = kAll & ~kinds(LightKind::kDistant, LightKind::kDome);

/// A member of a light, or a member of a member.
template <auto kFirst, auto... kRest, typename Object>
auto& member(Object& object) {
  if constexpr (sizeof...(kRest) == 0)
    return object.*kFirst;
  else
    return member<kRest...>(object.*kFirst);
}
template <auto... kPath>
using MemberType = std::remove_reference_t<decltype(member<kPath...>(std::declval<Light&>()))>;

template <auto... kPath>
LightValue read(const Light& light) {
  const auto& value = member<kPath...>(light);
  using T = MemberType<kPath...>;
  if constexpr (std::is_enum_v<T>)
    return static_cast<uint32_t>(value);
  else if constexpr (std::is_same_v<T, uint32_t>)
    return value == kNone ? LightValue() : LightValue(value);
  else
    return value;
}

template <auto... kPath>
void write(Light& light, const LightValue& value) {
  auto& to = member<kPath...>(light);
  using T = MemberType<kPath...>;
  if constexpr (std::is_enum_v<T>)
    to = static_cast<T>(std::get<uint32_t>(value));
  else if constexpr (std::is_same_v<T, uint32_t>)
    to = std::holds_alternative<std::monostate>(value) ? kNone : std::get<uint32_t>(value);
  else
    to = std::get<T>(value);
}

template <typename T>
constexpr LightValueKind kValueKind = std::is_same_v<T, float>         ? LightValueKind::kNumber
                                      : std::is_same_v<T, Vec3<float>> ? LightValueKind::kColour
                                      : std::is_same_v<T, bool>        ? LightValueKind::kFlag
                                      : std::is_same_v<T, uint32_t>    ? LightValueKind::kId
                                      : std::is_enum_v<T> ? LightValueKind::kChoice
                                                          : LightValueKind::kTransforms;

/// A row without limits.
template <auto... kPath>
LightParameter row(const char* name, const char* label, const char* input, const char* help) {
  LightParameter p;
  p.name = name;
  p.label = label;
  p.help = help;
  p.input = input;
  p.kind = kValueKind<MemberType<kPath...>>;
  p.read = &read<kPath...>;
  p.write = &write<kPath...>;
  return p;
}

/// Of 0 or more.
LightParameter positive(LightParameter p, double usual) {
  p.least = 0;
  p.usual = usual;
  return p;
}
LightParameter usually(LightParameter p, double usual) {
  p.usual = usual;
  return p;
}
LightParameter id(LightParameter p, LightRefers refers) {
  p.refers = refers;
  return p;
}
LightParameter in(LightGroup group, uint32_t kinds, LightParameter p) {
  p.group = group;
  p.kinds = kinds;
  return p;
}
LightParameter choice(LightParameter p, std::vector<const char*> choices) {
  p.choices = std::move(choices);
  return p;
}

std::vector<LightParameter> make_table() {
  using L = Light;
  using S = Shaping;
  using enum LightGroup;
  using enum LightKind;
  constexpr auto kS = &L::shaping;
  return {
      in(kEmission, kAll,
         positive(row<&L::color>("color", "colour", "color",
                                 "Emitted radiance, W / (m^2 sr): colour * intensity * "
                                 "2^exposure * colour temperature."),
                  1)),
      in(kShape, kinds(kRect),
         positive(row<&L::width>("width", "width", "width", "Along x, in its own units."), 10)),
      in(kShape, kinds(kRect),
         positive(row<&L::height>("height", "height", "height", "Along y, in its own units."), 10)),
      in(kShape, kinds(kDisk, kSphere, kCylinder),
         positive(row<&L::radius>("radius", "radius", "radius",
                                  "In its own units; a sphere of radius 0 is a point."),
                  10)),
      in(kShape, kinds(kCylinder),
         positive(row<&L::length>("length", "length", "length", "Along x, in its own units."), 10)),
      in(kShape, kinds(kDistant),
         positive(row<&L::angle>("angle", "angle", "angle",
                                 "Apparent diameter in degrees; 0: a single direction."),
                  10)),
      in(kEmission, kSized,
         row<&L::normalize>("normalize", "normalize", "normalize",
                            "Divides by the area in world space; of a distant light, by UsdLux's "
                            "sizeFactor.")),
      in(kEmission, kinds(kRect, kDome),
         id(row<&L::texture>("texture", "texture", "texture:file",
                             "What its colour is multiplied by: on a rect with u to the right and "
                             "v up as seen from the front, on a dome latlong."),
            LightRefers::kTexture)),
      in(kEmission, kPlaced,
         id(row<&L::group>("group", "group", "", "Name of its light group, for AOVs."),
            LightRefers::kGroup)),
      in(kResponse, kAll,
         positive(row<&L::diffuse>("diffuse", "diffuse", "diffuse",
                                   "Multiplies what it gives to the diffuse response of "
                                   "materials."),
                  2)),
      in(kResponse, kAll,
         positive(row<&L::specular>("specular", "specular", "specular",
                                    "Multiplies what it gives to the specular response of "
                                    "materials."),
                  2)),
      in(kShaping, kShaped,
         usually(row<kS, &S::focus>("focus", "focus", "shaping:focus",
                                    "Exponent of the cosine off the axis, -z; 0 or less: none."),
                 50)),
      in(kShaping, kShaped,
         row<kS, &S::focus_tint>("focus_tint", "focus tint", "shaping:focusTint",
                                 "What is left off the axis where there is a focus.")),
      in(kShaping, kShaped,
         usually(row<kS, &S::cone_angle>("cone_angle", "cone angle", "shaping:cone:angle",
                                         "Degrees off the axis where light ends; 180 or more: no "
                                         "cone."),
                 180)),
      in(kShaping, kShaped,
         row<kS, &S::cone_softness>("cone_softness", "cone softness", "shaping:cone:softness",
                                    "Share of the cone over which light falls to 0.")),
      in(kShaping, kShaped,
         id(row<kS, &S::ies>("ies", "IES profile", "shaping:ies:file",
                             "Profile that multiplies its radiance, of add_ies."),
            LightRefers::kProfile)),
      in(kShaping, kShaped,
         row<kS, &S::ies_angle_scale>("ies_angle_scale", "IES angle scale",
                                      "shaping:ies:angleScale",
                                      "Scales the profile's vertical angles as UsdLux says; 0: "
                                      "none.")),
      in(kShaping, kShaped,
         row<kS, &S::ies_normalize>("ies_normalize", "IES normalize", "shaping:ies:normalize",
                                    "Divides the profile by its mean over directions.")),
      in(kResponse, kAll,
         id(row<&L::light_link>("light_link", "light link", "",
                                "Set of geometry that it shines on; none: all."),
            LightRefers::kSet)),
      in(kResponse, kAll,
         id(row<&L::shadow_link>("shadow_link", "shadow link", "",
                                 "Set of geometry that casts shadows in its light; none: all."),
            LightRefers::kSet)),
      in(kShape, kSeen, row<&L::visible>("visible", "visible", "", "Whether rays meet its shape.")),
      in(kShape, kinds(kDome),
         row<&L::portals>("portals", "portals", "",
                          "Maps of the unit square in the xy plane to rectangles that guide its "
                          "sampling of what is on their -z side: (k, 4, 4).")),
      in(kEmission, kinds(kTriangle),
         choice(row<&L::sync>("material_sync", "material sync", "",
                              "How its light goes with the glow of the mesh's material."),
                {"materialGlowTintsLight", "independent", "noMaterialResponse"})),
  };
}

std::string limits(const LightParameter& p) {
  if (std::isfinite(p.least) && std::isfinite(p.most))
    return "from " + text(p.least) + " to " + text(p.most);
  if (std::isfinite(p.least)) return text(p.least) + " or more";
  return std::isfinite(p.most) ? text(p.most) + " or less" : "a finite number";
}

bool in_range(const LightParameter& p, float v) {
  return std::isfinite(v) && double{v} >= p.least && double{v} <= p.most;
}

const char* referred(LightRefers refers) {
  constexpr const char* kWhat[] = {"", "texture", "profile", "set", "group"};
  return kWhat[static_cast<size_t>(refers)];
}

void check_value(const std::string& of, const LightParameter& p, const LightValue& value,
                 const LightReferences& there) {
  if (const auto* number = std::get_if<float>(&value); number && !in_range(p, *number))
    throw Error(of + p.name + " is " + text(double{*number}) + "; it must be " + limits(p));
  if (const auto* c = std::get_if<Vec3<float>>(&value))
    if (!in_range(p, c->x) || !in_range(p, c->y) || !in_range(p, c->z))
      throw Error(of + p.name + " is (" + text(double{c->x}) + ", " + text(double{c->y}) + ", " +
                  text(double{c->z}) + "); each must be " + limits(p));
  if (const auto* maps = std::get_if<std::vector<Affine>>(&value))
    for (const Affine& map : *maps)
      if (!finite(map)) throw Error(of + "a transform of " + p.name + " is not finite; mend it");
  const auto* number = std::get_if<uint32_t>(&value);
  const size_t counts[] = {kNone, there.textures, there.profiles, there.sets, kNone};
  if (!number || *number < counts[static_cast<size_t>(p.refers)]) return;
  const std::string what = referred(p.refers);
  throw Error(of + p.name + " is " + what + " " + std::to_string(*number) +
              ", which was never added; add " + what + "s before lights");
}

void check(const Light& light, const LightReferences& there) {
  const std::string of = quoted("light", light.name) + ": ";
  if (!finite(light.to_world)) throw Error(of + "its transform is not finite; mend it");
  for (const LightParameter& p : light_table()) check_value(of, p, p.read(light), there);
}

}  // namespace

std::span<const LightParameter> light_table() {
  static const std::vector<LightParameter> table = make_table();
  return table;
}

const LightParameter* find_light_parameter(std::string_view name) {
  for (const LightParameter& p : light_table())
    if (name == p.name) return &p;
  return nullptr;
}

const char* light_kind_name(LightKind kind) {
  return kKindNames[static_cast<size_t>(kind)];
}

LightKind light_kind(std::string_view name) {
  std::string known;
  for (uint32_t k = 0; k < static_cast<uint32_t>(LightKind::kTriangle); ++k) {
    if (name == kKindNames[k]) return static_cast<LightKind>(k);
    known += (known.empty() ? "" : ", ") + std::string(kKindNames[k]);
  }
  throw Error("light kind is '" + std::string(name) + "'; it must be one of " + known);
}

void check_light(const Light& light, const LightReferences& there) {
  if (static_cast<uint32_t>(light.kind) >= static_cast<uint32_t>(LightKind::kTriangle))
    throw Error(quoted("light", light.name) + ": its kind has no place of its own");
  check(light, there);
}

void check_mesh_light(const Light& light, const LightReferences& there) {
  if (light.kind != LightKind::kTriangle)
    throw Error(quoted("light", light.name) + ": it is no light of meshes");
  check(light, there);
}

}  // namespace wavecomb
