// SPDX-License-Identifier: Apache-2.0
#include "lights.h"

#include <nanobind/stl/array.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include <array>
#include <cmath>
#include <type_traits>
#include <variant>

#include "bind.h"
#include "scene_values.h"
#include "wavecomb/core/error.h"
#include "wavecomb/light/description/kind_info.h"
#include "wavecomb/scene/scene_checks.h"

namespace nb = nanobind;
using namespace wavecomb;

namespace {

// Python names of the values of `LightValueKind` and `LightGroup`.
constexpr const char* kValueKinds[] = {"number", "colour", "flag", "choice", "id", "transforms"};
constexpr const char* kGroups[] = {"emission", "shape", "shaping", "response"};

std::string prefix(const Light& light) {
  return quoted("light", light.name) + ": ";
}

[[noreturn]] void fail(const Light& light, const char* name, const std::string& wanted) {
  throw Error(prefix(light) + name + " must be " + wanted);
}

LightValue choice_of(const Light& light, const LightParameter& p, nb::handle value) {
  if (const auto chosen = index_in(p.choices, value)) return *chosen;
  fail(light, p.name, "one of " + listed(p.choices));
}

std::vector<Affine> transforms_of(const Light& light, const LightParameter& p, nb::handle value) {
  nb::ndarray<const double, nb::shape<-1, 4, 4>, nb::c_contig, nb::device::cpu> maps;
  if (!nb::try_cast(value, maps)) fail(light, p.name, "an array (k, 4, 4) of float64");
  std::vector<Affine> out;
  for (size_t i = 0; i < maps.shape(0); ++i) out.push_back(affine(maps.data() + 16 * i));
  return out;
}

LightValue id_of(const Light& light, const LightParameter& p, nb::handle value,
                 SceneBuilder* builder) {
  if (p.refers == LightRefers::kGroup) {
    std::string group;
    if (!builder || !nb::try_cast(value, group)) fail(light, p.name, "a name");
    return builder->light_group(group);
  }
  uint32_t id = 0;
  if (value.is_none()) return {};
  if (!nb::try_cast(value, id)) fail(light, p.name, "a whole number of 0 or more, or None");
  return id;
}

/// Converts the value of a light parameter from Python. `builder` converts names of light groups to
/// ids and may be null.
LightValue from_python(const Light& light, const LightParameter& p, nb::handle value,
                       SceneBuilder* builder) {
  float number = 0;
  std::array<float, 3> colour;
  switch (p.kind) {
    case LightValueKind::kNumber:
      if (!nb::try_cast(value, number)) fail(light, p.name, "a number");
      return number;
    case LightValueKind::kColour:
      if (!nb::try_cast(value, colour)) fail(light, p.name, "3 numbers");
      return Vec3<float>{colour[0], colour[1], colour[2]};
    case LightValueKind::kFlag: {
      bool flag = false;
      if (!nb::try_cast(value, flag)) fail(light, p.name, "True or False");
      return flag;
    }
    case LightValueKind::kChoice:
      return choice_of(light, p, value);
    case LightValueKind::kId:
      return id_of(light, p, value, builder);
    case LightValueKind::kTransforms:
      break;
  }
  if (value.is_none()) return std::vector<Affine>();
  return transforms_of(light, p, value);
}

nb::object to_python(const LightParameter& p, const LightValue& value) {
  if (p.kind == LightValueKind::kChoice) return nb::str(p.choices[std::get<uint32_t>(value)]);
  return std::visit(
      [](const auto& v) -> nb::object {
        using T = std::decay_t<decltype(v)>;
        if constexpr (std::is_same_v<T, std::monostate> || std::is_same_v<T, std::vector<Affine>>)
          return nb::none();
        else if constexpr (std::is_same_v<T, Vec3<float>>)
          return nb::make_tuple(v.x, v.y, v.z);
        else
          return nb::cast(v);
      },
      value);
}

/// Returns a list of the light parameters for which `is_known` returns true, as text for error
/// messages.
template <typename Known>
std::string names(const Known& is_known) {
  std::string list;
  for (const LightParameter& p : light_table())
    if (is_known(p)) list += (list.empty() ? "'" : ", '") + std::string(p.name) + "'";
  return list;
}

/// Sets the parameters of a light, whose kind must be set, from keyword arguments.
void take(Light& light, SceneBuilder& builder, const nb::kwargs& values) {
  const bool of_mesh = light.kind == kMeshLight;
  // A light with a transform also accepts parameters that it does not use, for callers that pass
  // the same parameters to lights of several kinds. It rejects parameters that are marked as
  // specific to another kind of light.
  const auto is_known = [&](const LightParameter& p) {
    return p.kind != LightValueKind::kChoice &&
           ((!of_mesh && !p.is_specific) || p.is_of(light.kind));
  };
  if (values.contains("name") && !nb::try_cast(values["name"], light.name))
    throw Error("the name of a light must be a text");
  for (const auto& [key, value] : values) {
    const auto name = nb::cast<std::string>(key);
    if (name == "name") continue;
    const LightParameter* const p = find_light_parameter(name);
    if (!p || !is_known(*p))
      throw Error(prefix(light) + "there is no parameter '" + name + "'; there are 'name', " +
                  names(is_known));
    p->write(light, from_python(light, *p, value, &builder));
  }
}

nb::dict row_dict(const LightParameter& p) {
  nb::dict d;
  nb::list kinds, choices;
  for (uint32_t k = 0; k < light_kinds().size(); ++k)
    if (p.is_of(static_cast<LightKind>(k)))
      kinds.append(light_kind_name(static_cast<LightKind>(k)));
  for (const char* one : p.choices) choices.append(one);
  d["name"] = p.name;
  d["label"] = p.label;
  d["help"] = p.help;
  d["input"] = p.input;
  d["group"] = kGroups[static_cast<size_t>(p.group)];
  d["kind"] = kValueKinds[static_cast<size_t>(p.kind)];
  d["refers"] = light_refers_name(p.refers);
  d["least"] = std::isfinite(p.least) ? nb::cast(p.least) : nb::none();
  d["most"] = std::isfinite(p.most) ? nb::cast(p.most) : nb::none();
  d["usual"] = p.slider_max;
  d["choices"] = nb::tuple(choices);
  d["kinds"] = nb::tuple(kinds);
  d["default"] =
      p.refers == LightRefers::kGroup ? nb::object(nb::str("")) : to_python(p, p.standard());
  return d;
}

}  // namespace

uint32_t add_light(SceneBuilder& builder, const std::string& kind, const Transform& transform,
                   const nb::kwargs& values) {
  Light light;
  light.kind = light_kind(kind);
  light.to_world = affine(transform);
  take(light, builder, values);
  return builder.add_light(std::move(light));
}

uint32_t add_mesh_light(SceneBuilder& builder, const Transform& transform,
                        const std::string& material_sync, const nb::kwargs& values) {
  Light light;
  light.kind = kMeshLight;
  light.to_world = affine(transform);
  take(light, builder, values);
  const LightParameter& sync = *find_light_parameter("material_sync");
  sync.write(light, choice_of(light, sync, nb::cast(material_sync)));
  return builder.add_mesh_light(std::move(light));
}

uint32_t add_light_filter(SceneBuilder& builder, const Transform& transform, float distance,
                          const std::array<std::array<float, 3>, 4>& sides,
                          const std::array<float, 3>& picture_u,
                          const std::array<float, 3>& picture_v, std::optional<uint32_t> texture,
                          const std::array<float, 4>& decay, float density,
                          std::optional<uint32_t> next) {
  const auto line = [](const std::array<float, 3>& l) { return Vec3<float>{l[0], l[1], l[2]}; };
  LightFilter filter;
  filter.to_world = affine(transform);
  filter.distance = distance;
  for (size_t i = 0; i < sides.size(); ++i) filter.sides[i] = line(sides[i]);
  filter.picture_u = line(picture_u);
  filter.picture_v = line(picture_v);
  filter.texture = texture.value_or(kNoTexture);
  filter.near_start = decay[0];
  filter.near_end = decay[1];
  filter.far_start = decay[2];
  filter.far_end = decay[3];
  filter.density = density;
  filter.next = next.value_or(kNoFilter);
  return builder.add_light_filter(filter);
}

nb::dict light_dict(const Scene& scene, uint32_t light) {
  check_index("light", light, scene.lights().size());
  const Light& l = scene.lights()[light];
  nb::dict d;
  d["name"] = l.name;
  d["kind"] = light_kind_name(l.kind);
  d["transform"] = matrix(l.to_world);
  for (const LightParameter& p : light_table()) {
    if (p.refers == LightRefers::kGroup)
      d[p.name] = scene.light_groups()[l.group];
    else if (p.refers == LightRefers::kTexture)
      d[p.name] =
          l.texture == kNoTexture ? nb::none() : nb::cast(scene.textures()[l.texture]->name());
    else if (p.is_specific ? p.is_of(l.kind) && p.can_change()
                           : p.can_change() || p.refers == LightRefers::kProfile)
      d[p.name] = to_python(p, p.read(l));
  }
  return d;
}

Light edited_light(const Scene& scene, uint32_t light, const nb::dict& values) {
  check_index("light", light, scene.lights().size());
  Light changed = scene.lights()[light];
  const auto can_change = [&](const LightParameter& p) {
    return p.can_change() && (!p.is_specific || p.is_of(changed.kind));
  };
  for (const auto& [key, value] : values) {
    const auto name = nb::cast<std::string>(nb::str(key));
    const LightParameter* const p = find_light_parameter(name);
    if (name == "transform")
      changed.to_world = matrix_of(prefix(changed) + name, value);
    else if (p && can_change(*p))
      p->write(changed, from_python(changed, *p, value, nullptr));
    else
      throw Error(quoted("light", changed.name) + " has no parameter '" + name +
                  "' that can be changed; there are 'transform', " + names(can_change));
  }
  return changed;
}

void bind_lights(nb::module_& m) {
  m.def("light_table", [] {
    nb::list rows;
    for (const LightParameter& p : light_table()) rows.append(row_dict(p));
    return rows;
  });
  m.def("light_kinds", [] {
    nb::list kinds;
    for (const LightKindInfo& kind : light_kinds()) {
      nb::list prims;
      for (const char* prim : kind.prims) prims.append(prim);
      kinds.append(nb::make_tuple(kind.name, nb::tuple(prims)));
    }
    return kinds;
  });
}
