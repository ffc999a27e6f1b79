// SPDX-License-Identifier: Apache-2.0
/// Table of the settings of a render, with one row for each member of `Settings`. Wavecomb derives
/// checks, Python attributes and keywords, command line options, form fields and checkpoint headers
/// from the table. To add a setting, add a member to `Settings`, a row to settings_table.cpp, and
/// the code that uses the member.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "wavecomb/core/settings.h"

namespace wavecomb {

/// Value of a setting as callers pass it. If the setting has a list of choices, the value is the
/// name of a choice. The value None (`std::monostate`) selects a default that depends on other
/// settings.
using SettingValue = std::variant<std::monostate, bool, int64_t, double, std::string>;

/// One of the allowed values of a setting that has a list of choices.
struct SettingChoice {
  std::string name;
  const char* help;  ///< one sentence
};

/// Groups of settings: settings that define the image, the amount of work, or the order of
/// computation.
enum class SettingGroup : uint8_t { kImage, kWork, kOrder };

/// Row of the settings table.
///
/// Contract: a row exists as long as the program runs.
struct SettingInfo {
  const char* name =
      "";  ///< name of the Python attribute; the command line option has - in place of _
  const char* label = "";  ///< label in a form
  const char* help = "";   ///< one sentence
  /// Whether the image depends on the setting. If not, the setting affects only the computation of
  /// the image, such as the number of threads.
  bool changes_image = true;
  /// Whether the setting changes the bits of the beauty image if each pixel has the same sample
  /// count.
  bool changes_bits = true;
  /// Whether the setting changes the expected value of the image, that is, its limit for many
  /// samples. Settings without this flag change only noise, the amount of work, or layers that show
  /// noise or work.
  bool changes_expectation = false;
  SettingGroup group = SettingGroup::kImage;
  /// Smallest and largest allowed number. There are no limits if `least` exceeds `most`.
  double least = 0, most = -1;
  const char* zero = "";  ///< meaning of the value 0, if it is special
  /// Allowed values besides 0; an empty list allows all values.
  std::vector<double> steps;
  std::vector<SettingChoice> choices;  ///< names of the choices in the order of the enum

  /// Whether the value None is allowed, which selects a default that depends on other settings.
  bool may_be_none = false;

  SettingValue (*read)(const Settings&) = nullptr;
  void (*write)(Settings&, const SettingValue&) = nullptr;

  SettingValue get(const Settings& settings) const;
  /// Sets the member in `settings`. Throws `Error` if the value has a wrong type or is not one of
  /// the choices.
  void set(Settings& settings, const SettingValue& value) const;
  /// Throws an `Error` that names the setting if its value in `settings` is out of range.
  void check(const Settings& settings) const;
};

/// Returns the rows of all settings in the order of `Settings`, except `aovs` and `region`, which
/// are not single values.
std::span<const SettingInfo> setting_table();
/// Returns the row of a setting, or null if the name is unknown.
const SettingInfo* find_setting(std::string_view name);

}  // namespace wavecomb
