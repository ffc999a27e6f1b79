// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/light/description/light_table.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <type_traits>

#include "wavecomb/core/encoding/number_text.h"
#include "wavecomb/core/error.h"
#include "wavecomb/geometry/mesh/motion.h"
#include "wavecomb/light/description/kind_info.h"
#include "wavecomb/scene/scene_checks.h"

namespace wavecomb {
namespace {

constexpr uint32_t kNone = 0xffffffffu;
static_assert(kNoTexture == kNone && kNoIes == kNone && kNoSet == kNone && kNoFilter == kNone);

/// Returns the member of a light to which a sequence of member pointers leads.
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

/// Makes the table row of a light parameter without limits.
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

/// Limits a light parameter to values of 0 or more.
LightParameter positive(LightParameter p, double slider_max) {
  p.least = 0;
  p.slider_max = slider_max;
  return p;
}
LightParameter with_slider_max(LightParameter p, double slider_max) {
  p.slider_max = slider_max;
  return p;
}
LightParameter id(LightParameter p, LightRefers refers) {
  p.refers = refers;
  return p;
}
LightParameter in(LightGroup group, LightParameter p) {
  p.group = group;
  return p;
}
/// The function `all` marks a table row as a parameter of all lights, and the function `with` as a
/// parameter of the lights with a trait. The function `in` makes rows for parameters of individual
/// light kinds, which list the names of these parameters.
LightParameter all(LightGroup group, LightParameter p) {
  p.is_common = true;
  return in(group, std::move(p));
}
LightParameter with(uint32_t trait, LightGroup group, LightParameter p) {
  p.trait = trait;
  return in(group, std::move(p));
}
LightParameter choice(LightParameter p, std::vector<const char*> choices) {
  p.choices = std::move(choices);
  p.is_specific = true;
  return p;
}

/// Returns the light parameters of shape and emission.
std::vector<LightParameter> shape_rows() {
  using L = Light;
  using enum LightGroup;
  using namespace light_trait;
  return {
      all(kEmission,
          positive(row<&L::color>("color", "colour", "color",
                                  "Emitted radiance of the light in W / (m^2 sr): colour * "
                                  "intensity * 2^exposure * colour of the temperature."),
                   1)),
      in(kShape, positive(row<&L::width>("width", "width", "width",
                                         "Size of the light along x, in local units."),
                          10)),
      in(kShape, positive(row<&L::height>("height", "height", "height",
                                          "Size of the light along y, in local units."),
                          10)),
      in(kShape, positive(row<&L::radius>("radius", "radius", "radius",
                                          "Radius of the light in local units; a sphere light of "
                                          "radius 0 is a point light."),
                          10)),
      in(kShape, positive(row<&L::length>("length", "length", "length",
                                          "Size of the light along x, in local units."),
                          10)),
      in(kShape, positive(row<&L::angle>("angle", "angle", "angle",
                                         "Apparent diameter of a distant light in degrees; 0 makes "
                                         "all its light parallel."),
                          10)),
      with(kSized, kEmission,
           row<&L::normalize>("normalize", "normalize", "normalize",
                              "Divides the light's radiance by its world-space area, or by "
                              "UsdLux's sizeFactor for a distant light.")),
      with(kTextured, kEmission,
           id(row<&L::texture>("texture", "texture", "texture:file",
                               "Texture that multiplies the light's colour; on a rect light, u "
                               "points right and v up, seen from the front; a dome uses latlong."),
              LightRefers::kTexture)),
      with(kHasTransform, kEmission,
           id(row<&L::group>("group", "group", "",
                             "Name of the light group whose AOV receives this light."),
              LightRefers::kGroup)),
      all(kResponse,
          positive(row<&L::diffuse>(
                       "diffuse", "diffuse", "diffuse",
                       "Scale of the light's contribution to the diffuse response of materials."),
                   2)),
      all(kResponse,
          positive(row<&L::specular>(
                       "specular", "specular", "specular",
                       "Scale of the light's contribution to the specular response of materials."),
                   2)),
  };
}

/// Returns the light parameters that define how emission depends on direction.
std::vector<LightParameter> shaping_rows() {
  using S = Shaping;
  using enum LightGroup;
  using namespace light_trait;
  constexpr auto kS = &Light::shaping;
  return {
      with(kShaped, kShaping,
           with_slider_max(row<kS, &S::focus>("focus", "focus", "shaping:focus",
                                              "Exponent of the cosine between emitted direction "
                                              "and light axis (-z); 0 or less means no focus."),
                           50)),
      with(kShaped, kShaping,
           row<kS, &S::focus_tint>("focus_tint", "focus tint", "shaping:focusTint",
                                   "Tint of the light that is emitted away from the light axis, if "
                                   "the focus is above 0.")),
      with(kShaped, kShaping,
           with_slider_max(
               row<kS, &S::cone_angle>("cone_angle", "cone angle", "shaping:cone:angle",
                                       "Angle from the light axis in degrees beyond which nothing "
                                       "is emitted; 180 or more means no cone."),
               180)),
      with(kShaped, kShaping,
           row<kS, &S::cone_softness>(
               "cone_softness", "cone softness", "shaping:cone:softness",
               "Outer fraction of the light's cone over which emission falls to 0.")),
      with(kShaped, kShaping,
           id(row<kS, &S::ies>(
                  "ies", "IES profile", "shaping:ies:file",
                  "IES profile, added with add_ies, that multiplies the light's radiance."),
              LightRefers::kProfile)),
      with(kShaped, kShaping,
           row<kS, &S::ies_angle_scale>("ies_angle_scale", "IES angle scale",
                                        "shaping:ies:angleScale",
                                        "Scale of the IES profile's vertical angles as defined by "
                                        "UsdLux; 0 means no scaling.")),
      with(kShaped, kShaping,
           row<kS, &S::ies_normalize>("ies_normalize", "IES normalize", "shaping:ies:normalize",
                                      "Divides the IES profile by its mean over all directions.")),
  };
}

/// Returns the light parameters of linking and shadows.
std::vector<LightParameter> shadow_rows() {
  using L = Light;
  using H = ShadowAttributes;
  using enum LightGroup;
  constexpr auto kH = &L::shadow;
  return {
      all(kResponse,
          id(row<&L::light_link>(
                 "light_link", "light link", "",
                 "Geometry set that the light illuminates; all geometry if none is given."),
             LightRefers::kSet)),
      all(kResponse,
          id(row<&L::shadow_link>(
                 "shadow_link", "shadow link", "",
                 "Geometry set that casts shadows from the light; all geometry if none is given."),
             LightRefers::kSet)),
      all(kResponse,
          positive(row<kH, &H::color>(
                       "shadow_color", "shadow colour", "shadow:color",
                       "Fraction of the light's radiance that still arrives in its shadows."),
                   1)),
      all(kResponse, with_slider_max(row<kH, &H::distance>(
                                         "shadow_distance", "shadow distance", "shadow:distance",
                                         "Maximum world-space distance from an occluder to the "
                                         "surface it shadows; less than 0 means no limit."),
                                     10)),
      all(kResponse, with_slider_max(row<kH, &H::falloff>(
                                         "shadow_falloff", "shadow falloff", "shadow:falloff",
                                         "World-space length over which shadows fade, ending at "
                                         "the shadow distance; 0 or less means no fade."),
                                     10)),
      all(kResponse,
          positive(row<kH, &H::gamma>("shadow_falloff_gamma", "shadow falloff gamma",
                                      "shadow:falloffGamma",
                                      "Exponent applied to the strength of fading shadows."),
                   4)),
  };
}

/// Returns the light parameters for filters, motion, portals and materials.
std::vector<LightParameter> other_rows() {
  using L = Light;
  using enum LightGroup;
  using namespace light_trait;
  return {
      with(kFiltered, kEmission,
           id(row<&L::filter>(
                  "filter", "filter", "",
                  "Light filter, added with add_light_filter, that modifies the light's emission."),
              LightRefers::kFilter)),
      with(kVisibleShape, kShape,
           row<&L::visible>("visible", "visible", "",
                            "Whether camera and bounce rays can hit the light's shape.")),
      with(kOwnShape, kShape,
           row<&L::visible_to_camera>(
               "visible_to_camera", "visible to camera", "",
               "Whether the camera sees the light's shape; if not, only mirrors and clear glass "
               "show it, and it blocks no other light.")),
      with(kHasTransform, kShape,
           row<&L::motion>("motion", "motion", "",
                           "Transforms of a moving light at k >= 2 equally spaced shutter times, "
                           "(k, 4, 4). The transform at mid-shutter defines the light's size.")),
      in(kShape,
         row<&L::portals>("portals", "portals", "",
                          "Transforms (k, 4, 4) from the unit square in the xy plane to k openings "
                          "towards which a dome is sampled. They transmit light towards -z.")),
      in(kEmission,
         choice(
             row<&L::sync>("material_sync", "material sync", "",
                           "How a mesh light combines with the emission of the mesh's material."),
             {"materialGlowTintsLight", "independent", "noMaterialResponse"})),
  };
}

std::vector<LightParameter> make_light_parameters() {
  std::vector<LightParameter> table;
  for (const auto& rows : {shape_rows(), shaping_rows(), shadow_rows(), other_rows()})
    table.insert(table.end(), rows.begin(), rows.end());
  const std::span<const LightKindInfo> kinds = light_kinds();
  for (const LightKindInfo& kind : kinds)
    table.insert(table.end(), kind.own.begin(), kind.own.end());
  for (LightParameter& p : table)
    for (size_t k = 0; k < kinds.size(); ++k) {
      const auto is_name = [&](const char* name) { return name == std::string_view(p.name); };
      const auto is_row = [&](const LightParameter& own) { return is_name(own.name); };
      const bool has = p.is_common || kinds[k].has(p.trait) ||
                       std::ranges::any_of(kinds[k].parameters, is_name) ||
                       std::ranges::any_of(kinds[k].own, is_row);
      p.kinds |= uint32_t{has} << k;
    }
  return table;
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

void check_value(const std::string& of, const LightParameter& p, const LightValue& value,
                 const LightReferences& references) {
  if (const auto* number = std::get_if<float>(&value); number && !in_range(p, *number))
    throw Error(of + p.name + " is " + text(double{*number}) + "; it must be " + limits(p));
  if (const auto* c = std::get_if<Vec3<float>>(&value))
    if (!in_range(p, c->x) || !in_range(p, c->y) || !in_range(p, c->z))
      throw Error(of + p.name + " is (" + text(double{c->x}) + ", " + text(double{c->y}) + ", " +
                  text(double{c->z}) + "); each must be " + limits(p));
  if (const auto* maps = std::get_if<std::vector<Affine>>(&value))
    for (const Affine& map : *maps)
      if (!finite(map))
        throw Error(of + "a transform of " + p.name + " is not finite; give finite numbers");
  const auto* number = std::get_if<uint32_t>(&value);
  const size_t counts[] = {kNone, references.textures, references.profiles, references.sets,
                           kNone, references.filters};
  if (!number || *number < counts[static_cast<size_t>(p.refers)]) return;
  const std::string what = light_refers_name(p.refers);
  throw Error(of + p.name + " is " + what + " " + std::to_string(*number) +
              ", which was never added; add " + what + "s before lights");
}

void check(const Light& light, const LightReferences& references) {
  const std::string of = quoted("light", light.name) + ": ";
  if (!finite(light.to_world)) throw Error(of + "its transform is not finite; give finite numbers");
  if (light.moves() && (light.motion.size() < 2 || light.motion.size() > kMaxSteps))
    throw Error(of + "motion has " + std::to_string(light.motion.size()) +
                " transforms; give from 2 to " + std::to_string(kMaxSteps) + ", or none");
  for (const LightParameter& p : light_table())
    if (!p.is_specific || p.is_of(light.kind)) check_value(of, p, p.read(light), references);
}

}  // namespace

std::span<const LightParameter> light_table() {
  static const std::vector<LightParameter> table = make_light_parameters();
  return table;
}

const LightParameter* find_light_parameter(std::string_view name) {
  for (const LightParameter& p : light_table())
    if (name == p.name) return &p;
  return nullptr;
}

const char* light_refers_name(LightRefers refers) {
  constexpr const char* kNames[] = {"", "texture", "profile", "set", "group", "filter"};
  return kNames[static_cast<size_t>(refers)];
}

const char* light_kind_name(LightKind kind) {
  return info_of(kind).name;
}

LightKind light_kind(std::string_view name) {
  const std::span<const LightKindInfo> kinds = light_kinds();
  std::string known;
  for (size_t k = 0; k < kinds.size(); ++k) {
    if (!kinds[k].has(light_trait::kHasTransform)) continue;
    if (name == kinds[k].name) return static_cast<LightKind>(k);
    known += (known.empty() ? "" : ", ") + std::string(kinds[k].name);
  }
  throw Error("light kind is '" + std::string(name) + "'; it must be one of " + known);
}

void check_light(const Light& light, const LightReferences& references) {
  const bool is_known = static_cast<size_t>(light.kind) < light_kinds().size();
  if (!is_known || !info_of(light.kind).has(light_trait::kHasTransform))
    throw Error(quoted("light", light.name) + ": lights of its kind have no transform");
  check(light, references);
}

void check_mesh_light(const Light& light, const LightReferences& references) {
  if (light.kind != kMeshLight)
    throw Error(quoted("light", light.name) + ": its kind is not a mesh light");
  check(light, references);
}

}  // namespace wavecomb
