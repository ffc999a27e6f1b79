// SPDX-License-Identifier: Apache-2.0
/// What a render can be told, as a table: a row for each member of Settings. Checks, Python's
/// attributes and keywords, options of the command line, fields of forms and the headers of
/// checkpoints follow from it. A new setting is a member of Settings, a row here, and its use.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "wavecomb/core/settings.h"

namespace wavecomb {

/// A value as callers see it; of a setting with choices, the name of one. None (monostate): the
/// default of a setting whose default follows from others.
using SettingValue = std::variant<std::monostate, bool, int64_t, double, std::string>;

struct SettingChoice {
  std::string name;
  const char* help;  ///< what it does, a sentence
};

/// What a setting is about: what the picture is, how much is done for it, or in which order.
enum class SettingGroup : uint8_t { kPicture, kWork, kOrder };

/// Contract: lives as long as the program.
struct SettingInfo {
  const char* name = "";   ///< of the attribute; options have - for _
  const char* label = "";  ///< in a form
  const char* help = "";   ///< a sentence
  /// Whether the picture depends on it; if not, it says how the picture is computed.
  bool changes_picture = true;
  /// Whether the picture that more and more samples tend to depends on it. Others change noise,
  /// work, or layers that say something about these.
  bool changes_expectation = false;
  SettingGroup group = SettingGroup::kPicture;
  double least = 0, most = -1;         ///< of numbers; least > most: any
  const char* zero = "";               ///< what 0 stands for, where it stands for something
  std::vector<double> steps;           ///< the values that there are, beside 0; empty: all
  std::vector<SettingChoice> choices;  ///< in the order of the enum's values

  bool may_be_none = false;  ///< then its default follows from others

  SettingValue (*read)(const Settings&) = nullptr;
  void (*write)(Settings&, const SettingValue&) = nullptr;

  SettingValue get(const Settings& settings) const;
  /// Throws Error where the value is of another kind, or none of the choices.
  void set(Settings& settings, const SettingValue& value) const;
  /// Throws Error, which names the setting, unless its value is in range.
  void check(const Settings& settings) const;
};

/// All settings but aovs and region, which are no single values, in the order of Settings.
std::span<const SettingInfo> setting_table();
/// Null where there is none.
const SettingInfo* find_setting(std::string_view name);

}  // namespace wavecomb
