// SPDX-License-Identifier: Apache-2.0
/// Functions that convert and check the value of a setting.
#include <algorithm>

#include "wavecomb/core/encoding/number_text.h"
#include "wavecomb/core/error.h"
#include "wavecomb/core/settings_table.h"

namespace wavecomb {

SettingValue SettingInfo::get(const Settings& settings) const {
  const SettingValue value = read(settings);
  if (choices.empty()) return value;
  const size_t index = std::holds_alternative<bool>(value)
                           ? static_cast<size_t>(std::get<bool>(value))
                           : static_cast<size_t>(std::get<int64_t>(value));
  return choices[index].name;
}

void SettingInfo::set(Settings& settings, const SettingValue& value) const {
  const SettingValue now = read(settings);
  const auto wrong = [&](const std::string& must) { return Error(std::string(name) + " " + must); };
  if (std::holds_alternative<std::monostate>(value)) {
    if (may_be_none) return write(settings, value);
    throw wrong("must not be None");
  }
  if (!choices.empty()) {
    const auto* chosen = std::get_if<std::string>(&value);
    std::string list;
    for (size_t i = 0; i < choices.size(); ++i) {
      if (chosen && *chosen == choices[i].name) {
        if (std::holds_alternative<bool>(now))
          write(settings, i != 0);
        else
          write(settings, static_cast<int64_t>(i));
        return;
      }
      list += (list.empty() ? "" : ", ") + choices[i].name;
    }
    throw wrong((chosen ? "is '" + *chosen + "'; it " : std::string()) + "must be one of " + list);
  }
  if (std::holds_alternative<double>(now)) {
    if (const auto* whole = std::get_if<int64_t>(&value))
      return write(settings, static_cast<double>(*whole));
    if (!std::holds_alternative<double>(value)) throw wrong("must be a number");
  } else if (std::holds_alternative<int64_t>(now)) {
    const auto* whole = std::get_if<int64_t>(&value);
    if (!whole) throw wrong("must be a whole number");
    if (*whole < 0 || *whole > int64_t{0xffffffff})
      throw wrong("is " + std::to_string(*whole) + "; it must be from 0 to 4294967295");
  } else if (now.index() != value.index()) {
    throw wrong(std::holds_alternative<bool>(now) ? "must be True or False" : "must be a text");
  }
  write(settings, value);
}

void SettingInfo::check(const Settings& settings) const {
  const SettingValue value = read(settings);
  double v = 0;
  if (const auto* whole = std::get_if<int64_t>(&value))
    v = static_cast<double>(*whole);
  else if (const auto* real = std::get_if<double>(&value))
    v = *real;
  else
    return;
  if (!choices.empty() || (v == 0 && *zero != 0)) return;
  if (!steps.empty()) {
    if (std::find(steps.begin(), steps.end(), v) != steps.end()) return;
    std::string list;
    for (const double step : steps) list += (list.empty() ? "" : ", ") + text(step);
    throw Error(std::string(name) + " is " + text(v) + "; it must be " + list + " or " + zero +
                " (0)");
  }
  if (least > most || (v >= least && v <= most)) return;
  throw Error(std::string(name) + " is " + text(v) + "; it must be from " + text(least) + " to " +
              text(most));
}

}  // namespace wavecomb
