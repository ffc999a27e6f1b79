// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/core/settings_table.h"

#include <gtest/gtest.h>

#include <set>
#include <string>

#include "wavecomb/core/error.h"
#include "wavecomb/schedule/policy.h"

namespace wavecomb {
namespace {

TEST(SettingsTable, ValuesComeBackAsTheyWereSet) {
  std::set<std::string> names;
  for (const SettingInfo& setting : setting_table()) {
    EXPECT_TRUE(names.insert(setting.name).second) << setting.name << " stands twice";
    EXPECT_EQ(find_setting(setting.name), &setting);
    Settings s;
    for (const SettingChoice& choice : setting.choices) {
      setting.set(s, choice.name);
      EXPECT_EQ(std::get<std::string>(setting.get(s)), choice.name);
      EXPECT_NO_THROW(s.check()) << setting.name << " " << choice.name;
    }
    if (!setting.choices.empty() || setting.least > setting.most) continue;
    const bool is_whole = std::holds_alternative<int64_t>(setting.get(s));
    for (const double bound : {setting.least, setting.most}) {
      SettingValue value = bound;
      if (is_whole) value = static_cast<int64_t>(bound);
      setting.set(s, value);
      EXPECT_NO_THROW(setting.check(s)) << setting.name << " " << bound;
      EXPECT_EQ(setting.get(s), value) << setting.name;
    }
  }
  EXPECT_EQ(find_setting("tea"), nullptr);
}

TEST(SettingsTable, SettingsThatChangeTheExpectationAreMarked) {
  std::set<std::string> marked;
  for (const SettingInfo& setting : setting_table())
    if (setting.changes_expectation) {
      marked.insert(setting.name);
      EXPECT_TRUE(setting.changes_image && setting.changes_bits) << setting.name;
    }
  // A new setting that changes the expectation of the image must be listed here.
  const std::set<std::string> known = {
      "alpha",        "clamp_indirect", "crop",   "filter",    "filter_width",
      "firefly",      "fresnel",        "height", "max_depth", "overscan",
      "merge_radius", "texture_filter", "width"};
  EXPECT_EQ(marked, known);
  EXPECT_EQ(setting_table().size(), 50u) << "is the expectation another with the new setting?";
}

TEST(SettingsTable, WhatIsBeyondIsRefused) {
  for (const SettingInfo& setting : setting_table()) {
    if (!setting.choices.empty() || setting.least > setting.most || setting.most > 4e9) continue;
    Settings s;
    const double beyond = setting.most * 1.01 + 1;
    if (std::holds_alternative<int64_t>(setting.get(s)))
      setting.set(s, static_cast<int64_t>(beyond));
    else
      setting.set(s, beyond);
    EXPECT_THROW(setting.check(s), Error) << setting.name;
    EXPECT_THROW(s.check(), Error) << setting.name;
  }
}

TEST(SettingsTable, DefaultsThatFollowFromOthersComeBack) {
  const SettingInfo& width = *find_setting("filter_width");
  Settings s;
  width.set(s, 2.5);
  EXPECT_EQ(s.filter_width, 2.5f);
  width.set(s, {});
  EXPECT_FALSE(s.filter_width);
  EXPECT_THROW(find_setting("spp")->set(s, {}), Error);
}

TEST(SettingsTable, PoliciesHaveTheirSentences) {
  for (const PolicyInfo& policy : policy_table())
    EXPECT_EQ(std::string(policy.help).back(), '.') << policy.name;
}

}  // namespace
}  // namespace wavecomb
