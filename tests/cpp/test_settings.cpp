// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/core/settings.h"

#include <gtest/gtest.h>

#include <limits>

#include "wavecomb/core/error.h"

namespace wavecomb {
namespace {

/// Returns the message that check() throws, or "".
std::string complaint(const Settings& s) {
  try {
    s.check();
  } catch (const Error& e) {
    return e.what();
  }
  return "";
}
template <typename T>
void expect_refused(T Settings::* option, T value, const std::string& name) {
  Settings s;
  s.*option = value;
  const std::string message = complaint(s);
  EXPECT_NE(message.find(name), std::string::npos) << name << ": '" << message << "'";
  EXPECT_EQ(message.find('\n'), std::string::npos);
}
template <typename T>
void expect_taken(T Settings::* option, T value) {
  Settings s;
  s.*option = value;
  EXPECT_EQ(complaint(s), "");
}

TEST(Settings, DefaultsAreValid) {
  EXPECT_EQ(complaint(Settings{}), "");
}

TEST(Settings, RegionsAreWithinThePicture) {
  Settings s;
  s.width = 20;
  s.height = 10;
  for (const Region valid : {Region{0, 0, 20, 10}, Region{19, 9, 20, 10}, Region{3, 2, 7, 9}}) {
    s.region = valid;
    EXPECT_EQ(complaint(s), "");
  }
  for (const Region empty : {Region{5, 2, 5, 8}, Region{6, 2, 5, 8}, Region{1, 8, 2, 8}}) {
    s.region = empty;
    EXPECT_NE(complaint(s).find("no pixels"), std::string::npos);
  }
  for (const Region outside : {Region{0, 0, 21, 10}, Region{0, 0, 20, 11}, Region{30, 0, 40, 5}}) {
    s.region = outside;
    EXPECT_NE(complaint(s).find("not within"), std::string::npos);
  }
}

TEST(Settings, EachOptionIsChecked) {
  expect_refused<uint32_t>(&Settings::width, 0, "width");
  expect_refused<uint32_t>(&Settings::width, 65536, "width");
  expect_refused<uint32_t>(&Settings::height, 0, "height");
  expect_refused<uint32_t>(&Settings::height, 0xffffffffu, "height");
  expect_refused<uint32_t>(&Settings::spp, 0, "spp");
  expect_refused<uint32_t>(&Settings::spp, (1u << 20) + 1, "spp");
  expect_refused<uint32_t>(&Settings::max_depth, 4097, "max_depth");
  expect_refused<uint32_t>(&Settings::roulette_depth, 5000, "roulette_depth");
  expect_refused<uint32_t>(&Settings::threads, 1025, "threads");
  expect_refused<uint32_t>(&Settings::wave_size, 63, "wave_size");
  expect_refused<uint32_t>(&Settings::wave_size, (1u << 20) + 1, "wave_size");
  for (const uint32_t lanes : {2u, 3u, 5u, 7u, 12u, 32u})
    expect_refused<uint32_t>(&Settings::lanes, lanes, "lanes");
  constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
  constexpr float kInf = std::numeric_limits<float>::infinity();
  for (const float bad : {kNan, kInf, -1.f, 0.f, 33.f})
    expect_refused<std::optional<float>>(&Settings::filter_width, bad, "filter_width");
  for (const float bad : {kNan, kInf, -1.f})
    expect_refused<float>(&Settings::clamp_indirect, bad, "clamp_indirect");
}

TEST(Settings, BoundsAreTaken) {
  expect_taken<uint32_t>(&Settings::spp, 1);
  expect_taken<uint32_t>(&Settings::spp, 1u << 20);
  expect_taken<uint32_t>(&Settings::max_depth, 0);
  expect_taken<uint32_t>(&Settings::wave_size, 64);
  expect_taken<uint32_t>(&Settings::wave_size, 1u << 20);
  expect_taken<uint32_t>(&Settings::wave_size, 0);
  for (const uint32_t lanes : {0u, 1u, 4u, 8u, 16u})
    expect_taken<uint32_t>(&Settings::lanes, lanes);
  expect_taken<std::optional<float>>(&Settings::filter_width, 0.01f);
  expect_taken<std::optional<float>>(&Settings::filter_width, 32.f);
}

TEST(Settings, EachFilterHasItsOwnWidth) {
  Settings s;
  EXPECT_EQ(s.used_filter_width(), 3.f);  // Blackman-Harris
  s.filter = FilterKind::kGaussian;
  EXPECT_EQ(s.used_filter_width(), 3.f);
  s.filter = FilterKind::kBox;
  EXPECT_EQ(s.used_filter_width(), 1.f);
  s.filter_width = 2.5f;
  EXPECT_EQ(s.used_filter_width(), 2.5f);
  s.filter_width.reset();
  EXPECT_EQ(s.used_filter_width(), 1.f);
}

TEST(Settings, LargestPicture) {
  Settings s;
  s.width = 65535;
  s.height = 4096;
  EXPECT_EQ(complaint(s), "");
  s.height = 4097;
  EXPECT_NE(complaint(s).find("width x height"), std::string::npos);
}

TEST(Settings, MessagesSayWhatMayBe) {
  Settings s;
  s.spp = 0;
  EXPECT_EQ(complaint(s), "spp is 0; it must be from 1 to 1048576");
}

}  // namespace
}  // namespace wavecomb
