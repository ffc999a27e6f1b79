// SPDX-License-Identifier: Apache-2.0
/// Skips tests whose requirements, such as optional dependencies, are missing. A test whose
/// requirement is missing is skipped, or fails with WAVECOMB_STRICT=1 or in CI. Tests that take
/// minutes run with WAVECOMB_LONG=1, which `make test-long` sets.
#pragma once
#include <gtest/gtest.h>

#include <algorithm>
#include <cctype>
#include <cstdlib>
#include <string>

namespace wavecomb {

/// Whether an environment variable is set to something other than 0, false, no, off or an empty
/// string.
inline bool is_on(const char* name) {
  const char* given = std::getenv(name);
  std::string value = given ? given : "";
  std::transform(value.begin(), value.end(), value.begin(),
                 [](unsigned char c) { return char(std::tolower(c)); });
  return !(value.empty() || value == "0" || value == "false" || value == "no" || value == "off");
}

/// Returns whether a missing requirement is a failure. WAVECOMB_STRICT decides if it is set;
/// otherwise, a missing requirement is a failure in CI only.
inline bool is_strict() {
  return is_on(std::getenv("WAVECOMB_STRICT") ? "WAVECOMB_STRICT" : "CI");
}

/// Whether long tests run.
inline bool is_long() {
  return is_on("WAVECOMB_LONG");
}

/// Returns whether this run includes a case of a table. Long tests run all cases, and other runs
/// every n-th case.
inline bool includes_case(size_t index, size_t n) {
  return is_long() || index % n == 0;
}

}  // namespace wavecomb

/// Skips or fails a test, or its SetUp, if a requirement is missing. `why_not` is a std::string
/// with the reason, empty if the requirement is met.
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

/// Skips a test that takes too long for `make test`.
#define WAVECOMB_LONG() \
  if (!::wavecomb::is_long()) GTEST_SKIP() << "long: make test-long runs it"
