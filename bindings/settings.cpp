// SPDX-License-Identifier: Apache-2.0
/// Python class Settings, with an attribute for each row of setting_table() and the attributes
/// `aovs` and `region`.
#include "settings.h"

#include <nanobind/stl/optional.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include <string>
#include <type_traits>
#include <variant>
#include <vector>

#include "bind.h"
#include "wavecomb/core/aov.h"
#include "wavecomb/core/error.h"
#include "wavecomb/core/settings_table.h"
#include "wavecomb/schedule/policy.h"

namespace nb = nanobind;
using namespace wavecomb;

namespace {

/// Prefix of light group names in AOV and layer names.
constexpr const char* kLightPrefix = "light_";
/// Prefix of light path expressions, which are written as "lpe:NAME=EXPRESSION".
constexpr const char* kExpressionPrefix = "lpe:";

/// Returns the names that select the AOVs, light groups and light path expressions of `settings`.
std::vector<std::string> aov_names(const Settings& s) {
  std::vector<std::string> names = s.aovs.names();
  if (!s.light_groups.empty()) std::erase(names, "light_groups");
  for (const std::string& group : s.light_groups) names.push_back(kLightPrefix + group);
  for (const NamedExpression& one : s.expressions)
    names.push_back(kExpressionPrefix + one.name + "=" + one.text);
  return names;
}

/// Parses a light path expression of the form "lpe:NAME=EXPRESSION".
NamedExpression to_expression(const std::string& aov) {
  const std::string rest = aov.substr(std::string(kExpressionPrefix).size());
  const size_t equals = rest.find('=');
  if (equals == std::string::npos)
    throw Error("AOV '" + aov + "' has no expression; write lpe:NAME=EXPRESSION");
  return {rest.substr(0, equals), rest.substr(equals + 1)};
}

/// Sets the AOVs by name. The name "light_groups" selects all light groups, and "light_NAME" the
/// light group NAME.
void set_aovs(Settings& s, const std::vector<std::string>& names) {
  AovSet set{0};
  std::vector<std::string> groups;
  std::vector<NamedExpression> expressions;
  bool all_groups = false;
  for (const std::string& name : names) {
    if (name != "light_groups" && name.starts_with(kLightPrefix)) {
      groups.push_back(name.substr(std::string(kLightPrefix).size()));
      set.bits |= static_cast<uint32_t>(Aov::kLightGroups);
    } else if (name.starts_with(kExpressionPrefix)) {
      expressions.push_back(to_expression(name));
      set.bits |= static_cast<uint32_t>(Aov::kExpressions);
    } else {
      const Aov aov = AovSet::parse(name);
      all_groups |= aov == Aov::kLightGroups;
      set.bits |= static_cast<uint32_t>(aov);
    }
  }
  s.aovs = set;
  s.light_groups = all_groups ? std::vector<std::string>{} : groups;
  s.expressions = std::move(expressions);
}

/// Returns None or (x0, y0, x1, y1).
nb::object region_of(const Settings& s) {
  if (!s.region) return nb::none();
  return nb::make_tuple(s.region->x0, s.region->y0, s.region->x1, s.region->y1);
}

void set_region(Settings& s, const nb::object& value) {
  s.region.reset();
  if (value.is_none()) return;
  std::vector<int64_t> edges;
  if (!nb::try_cast(value, edges) || edges.size() != 4)
    throw Error("region must be None or four whole numbers: x0, y0, x1, y1");
  for (const int64_t edge : edges)
    if (edge < 0 || edge > kMaxSize)
      throw Error("region has the edge " + std::to_string(edge) + "; it must be from 0 to " +
                  std::to_string(kMaxSize));
  const auto at = [&](size_t i) { return static_cast<uint32_t>(edges[i]); };
  s.region = Region{at(0), at(1), at(2), at(3)};
}

nb::object to_python(const SettingValue& value) {
  return std::visit(
      [](const auto& v) -> nb::object {
        if constexpr (std::is_same_v<std::decay_t<decltype(v)>, std::monostate>)
          return nb::none();
        else
          return nb::cast(v);
      },
      value);
}

/// Converts a value from Python, including NumPy scalars.
SettingValue from_python(const SettingInfo& setting, nb::handle value) {
  if (value.is_none()) return {};
  if (nb::isinstance<nb::bool_>(value)) return nb::cast<bool>(value);
  if (nb::isinstance<nb::str>(value)) return nb::cast<std::string>(value);
  if (int64_t whole = 0; PyIndex_Check(value.ptr()) && nb::try_cast(value, whole)) return whole;
  if (double real = 0; nb::try_cast(value, real)) return real;
  throw Error(std::string(setting.name) + " cannot be a " +
              nb::cast<std::string>(value.type().attr("__name__")));
}

/// Python names of the values of `SettingGroup`.
constexpr const char* kGroups[] = {"picture", "work", "order"};

/// Converts a row of setting_table() to the dict that the Python module wavecomb.options reads.
nb::dict row_dict(const SettingInfo& setting) {
  const SettingValue value = setting.get(Settings{});
  const char* kind = !setting.choices.empty()                     ? "choice"
                     : std::holds_alternative<bool>(value)        ? "flag"
                     : std::holds_alternative<int64_t>(value)     ? "integer"
                     : std::holds_alternative<std::string>(value) ? "text"
                                                                  : "number";
  nb::dict d, choices;
  for (const SettingChoice& one : setting.choices) choices[one.name.c_str()] = one.help;
  if (setting.name == std::string_view("policy")) {
    kind = "choice";
    for (const PolicyInfo& one : policy_table()) choices[one.name] = one.help;
  }
  d["name"] = setting.name;
  d["label"] = setting.label;
  d["help"] = setting.help;
  d["kind"] = kind;
  d["default"] = setting.may_be_none ? nb::none() : to_python(value);
  d["least"] = setting.least <= setting.most ? nb::cast(setting.least) : nb::none();
  d["most"] = setting.least <= setting.most ? nb::cast(setting.most) : nb::none();
  d["zero"] = setting.zero;
  d["steps"] = nb::tuple(nb::cast(setting.steps));
  d["choices"] = choices;
  d["group"] = kGroups[static_cast<size_t>(setting.group)];
  d["changes_picture"] = setting.changes_image;
  d["changes_bits"] = setting.changes_bits;
  d["changes_expectation"] = setting.changes_expectation;
  return d;
}

}  // namespace

nb::dict settings_dict(const Settings& settings) {
  nb::dict d;
  for (const SettingInfo& setting : setting_table())
    d[setting.name] = to_python(setting.get(settings));
  d["aovs"] = aov_names(settings);
  d["region"] = region_of(settings);
  return d;
}

void bind_settings(nb::module_& m) {
  nb::class_<Settings> c(m, "Settings");
  c.def("__init__",
        [](nb::handle_t<Settings> self, const nb::kwargs& kwargs) {
          new (nb::inst_ptr<Settings>(self)) Settings();
          nb::inst_mark_ready(self);
          for (const auto& [key, value] : kwargs) {
            const auto name = nb::cast<std::string>(key);
            if (name != "aovs" && name != "region" && !find_setting(name))
              throw Error("setting '" + name + "' is not known");
            nb::setattr(self, name.c_str(), value);
          }
        })
      .def_prop_rw("region", &region_of, &set_region, nb::for_setter(nb::arg("region").none()))
      .def_prop_rw("aovs", &aov_names, &set_aovs)
      .def("check", &Settings::check)
      .def("to_dict", &settings_dict);
  for (const SettingInfo& setting : setting_table())
    c.def_prop_rw(
        setting.name, [&setting](const Settings& s) { return to_python(setting.get(s)); },
        [&setting](Settings& s, const nb::object& value) {
          setting.set(s, from_python(setting, value));
        },
        nb::for_setter(nb::arg("value").none()));
  m.def("setting_table", [] {
    nb::list rows;
    for (const SettingInfo& setting : setting_table()) rows.append(row_dict(setting));
    return rows;
  });
}
