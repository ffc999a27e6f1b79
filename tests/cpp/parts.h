// SPDX-License-Identifier: Apache-2.0
/// What a test needs: without it the test is skipped, or fails where every part has to be (CI,
/// WAVECOMB_STRICT=1). What takes minutes runs where WAVECOMB_LONG=1, as `make test-long` sets it.
#pragma once
#include <gtest/gtest.h>

#include <algorithm>
#include <cctype>
#include <cstdlib>
#include <string>

namespace wavecomb {

/// Whether an environment variable is set to anything but 0, false, no, off or nothing.
inline bool is_on(const char* name) {
  const char* given = std::getenv(name);
  std::string value = given ? given : "";
  std::transform(value.begin(), value.end(), value.begin(),
                 [](unsigned char c) { return char(std::tolower(c)); });
  return !(value.empty() || value == "0" || value == "false" || value == "no" || value == "off");
}

/// Whether a missing part is a failure: as WAVECOMB_STRICT says, or else in CI.
inline bool is_strict() {
  return is_on(std::getenv("WAVECOMB_STRICT") ? "WAVECOMB_STRICT" : "CI");
}

/// Whether tests take as long as they need.
inline bool is_long() {
  return is_on("WAVECOMB_LONG");
}

}  // namespace wavecomb

/// Ends a test, or its SetUp, that lacks a part; `why_not` is a std::string, empty where it is
/// there.
#define WAVECOMB_NEEDS(part, why_not)                                                            \
  do {                                                                                           \
    const std::string wavecomb_reason = (why_not);                                               \
    if (!wavecomb_reason.empty()) {                                                              \
      if (::wavecomb::is_strict())                                                               \
        FAIL() << "skipped where every part has to be (CI or WAVECOMB_STRICT): needs " part ": " \
               << wavecomb_reason;                                                               \
      GTEST_SKIP() << "needs " part ": " << wavecomb_reason;                                     \
    }                                                                                            \
  } while (false)

/// Ends a test that is too long for `make test`.
#define WAVECOMB_LONG() \
  if (!::wavecomb::is_long()) GTEST_SKIP() << "long: make test-long runs it"
